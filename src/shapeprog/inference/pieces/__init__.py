"""Oriented boxes that a target may consist of, ranked: components, groups, rods, limbs, slabs and sheets."""
