"""Packages and files in pyproject.toml agree with the tree."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
TOPS = ("lidarlift", "slam", "enrichment", "eval")


@pytest.fixture(scope="module")
def pyproject() -> dict[str, Any]:
    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_every_room_is_installed(pyproject: dict[str, Any]) -> None:
    rooms = {file.parent.relative_to(ROOT) for top in TOPS for file in (ROOT / top).rglob("*.py")}
    named = {str(room).replace("/", ".") for room in rooms}
    assert set(pyproject["tool"]["setuptools"]["packages"]) == named | {"slam.presets"}
    assert all((ROOT / room / "__init__.py").is_file() for room in rooms)


def test_one_open3d_for_each_machine(pyproject: dict[str, Any]) -> None:
    """Two would overwrite each other's files; and both are pinned, at one version."""
    markers = pytest.importorskip("packaging.markers")
    wanted = [entry.split(";") for entry in pyproject["project"]["dependencies"] if entry.startswith("open3d")]
    for system, machine in [("linux", "x86_64"), ("linux", "aarch64"), ("darwin", "arm64"), ("win32", "AMD64")]:
        environment = {"sys_platform": system, "platform_machine": machine}
        chosen = [name.partition(">")[0] for name, marker in wanted if markers.Marker(marker).evaluate(environment)]
        assert chosen == ["open3d-cpu" if (system, machine) == ("linux", "x86_64") else "open3d"]
    pinned = re.findall(r"^open3d(?:-cpu)?==(.+)$", (ROOT / "constraints.txt").read_text(), re.MULTILINE)
    assert len(pinned) == 2
    assert len(set(pinned)) == 1


def test_all_that_is_asked_for_is_pinned(pyproject: dict[str, Any]) -> None:
    project = pyproject["project"]
    wanted = [
        *project["dependencies"],
        *(entry for extra in project["optional-dependencies"].values() for entry in extra),
    ]
    names = {canonical(re.split(r"[^\w.-]", entry)[0]) for entry in wanted} - {"lidarlift"}
    assert names <= pinned("constraints.txt") | pinned("benchmarks/peers.txt")


def test_every_peer_is_installed_by_make_and_pinned_in_one_place(pyproject: dict[str, Any]) -> None:
    apart = re.search(r"^PEERS := (.+)$", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert apart is not None
    beside = pyproject["project"]["optional-dependencies"]["benchmarks"]
    assert pinned("benchmarks/peers.txt") == {canonical(name) for name in (*beside, *apart.group(1).split())}
    assert not pinned("benchmarks/peers.txt") & pinned("constraints.txt")


def pinned(file: str) -> set[str]:
    lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
    return {canonical(line.partition("==")[0]) for line in lines if line and not line.startswith("#")}


def test_the_licences_are_there(pyproject: dict[str, Any]) -> None:
    project = pyproject["project"]
    assert project["license"] == "MIT AND CC-BY-NC-SA-3.0"
    code, weights = ((ROOT / file).read_text(encoding="utf-8") for file in project["license-files"])
    assert code.startswith("MIT License")
    assert "non-commercial" in weights
    assert "creativecommons.org/licenses/by-nc-sa/3.0" in weights


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def test_the_list_of_forbidden_imports_of_enrichment_and_eval_is_complete(pyproject: dict[str, Any]) -> None:
    """All of slam but slam.data: a new module of slam has to be named in the contract."""
    contracts = {contract["name"]: contract for contract in pyproject["tool"]["importlinter"]["contracts"]}
    forbidden = contracts["enrichment and eval stand on slam.data alone"]["forbidden_modules"]
    entries = [
        entry for entry in (ROOT / "slam").iterdir() if entry.suffix == ".py" or (entry / "__init__.py").is_file()
    ]
    assert set(forbidden) == {f"slam.{entry.stem}" for entry in entries} - {"slam.data", "slam.__init__"}
