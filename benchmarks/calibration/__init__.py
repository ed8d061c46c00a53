"""Calibration of the camera."""
