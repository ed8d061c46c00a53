"""Ray casting against triangles, in packets, by Intel's Embree."""
