"""Loaders of data sets that many use, a module each."""
