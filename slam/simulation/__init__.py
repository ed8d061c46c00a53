"""A town to drive in: its geometry, its traffic, and the LiDAR and camera of the car that drives through it."""
