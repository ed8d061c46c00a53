"""Faults that runs must survive: kills, full disks, damaged input."""
