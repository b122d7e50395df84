"""How well programs, points and meshes rebuild a target: distances, what a person sees, and parts."""
