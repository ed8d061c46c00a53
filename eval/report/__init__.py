"""The report of a run or a comparison: one self-contained page, its figures as files, its tables."""
