"""How the shipped weights are trained, and what trainings are compared by."""
