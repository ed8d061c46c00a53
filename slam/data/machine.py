"""What the machine gives this process: processor cores, memory and a place to keep things."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder(name: str) -> Path:
    """Where the user's cache keeps what `lidarlift` makes or unpacks once, in a folder of that name."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lidarlift" / name


def usable_cores() -> int:
    """How many cores this process may use: where the system says so those it is bound to, else all."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak_memory() -> float | None:
    """The most memory [MB] that this process has held so far; None where the system does not tell (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1e6 if sys.platform == "darwin" else 1e3), 1)  # the kernel counts kilobytes, macOS bytes
