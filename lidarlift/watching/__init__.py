"""Views of a run while it goes on, or afterwards: rerun, and a page of its progress in a browser."""
