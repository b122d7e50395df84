"""Libraries of functions: learned from many programs, kept as program text, and recognised in others."""

from shapeprog.library.learning import learn
from shapeprog.library.rewriting import with_library
from shapeprog.library.store import Library, joined, library_of, load_library, save_library

__all__ = ["Library", "joined", "learn", "library_of", "load_library", "save_library", "with_library"]
