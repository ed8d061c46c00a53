from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks import same_bytes

#: Stands in for the command of a version: `run` writes what it is told to, `simulate` a scan for every frame.
COMMAND = """#!{python}
import sys
from pathlib import Path
out = Path(sys.argv[sys.argv.index("--out") + 1] if sys.argv[1] == "run" else sys.argv[2])
out.mkdir(parents=True, exist_ok=True)
if sys.argv[1] == "run" and not Path(sys.argv[2]).is_dir():
    sys.exit("Error: no such folder")
if sys.argv[1] == "run":
    for name, text in {files}.items():
        (out / name).write_text(text + sys.argv[sys.argv.index("--input") + 1])
else:
    for number in range(int(sys.argv[sys.argv.index("--frames") + 1])):
        (out / f"{{number}}.bin").write_bytes(bytes([number + {noise}]))
    (out / "simulation.json").write_text(sys.argv[0])
"""
Version = Callable[..., Path]


@pytest.fixture
def version(tmp_path: Path) -> Version:
    def made(name: str, noise: int = 0, **files: str) -> Path:
        path = tmp_path / name / "venv" / "bin" / "lidarlift"
        path.parent.mkdir(parents=True)
        content = {"trajectory_kitti.txt": "1 0 0", "map.pcd": "points"} | files
        path.write_text(COMMAND.format(python=sys.executable, files=content, noise=noise))
        path.chmod(0o755)
        return path

    return made


def compare(monkeypatch: pytest.MonkeyPatch, *words: object) -> int:
    monkeypatch.setattr(sys, "argv", ["same_bytes", *map(str, words)])
    return same_bytes.main()


def test_versions_with_the_same_bytes_pass(version: Version, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = tmp_path / "drive"
    drive.mkdir()
    words = (version("a"), version("b"), "--drive", drive, "--simulate", 3, "--results", tmp_path)
    assert compare(monkeypatch, *words) == 0
    page = (tmp_path / "same_bytes.md").read_text()
    assert "| drive | enriched | same | - | - | - | same | - | - |" in page
    assert "Simulated, the town's loop: 3 files (without simulation.json, a digest of the code), same." in page
    found = json.loads((tmp_path / "same_bytes.json").read_text())
    assert len(found) == 1 + 2 * 3
    assert found[1]["before"] == found[1]["after"] != found[2]["before"]


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ({"map.pcd": "other points"}, "| drive | 16 | same | - | - | - | differs | - | - |"),
        ({"loops.csv": "i,j"}, "| drive | 64 | same | - | - | - | same | only after | - |"),
    ],
)
def test_different_bytes_are_reported(
    other: dict[str, str], told: str, version: Version, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive = tmp_path / "drive"
    drive.mkdir()
    words = (version("a"), version("b", **other), "--drive", drive, "--results", tmp_path)
    assert compare(monkeypatch, *words) == 1
    assert told in (tmp_path / "same_bytes.md").read_text()


def test_different_simulations_are_reported(version: Version, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    words = (version("a"), version("b", noise=1), "--simulate", 2, "--results", tmp_path)
    assert compare(monkeypatch, *words) == 1
    page = (tmp_path / "same_bytes.md").read_text()
    assert ", not the same: 0.bin (differs), 1.bin (differs)." in page
    assert "| the town's loop | 64 | same |" in page  # both ran over the first version's


def test_a_failing_version_stops_the_comparison(
    version: Version, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(SystemExit, match="exit code 1: Error: no such folder"):
        compare(monkeypatch, version("a"), version("b"), "--drive", tmp_path / "none", "--results", tmp_path)


def test_without_a_drive_it_is_an_error(version: Version, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SystemExit, match="add --sequence PATH or --simulate N"):
        compare(monkeypatch, version("a"), version("b"))
