"""The map, and the removal of moving objects from it."""
