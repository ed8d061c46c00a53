"""Simulated drives compared with real ones."""
