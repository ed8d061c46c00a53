"""What a run writes while it is under way, so that it can be continued: docs/session.md describes the files."""
