"""Places recognised, loops verified and judged, and what they bring, on simulated and on real drives."""
