"""Evidence of a target: ``evidence_of(shape)`` gives points of its surface with normals, and free space."""
