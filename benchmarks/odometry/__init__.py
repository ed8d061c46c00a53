"""The odometry beside its peers and beside the paper's own chain."""
