"""Keyframes, and the global map built from them."""
