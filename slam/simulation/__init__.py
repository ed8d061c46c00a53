"""Scenes to drive and walk through, and the LiDAR and camera that record them."""
