"""Blocks that may be part of the program: statements on pieces, loops over copies, and calls of functions."""
