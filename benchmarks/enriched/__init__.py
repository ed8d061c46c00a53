"""Odometry on enriched scans, against that on all 64 channels."""
