"""What is measured: lidarlift beside its peers and against exact truth; see README.md here. Not installed."""
