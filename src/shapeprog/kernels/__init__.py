"""What every compiled loop stands on: how kernels are compiled and kept, and words of 32 cells."""
