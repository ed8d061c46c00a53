"""Enrichment methods, which predict ranges and sigmas on virtual rays; registry.py lists their names."""
