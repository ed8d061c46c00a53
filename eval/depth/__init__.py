"""The metrics of predicted depth, in scans and in depth images, with their tables and plots."""
