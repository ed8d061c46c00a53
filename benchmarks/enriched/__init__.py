"""Odometry on enriched scans, compared with odometry on all 64 channels."""
