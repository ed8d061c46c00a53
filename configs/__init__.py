"""Presets: what differs from the defaults of slam/config.py. Installed as slam.presets."""
