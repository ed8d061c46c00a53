"""Scan registration: voxel Gaussians, NDT and ICP."""
