"""The map and what moved in it."""
