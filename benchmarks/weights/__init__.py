"""Training of the shipped weights and of those for cross-validation."""
