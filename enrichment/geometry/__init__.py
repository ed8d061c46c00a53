"""The geometry of sparse scans: virtual rays, rings held out, the image seen along rays, and the loops over them."""
