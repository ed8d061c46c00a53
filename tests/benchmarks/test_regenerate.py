"""The registry of topics covers all pages and pictures, and the command says what it could not check."""

from __future__ import annotations

import importlib
import json
import re
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from benchmarks import regenerate as command
from benchmarks.regenerate import Places, claims, listed, missing, regenerate
from benchmarks.topics import DATA, PEERS, TOPICS, Topic

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", *(ROOT / "docs").glob("*.md"), ROOT / "benchmarks" / "README.md"]


def test_every_page_and_every_picture_has_a_topic() -> None:
    made = {path for topic in TOPICS for path in topic.made}
    results = ROOT / "benchmarks" / "results"
    pages = {str(path.relative_to(ROOT)) for path in results.iterdir() if path.suffix in (".md", ".png")}
    assert pages <= made
    pictures = {str(path.relative_to(ROOT)) for path in (ROOT / "docs").iterdir() if path.suffix in (".png", ".jpg")}
    shown = {
        str((page.parent / link).resolve().relative_to(ROOT))
        for page in PAGES
        for link in re.findall(r"!\[[^\]]*\]\(([^)\s]+)\)", page.read_text(encoding="utf-8"))
    }
    assert pictures | shown <= made
    assert all((ROOT / path).is_file() for path in made)


def test_every_topic_is_a_script_with_known_needs_and_options(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert len({topic.name for topic in TOPICS}) == len(TOPICS)
    for topic in TOPICS:
        assert set(topic.needs) <= set(DATA)
        assert set(topic.peers) <= set(PEERS)
        module = importlib.import_module(f"benchmarks.{topic.module}")
        monkeypatch.setattr(sys, "argv", [topic.module, "--help"])
        with pytest.raises(SystemExit):
            module.main()
        told = capsys.readouterr().out
        assert topic.results == ("--results" in told)
        assert all(option in told for option in topic.arguments if option.startswith("--"))


def test_every_claim_has_a_topic() -> None:
    found = claims()
    assert set(found) <= {topic.name for topic in TOPICS}
    assert len(found["frame_rate"]) == 2
    assert found["paper_chain"][0].startswith("The defaults are better than the paper's own chain")


@pytest.fixture
def places(tmp_path: Path) -> Places:
    (tmp_path / "data" / "kitti_raw_0005").mkdir(parents=True)
    return Places((tmp_path / "data",), tmp_path / "work", tmp_path / "results")


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Topic]:
    """`package("name", "source", *arguments)`: a topic whose module is this source, in place of the benchmarks."""
    root = tmp_path / "root"
    (root / "benchmarks").mkdir(parents=True)
    (root / "benchmarks" / "README.md").write_text("| It prints | 7 | `print_it` | [Page](results/print_it.md) |\n")
    monkeypatch.setattr(command, "ROOT", root)
    monkeypatch.setattr(command, "TABLE", root / "benchmarks" / "README.md")

    def write(name: str, source: str, *arguments: str, **more: object) -> Topic:
        (root / "benchmarks" / f"{name}.py").write_text(source)
        return Topic(name, arguments, 1, **more)  # type: ignore[arg-type]

    return write


NOTE = "import pathlib, sys; pathlib.Path('ran').open('a').write(' '.join(sys.argv[1:]) + chr(10))"


def test_a_topic_gets_its_data_and_is_not_made_twice(
    package: Callable[..., Topic], places: Places, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    topic = package("print_it", NOTE, "{kitti_raw_0005}", "--held-out", "0005={work}/x")
    assert regenerate([topic], places)
    assert regenerate([topic], places)  # an interrupted command goes on behind what is made
    data, work, results = places.data[0] / "kitti_raw_0005", places.work, places.results
    ran = (tmp_path / "root" / "ran").read_text().splitlines()
    assert ran == [f"{data} --held-out 0005={work}/x --results {results}"]
    assert regenerate([topic], places, again=True)
    assert len((tmp_path / "root" / "ran").read_text().splitlines()) == 2
    assert "Made by this version: benchmarks/results/print_it.md" in capfd.readouterr().out


def test_what_another_version_made_is_made_again(package: Callable[..., Topic], places: Places, tmp_path: Path) -> None:
    topic = package("print_it", NOTE)
    places.work.mkdir()
    (places.work / "made.json").write_text(json.dumps({"version": "other", "made": ["print_it"]}))
    assert regenerate([topic], places)
    assert (tmp_path / "root" / "ran").exists()


def test_what_could_not_be_checked_is_said(
    package: Callable[..., Topic], places: Places, capfd: pytest.CaptureFixture[str]
) -> None:
    topics = [
        package("print_it", NOTE, "{nclt_20130110}"),
        package("needs_peer", NOTE, peers=(".peers/kiss-slam/bin/python",)),
        package("fails", "import sys; sys.exit(3)", results=False),
    ]
    assert not regenerate(topics, places)
    told = capfd.readouterr().out
    assert "  print_it: needs nclt_20130110 (keyframes of NCLT 2013-01-10, with poses)\n    It prints: 7\n" in told
    assert "needs_peer: needs .peers/kiss-slam/bin/python (make peers)" in told
    assert "fails: failed with exit code 3" in told


def test_the_list_runs_nothing(places: Places) -> None:
    text = listed(TOPICS, places)
    assert len([line for line in text.splitlines() if line.startswith("| ")]) == len(TOPICS) + 2
    assert "| place_recognition | lacks kitti_00_keyframes, nclt_20130110 |" in text
    assert "kitti_00_keyframes: keyframes of KITTI odometry 00" in text
    assert not places.work.exists()


def test_the_simulated_loop_is_never_missing(places: Places) -> None:
    topic = next(topic for topic in TOPICS if topic.name == "moving_objects")
    assert [name.partition(" ")[0] for name in missing(topic, places)] == ["kitti_raw_0013"]


def test_an_unknown_topic_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.common.script import run_script

    monkeypatch.setattr(sys, "argv", ["regenerate", "frame_rat"])
    with pytest.raises(SystemExit, match="error: frame_rat: no such topic; there are cases, "):
        run_script(command.main)
