"""Names of the systems that are compared, and numbers of channels."""

REFERENCE = "kiss-icp"  # what the others are held against
OURS = {"ndt": None, "ndt-scan-to-scan": "scan-to-scan"}  # with their presets
SYSTEMS = (*OURS, REFERENCE, "vgicp", "gicp", "point-to-plane")
#: On the page of scenes. GenZ-ICP's authors ship settings for outdoors and, as the default, for indoors.
GENZ = {"genz-icp": "outdoor", "genz-icp-indoor": "indoor"}
IN_SCENES = (*OURS, REFERENCE, *GENZ, "vgicp", "gicp")
CHANNELS = ("64", "16")
