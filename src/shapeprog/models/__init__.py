"""Networks: the program generators, the neural executor, decoding and checkpoints."""
