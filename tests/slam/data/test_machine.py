"""Resources of the machine, also on systems that lack features of Linux."""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys

import numpy as np
import pytest

from slam.data.machine import peak_memory, trim_memory, usable_cores


def test_peak_memory_is_in_megabytes() -> None:
    held = np.ones(25_000_000)
    peak = peak_memory()
    assert peak is not None
    assert held.nbytes / 1e6 < peak < 100_000


def test_peak_memory_is_none_without_the_module_resource(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "resource", None)
    assert peak_memory() is None


def test_memory_is_not_trimmed_without_glibc(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda _: object())
    trim_memory()


def test_runs_can_be_saved_without_the_module_resource() -> None:
    code = "import sys; sys.modules.update(resource=None, fcntl=None); import slam.session"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_only_the_cores_that_the_process_is_bound_to_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {1, 3, 4}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 8)
    assert usable_cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert usable_cores() == 8
