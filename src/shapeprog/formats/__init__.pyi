from .files import export, load, save
from .format import FORMATS, Format, format_of, listed, program_suffixes, suffixes

__all__ = [
    "FORMATS", "Format",
    "export", "format_of", "listed", "load", "program_suffixes", "save", "suffixes",
]  # fmt: skip
