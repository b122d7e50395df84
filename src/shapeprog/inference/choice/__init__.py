"""Few of many candidates: what explains most of a target for least text."""
