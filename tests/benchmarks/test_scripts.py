from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = sorted(
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in (ROOT / "benchmarks").rglob("*.py")
    if 'if __name__ == "__main__":' in path.read_text(encoding="utf-8")
)


def test_there_are_scripts() -> None:
    assert {"benchmarks.odometry.frame_rate", "benchmarks.same_bytes"} <= set(SCRIPTS)


@pytest.mark.parametrize("name", SCRIPTS)
def test_scripts_print_their_usage(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    module = importlib.import_module(name)
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    with pytest.raises(SystemExit) as ended:
        module.main()
    assert ended.value.code == 0
    told = capsys.readouterr().out
    assert told.startswith(f"usage: python -m {name} ")
    assert module.__doc__ is not None
    assert module.__doc__.splitlines()[0] in told


def test_a_folder_without_a_drive_is_an_error_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.common.script import run_script
    from benchmarks.odometry.paper_chain import main

    monkeypatch.setattr(sys, "argv", ["paper_chain", str(tmp_path / "none")])
    with pytest.raises(SystemExit) as ended:
        run_script(main)
    assert str(ended.value.code).startswith(f"error: {tmp_path / 'none'}: ")
    assert "\n" not in str(ended.value.code)


def test_the_reported_command_has_no_local_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.common.page import surroundings

    drive = tmp_path / "04"
    drive.mkdir()
    typed = ["script", str(drive), f"--held-out=0005={drive}", "--results", str(tmp_path), "--step", "2"]
    monkeypatch.setattr(sys, "argv", typed)
    about = surroundings(("numpy",))
    assert about["command"].endswith(" 04 --held-out=0005=04 --step 2")
    assert str(tmp_path) not in str(about)
    assert set(about["versions"]) == {"python", "numpy"}
