"""Whole runs: `lidarlift run` as a process, from its start to the report, by stage and beside other systems."""
