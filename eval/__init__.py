"""How good a trajectory is: ATE and RPE by evo, KITTI's drift, runs beside each other, and the tables and plots of
these. `eval.depth`: how good predicted depth is, in scans and in depth images."""
