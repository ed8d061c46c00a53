"""The command `lidarlift`, a module a command: the one place where slam and eval meet."""

from slam.cli.app import main

__all__ = ["main"]
