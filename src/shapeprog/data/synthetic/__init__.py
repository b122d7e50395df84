"""Synthetic furniture in every statement, with roles: programs that inference should recover."""

from shapeprog.data.synthetic.furniture import FURNITURE, furniture

__all__ = ["FURNITURE", "furniture"]
