"""A folder for compiled kernels where the package and the user's cache cannot be written."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from slam.kernel_cache import VARIABLE, ensure_kernel_cache

NOWHERE = Path("/proc/1/none")  # nobody can make it


@pytest.fixture(autouse=True)
def _no_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "")
    monkeypatch.delenv(VARIABLE)


def test_numba_decides_where_a_folder_can_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(NOWHERE))
    ensure_kernel_cache(tmp_path)
    assert VARIABLE not in os.environ
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "made" / "when needed"))
    ensure_kernel_cache(NOWHERE)
    assert VARIABLE not in os.environ


def test_a_temporary_folder_takes_their_place_and_the_user_is_told() -> None:
    program = (
        "import os; from pathlib import Path; from slam.kernel_cache import ensure_kernel_cache\n"
        f"ensure_kernel_cache(Path({str(NOWHERE)!r}))\n"
        "from slam.registration import kernels\n"
        f"print(os.environ[{VARIABLE!r}])"
    )
    environment = os.environ | {"XDG_CACHE_HOME": str(NOWHERE)}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert VARIABLE in done.stderr
    assert not Path(done.stdout.strip()).exists()  # removed with the process
