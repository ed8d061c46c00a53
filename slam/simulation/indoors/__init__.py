"""A building of two floors to walk through."""
