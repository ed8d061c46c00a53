"""Resources of the machine: processor cores, memory and the cache folder."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path


def cache_folder(name: str) -> Path:
    """Return the folder `name` in the user's cache, for data that `lidarlift` computes or unpacks once."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lidarlift" / name


def usable_cores() -> int:
    """Return the number of cores this process may use: those it is bound to if the system states them, else all."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def peak_memory() -> float | None:
    """Return the peak memory of this process so far [MB]; None if the system does not report it (Windows)."""
    try:
        import resource
    except ImportError:
        return None
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return round(peak / (1e6 if sys.platform == "darwin" else 1e3), 1)  # Linux reports kilobytes, macOS bytes


def trim_memory() -> None:
    """Give freed memory back to the system: glibc keeps what several threads freed, a few hundred MB in a run."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library
            ctypes.CDLL(None).malloc_trim(0)
