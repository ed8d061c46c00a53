"""lidarlift's SLAM: data sets in, trajectory and map out."""
