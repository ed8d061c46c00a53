"""Drawings of charts and pictures: a list of shapes, written as PNG and SVG, in a tenth of matplotlib's time."""
