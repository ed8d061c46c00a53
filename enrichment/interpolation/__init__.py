"""Interpolation between rings without learning: ray segments, and depth completion."""
