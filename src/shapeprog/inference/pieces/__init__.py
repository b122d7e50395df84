"""Oriented boxes that a target may consist of: ``find_pieces(shape)`` gives components, rods and slabs."""
