"""The experiment of the paper, reproduced and extended: runs, tables and plots; ``python -m benchmarks.experiment``."""
