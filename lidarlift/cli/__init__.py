"""The command `lidarlift`, one module per command: arguments, progress bars and printing around lidarlift's API."""

from lidarlift.cli.app import main

__all__ = ["main"]
