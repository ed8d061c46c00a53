"""Evaluation of trajectories: ATE and RPE by evo, KITTI's drift, comparison of runs, tables and plots.

`eval.depth` evaluates predicted depth, in scans and in depth images.
"""
