"""How good predicted depth is, in scans and in depth images: errors, whether sigma tells the good from the bad, and the
tables and plots of these."""
