"""Which systems are compared, and on how many channels."""

REFERENCE = "kiss-icp"  # what the others are held against
OURS = {"ndt": None, "ndt-scan-to-scan": "scan-to-scan"}  # with their presets; the input's own comes on top
SYSTEMS = (*OURS, REFERENCE, "vgicp", "gicp", "point-to-plane")
CHANNELS = ("64", "16")
