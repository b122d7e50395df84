"""Conversion between the notations: parts placed from the sides of the whole, and statements in cells."""

from shapeprog.language.convert.cells import call_in_cells as call_in_cells
from shapeprog.language.convert.cells import in_cells as in_cells
from shapeprog.language.convert.cells import named_cells as named_cells
from shapeprog.language.convert.placed import placed as placed
from shapeprog.language.convert.placed import placed_again as placed_again
from shapeprog.language.convert.placed import placed_function as placed_function
from shapeprog.language.convert.placed import placed_if_possible as placed_if_possible
