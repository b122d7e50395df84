"""Roles of parts: ``with_roles(program)`` names each by its place and proportions."""
