"""Ranges predicted by enrichment methods, compared with held-out rings."""
