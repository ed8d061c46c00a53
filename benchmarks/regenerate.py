"""Makes all pages of results and all pictures again, on whatever data is there, and says what could not be checked.

    python -m benchmarks.regenerate --list                           (or: make results ARGS="--list")
    python -m benchmarks.regenerate --data FOLDER [TOPIC ...]        all topics, or those that are named

FOLDER holds data under the names that --list prints; it may be given several times, and the cache of the tests is
looked into, too. A topic whose data or peers are missing is left out, and so is one that this version has made already:
an interrupted command goes on where it was. At the end, the claims of benchmarks/README.md are listed whose figures
could not be measured, each with the reason. The exit code is 1 if a topic failed.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from benchmarks.common.page import table
from benchmarks.common.script import RESULTS, add_results, parser, run_script
from benchmarks.topics import DATA, GIVEN, PEERS, SIMULATED, TOPICS, Topic
from slam.data.atomic import write_text
from slam.data.errors import InputError
from slam.data.machine import cache_folder

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "benchmarks" / "README.md"
#: What figures depend on, for git.
CODE = ("--", "slam", "enrichment", "eval", "lidarlift", "configs", "benchmarks", ":!benchmarks/results", ":!*.md")


@dataclass(frozen=True)
class Places:
    """Places of data and outputs.

    Attributes:
        data: Folders that hold data by the names in DATA.
        work: Folder for what topics write beside their pages, simulated data, and the state.
        results: Folder of the pages.
        before: The command of an earlier version, None if unknown.
    """

    data: tuple[Path, ...]
    work: Path
    results: Path = RESULTS
    before: Path | None = None

    def find(self, name: str) -> Path | None:
        """Return the path of some data, None if it is missing; the simulated loop never is."""
        given = {"before": self.before, "after": Path(sys.executable).with_name("lidarlift"), "work": self.work}
        if name in given:
            return given[name]
        found = next((folder / name for folder in self.data if (folder / name).is_dir()), None)
        return found or (self.work / name if name == SIMULATED else None)


def main() -> None:
    options = _arguments().parse_args()
    places = Places((*options.data, *_usual_folders()), options.work, options.results, options.before)
    topics = _chosen(options.topics)
    if options.list:
        print(listed(topics, places))
        return
    if not regenerate(topics, places, again=options.again):
        sys.exit(1)


def _arguments() -> argparse.ArgumentParser:
    arguments = parser(__doc__)
    arguments.add_argument("topics", nargs="*", metavar="TOPIC", help="names as --list prints them (default: all)")
    arguments.add_argument("--list", action="store_true", help="list topics, what they need and make; run nothing")
    arguments.add_argument("--data", type=Path, action="append", default=[], metavar="FOLDER", help="with the data")
    arguments.add_argument("--before", type=Path, metavar="LIDARLIFT", help="the command of an earlier version")
    arguments.add_argument("--again", action="store_true", help="also what this version has made already")
    work = ROOT / "build" / "results"
    arguments.add_argument(
        "--work", type=Path, default=work, metavar="FOLDER", help="for other files that topics write"
    )
    add_results(arguments)
    return arguments


def regenerate(topics: Sequence[Topic], places: Places, *, again: bool = False) -> bool:
    """Run topics, one after the other, and print what was made and what could not be checked.

    Args:
        topics: The topics, in this order.
        places: Places of data and outputs.
        again: Run topics that this version has made already.

    Returns:
        Whether no topic failed.
    """
    state, version = places.work / "made.json", _version()
    made = {} if again else _read(state, version)
    reasons: dict[str, str] = {}
    for number, topic in enumerate(topics, start=1):
        lacking = missing(topic, places)
        if lacking:
            reasons[topic.name] = f"needs {'; '.join(lacking)}"
        elif topic.name not in made:
            print(f"[{number}/{len(topics)}] {topic.name}, about {topic.minutes} min", flush=True)
            code = _run(topic, places)
            if code:
                reasons[topic.name] = f"failed with exit code {code}, see above"
                continue
            made[topic.name] = version
            write_text(state, json.dumps({"version": version, "made": sorted(made)}, indent=2) + "\n")
    print(report(topics, reasons))
    return not any("exit code" in reason for reason in reasons.values())


def missing(topic: Topic, places: Places) -> list[str]:
    """Return what a topic needs and is not there, with the remedy."""
    data = [f"{name} ({DATA[name]})" for name in topic.needs if places.find(name) is None]
    peers = [f"{peer} ({PEERS[peer]})" for peer in topic.peers if not _installed(peer)]
    return [*data, *peers]


def _installed(peer: str) -> bool:
    return (ROOT / peer).exists() if "/" in peer else importlib.util.find_spec(peer) is not None


def _run(topic: Topic, places: Places) -> int:
    """Run a topic in a process of its own; return its exit code."""
    if SIMULATED in topic.needs:
        _simulate(places.work / SIMULATED, places)
    words = [word for argument in topic.arguments for word in _filled(argument, places)]
    if topic.results:
        words += ["--results", str(places.results)]
    command = [sys.executable, "-m", f"benchmarks.{topic.module}", *words]
    return subprocess.run(command, cwd=ROOT, check=False).returncode


def _filled(argument: str, places: Places) -> list[str]:
    """An argument with the paths of its data."""
    text = re.sub(r"\{(\w+)\}", lambda found: str(places.find(found[1])), argument)
    if "*" not in text:
        return [text]
    path = Path(text)
    return sorted(map(str, path.parent.glob(path.name)))


def _simulate(folder: Path, places: Places) -> None:
    """Simulate the loop, unless it is there."""
    if places.find(SIMULATED) == folder:
        command = [sys.executable, "-m", "lidarlift", "simulate", str(folder), "--drive", "loop"]
        if subprocess.run(command, check=False).returncode:
            raise InputError(f"{folder}: the loop could not be simulated, see above")


def report(topics: Sequence[Topic], reasons: Mapping[str, str]) -> str:
    """Return what was made, and the claims that could not be checked.

    Args:
        topics: The topics that were to be run.
        reasons: Why some of them were not made, by name.
    """
    made = [path for topic in topics if topic.name not in reasons for path in topic.made]
    lines = ["", f"Made by this version: {', '.join(made) or 'nothing'}"]
    if not reasons:
        return "\n".join([*lines, "Every claim of these topics was measured; `git diff` shows what changed."])
    lines.append("Not checked:")
    for name, reason in reasons.items():
        lines.append(f"  {name}: {reason}")
        lines += [f"    {claim}" for claim in claims().get(name, ())]
    return "\n".join(lines)


def claims() -> dict[str, list[str]]:
    """Return the claims of benchmarks/README.md with their figures, by the topic whose page they link to."""
    found: dict[str, list[str]] = {}
    for line in TABLE.read_text(encoding="utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        page = re.search(r"\(results/(\w+)\.md\)", cells[-1])
        if line.startswith("|") and page:
            found.setdefault(page[1], []).append(f"{cells[0]}: {cells[1]}")
    return found


def listed(topics: Sequence[Topic], places: Places) -> str:
    """Return a table of topics: whether they can run, their time, what they need and make."""
    rows = []
    for topic in topics:
        lacking = [name.partition(" (")[0] for name in missing(topic, places)]
        needs = [*(name for name in topic.needs if name not in GIVEN), *topic.peers]
        state = f"lacks {', '.join(lacking)}" if lacking else "ready"
        rows.append((topic.name, state, ", ".join(needs) or "-", ", ".join(topic.made), str(topic.minutes)))
    text = table(("topic", "state", "needs", "makes", "minutes"), rows, words=4)
    used = {name for topic in topics for name in topic.needs}
    return text + "\n" + "".join(f"{name}: {meaning}\n" for name, meaning in DATA.items() if name in used)


def _chosen(names: Sequence[str]) -> list[Topic]:
    known = {topic.name: topic for topic in TOPICS}
    for name in names:
        if name not in known:
            raise InputError(f"{name}: no such topic; there are {', '.join(known)}")
    return [known[name] for name in dict.fromkeys(names)] or list(TOPICS)


def _usual_folders() -> list[Path]:
    """Where the tests have their data: the archives' folder, and what is unpacked of them."""
    archives = os.environ.get("LIDARLIFT_TEST_DATA")
    return [*([Path(archives)] if archives else []), ROOT / ".." / "shared" / "data", cache_folder("data")]


def _read(state: Path, version: str) -> dict[str, str]:
    """The topics that this version has made."""
    try:
        content = json.loads(state.read_text(encoding="utf-8"))
        return dict.fromkeys(content["made"], version) if content["version"] == version else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _version() -> str:
    """The version of the code: the last commit of it, and a digest of what is not committed; pages do not count."""

    def git(*words: str) -> str:
        return subprocess.run(["git", *words, *CODE], cwd=ROOT, capture_output=True, text=True, check=False).stdout

    changes = git("diff", "HEAD")
    digest = f"-{hashlib.sha256(changes.encode()).hexdigest()[:8]}" if changes else ""
    return (git("log", "-1", "--format=%h").strip() or "unknown") + digest


if __name__ == "__main__":
    run_script(main)
