"""Extrinsics of a camera to the LiDAR from a recorded sequence, without targets, and the check of given ones."""
