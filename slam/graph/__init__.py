"""The pose graph: odometry and loops as edges, which of the loops are true, and the poses that fit them."""
