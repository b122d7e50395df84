"""Blocks that may be part of the program: statements on pieces, and loops over copies."""
