"""Place recognition, loop verification, the pose graph, and what loops gain, on simulated and on real drives."""
