"""Measures lidarlift against its peers and against exact ground truth; README.md has the table. Not installed."""
