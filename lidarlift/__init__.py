"""LiDAR-camera SLAM for people with a cheap LiDAR."""
