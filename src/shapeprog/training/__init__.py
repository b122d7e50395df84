"""Training: one visible loop, its exact state, and what is taught: pretraining, the executor, adaptation."""
