"""Recordings: ROS 1 bags, ROS 2 recordings in SQLite and MCAP, as data sets."""
