"""A simulation that is kept in a folder stays valid until the code that made it changes."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from slam.simulation import fingerprint as module
from slam.simulation.fingerprint import fingerprint

SOURCE = """
from made_up.part import size

def area(side: float) -> float:
    return side * size
"""


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A simulator of two modules: shape, which imports part, and one that is not imported."""
    folder = tmp_path / "made_up"
    folder.mkdir()
    for name, text in {"__init__": "", "part": "size = 2.0\n", "shape": SOURCE, "another": "size = 1.0\n"}.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(module, "PACKAGE", "made_up")
    for name in [name for name in sys.modules if name.startswith("made_up")]:
        monkeypatch.delitem(sys.modules, name)
    importlib.invalidate_caches()
    return folder


def test_comments_docstrings_annotations_and_layout_do_not_count(package: Path) -> None:
    before = fingerprint("made_up.shape")
    (package / "shape.py").write_text(
        '"""A shape."""\n# why\nfrom made_up.part import size\n\n\ndef area(side):\n'
        '    """In m^2."""\n\n    return (side * size)  # so\n'
    )
    assert fingerprint("made_up.shape") == before


@pytest.mark.parametrize(("name", "changed"), [("shape", SOURCE.replace("*", "/")), ("part", "size = 3.0\n")])
def test_code_counts_and_so_does_what_it_imports(package: Path, name: str, changed: str) -> None:
    before = fingerprint("made_up.shape")
    (package / f"{name}.py").write_text(changed)
    assert fingerprint("made_up.shape") != before


def test_what_is_not_imported_does_not_count(package: Path) -> None:
    before = fingerprint("made_up.shape")
    (package / "another.py").write_text("size = 9.0\n")
    assert fingerprint("made_up.shape") == before


def test_the_simulator_is_followed_to_its_kernels_and_to_the_scene() -> None:
    found = module._imported(["slam.simulation.simulation", "slam.simulation.town.scene"])
    assert {"slam.simulation.kernels", "slam.simulation.lidar", "slam.simulation.town.roofs"} <= set(found)
