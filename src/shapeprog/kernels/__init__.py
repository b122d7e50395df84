"""Infrastructure of the compiled loops: how kernels are compiled and cached, and words of 32 cells."""
