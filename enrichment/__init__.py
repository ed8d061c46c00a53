"""A sparse scan made dense: virtual rays, their ranges and how sure they are."""
