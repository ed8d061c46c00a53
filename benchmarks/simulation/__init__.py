"""Simulated drives against real ones."""
