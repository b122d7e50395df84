"""How well programs, points and meshes rebuild a target: distances, visual similarity, and parts."""
