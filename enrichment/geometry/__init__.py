"""Geometry of sparse scans: virtual rays, held-out rings, projection of rays into the image, and kernels."""
