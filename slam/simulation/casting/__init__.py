"""Rays against triangles, in packets, through Intel's Embree."""
