"""lidarlift's SLAM: from data sets to trajectory and map."""
