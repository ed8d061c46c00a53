"""How good a trajectory is: ATE and RPE, KITTI's drift, and the files and plots that report them."""
