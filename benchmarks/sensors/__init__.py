"""LiDARs that are built in: rings recovered from simulated scans, and enrichment of sparse ones."""
