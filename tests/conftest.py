"""Real data for the tests: never in the repository, unpacked once into the user's cache, skipped where it is absent."""

from __future__ import annotations

import fcntl
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import settings

# No test fails by the clock: on a busy machine, or where a kernel is compiled on its first call, examples take longer.
settings.register_profile("unhurried", deadline=None)
settings.load_profile("unhurried")

DEFAULT_ARCHIVES = Path(__file__).resolve().parents[1] / ".." / "shared" / "data"


@pytest.fixture(scope="session")
def archives() -> Path:
    """The folder with the archives and their unpack.py: $LIDARLIFT_TEST_DATA, else ../shared/data."""
    folder = Path(os.environ.get("LIDARLIFT_TEST_DATA", DEFAULT_ARCHIVES))
    if not (folder / "unpack.py").is_file():
        pytest.skip(f"no real data in {folder}; set LIDARLIFT_TEST_DATA to the folder with unpack.py and the archives")
    return folder


@pytest.fixture(scope="session")
def real_data(archives: Path) -> Callable[[str], Path]:
    """`real_data("kitti_raw_0013")` is the folder of that archive, unpacked on first use."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "lidarlift" / "data"

    def unpacked(name: str) -> Path:
        if not (archives / f"{name}.tar").is_file():
            pytest.skip(f"no {name}.tar in {archives}")
        cache.mkdir(parents=True, exist_ok=True)
        with (cache / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # one pytest worker unpacks, the others wait; freed when one dies
            if not (cache / name).exists():
                with tempfile.TemporaryDirectory(dir=cache) as temporary:
                    command = [sys.executable, str(archives / "unpack.py"), temporary, name]
                    subprocess.run(command, check=True, capture_output=True)
                    (Path(temporary) / name).rename(cache / name)
        return cache / name

    return unpacked
