"""The odometry compared with its peers and with the paper's own chain."""
