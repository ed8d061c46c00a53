"""Ranges that methods of enrichment predict, against rings held out."""
