"""Evaluation of predicted depth in scans and in depth images: errors, calibration of sigma, tables and plots."""
