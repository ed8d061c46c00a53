"""The command `lidarlift`, a module a command: arguments, progress and printing around the functions of lidarlift."""

from lidarlift.cli.app import main

__all__ = ["main"]
