"""The pose graph: odometry and loop edges, rejection of false loops, and optimised poses."""
