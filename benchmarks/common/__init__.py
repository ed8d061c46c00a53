"""Shared by all benchmarks: arguments, errors, cores, results, tables, pictures and simulated drives."""
