"""Recordings of what LiDARs send over the network."""
