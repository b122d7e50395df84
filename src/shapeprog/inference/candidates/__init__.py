"""Blocks that may be part of the program: drawing statements on pieces, and loops over copies."""
