"""Keyframes, and the map that is made of them."""
