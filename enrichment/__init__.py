"""Enrichment of sparse scans: predicted ranges on virtual rays, with their uncertainty."""
