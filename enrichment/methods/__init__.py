"""Methods of enrichment: each predicts ranges and sigmas on virtual rays. registry.py has their names."""
