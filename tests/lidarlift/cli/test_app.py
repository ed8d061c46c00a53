"""Common behaviour of all commands: help, usage errors, a process of its own."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Drive = Callable[..., Path]
Command = Callable[..., Any]


@pytest.mark.parametrize(
    "arguments",
    [
        ("walk",),
        ("run",),
        ("run", "x", "--input", "x"),
        ("run", "x", "--no-such"),
        ("export", "r"),
        ("evaluate", "a"),
    ],
)
def test_usage_errors_exit_with_2(lidarlift: Command, arguments: tuple[str, ...]) -> None:
    result = lidarlift(*arguments)
    assert result.code == 2
    assert "Usage" in result.err


COMMANDS = ("run", "compare", "enrich", "evaluate", "export", "fit-lasers", "simulate", "demo", "depth-benchmark")


@pytest.mark.parametrize("command", ["", *COMMANDS, "study sparsity", "study edges", "train lift", "train depth"])
def test_help_has_an_example(lidarlift: Command, command: str) -> None:
    result = lidarlift(*command.split(), "--help")
    assert result.code == 0
    assert "lidarlift" in result.out
    assert "Example" in result.out


def test_help_imports_no_computing_modules() -> None:
    """numpy alone takes as long to import as the whole command line."""
    slow = {"numpy", "scipy", "numba", "cv2", "open3d", "evo", "pydantic", "yaml"}
    program = f"import sys, lidarlift.cli; print(*{slow} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, check=True).stdout == b"\n"


def test_the_installed_command_runs(street_drive: Drive, tmp_path: Path) -> None:
    """In a process of its own: no traceback and no warnings on stderr, colours and bars only on terminals."""
    command = [sys.executable, "-m", "lidarlift", "run", str(street_drive({3: b""})), "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "Warning" not in done.stderr
    assert "\x1b" not in done.stdout + done.stderr
    assert "Note: empty scan" in done.stderr
    assert (tmp_path / "r" / "run.json").exists()
