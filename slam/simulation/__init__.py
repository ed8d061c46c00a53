"""Simulation of scenes for driving and walking, recorded by a LiDAR and a camera."""
