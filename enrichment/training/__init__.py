"""Networks for depth learn from drives: samples, a file that packs them, drawing and changing them, the loop."""
