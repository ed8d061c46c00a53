"""What the benchmarks share: arguments, errors, cores, results, tables, pictures and simulated drives."""
