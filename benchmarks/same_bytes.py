"""Do two versions of lidarlift compute the same bytes? Both run the same drives; what they write is compared.

Each version is the command `lidarlift` of an environment of its own, so any two commits can be compared; this script
needs the standard library alone. Every drive is run with 16 channels, enriched by ray-segment, and with 64 channels.
`--simulate N` adds the town's loop: both versions simulate N frames of it, these folders are compared too, and both
run over the one of BEFORE. Writes benchmarks/results/same_bytes.md and .json; the exit code is 1 on any difference.

    python -m benchmarks.same_bytes old/.venv/bin/lidarlift .venv/bin/lidarlift --sequence kitti/sequences/04
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

RESULTS = Path(__file__).parent / "results"
INPUTS = {
    "16": ("--input", "16"),
    "enriched": ("--input", "enriched", "--enricher", "ray-segment"),
    "64": ("--input", "64"),
}
FILES = (
    "trajectory_kitti.txt",
    "trajectory_tum.txt",
    "odometry_kitti.txt",
    "odometry_tum.txt",
    "map.pcd",
    "loops.csv",
    "graph.g2o",
)
TOWN = "the town's loop"
OF_THE_CODE = "simulation.json"  # holds a digest of the simulator's source, which moves and comments change

Digests = dict[str, str]
"""SHA-256 of the files of a folder, by their paths in it."""


@dataclass(frozen=True)
class Comparison:
    """Files that both versions wrote for a sequence and input; `input` is None for the simulated sequence itself."""

    drive: str
    input: str | None
    before: Digests
    after: Digests

    @property
    def same(self) -> bool:
        return bool(self.before) and self.before == self.after

    def verdict(self, file: str) -> str:
        """Result for a file: same, differs, only before, only after, or a dash if neither version wrote it."""
        before, after = self.before.get(file), self.after.get(file)
        if before == after:
            return "-" if before is None else "same"
        return "only after" if before is None else "only before" if after is None else "differs"


def main() -> int:
    options = _parser().parse_args()
    if not options.drive and not options.simulate:
        sys.exit("error: nothing to run; add --sequence PATH or --simulate N")
    commands = (_executable(options.before), _executable(options.after))
    with tempfile.TemporaryDirectory() as work:
        found = compared(commands, options, Path(work))
    text = report(found, [version(command) for command in commands], options.frames)
    options.results.mkdir(parents=True, exist_ok=True)
    content = json.dumps([asdict(comparison) for comparison in found], indent=1)
    (options.results / "same_bytes.json").write_text(content + "\n", encoding="utf-8")
    (options.results / "same_bytes.md").write_text(text, encoding="utf-8")
    print(text)
    return 0 if all(comparison.same for comparison in found) else 1


def compared(commands: tuple[Path, Path], options: argparse.Namespace, work: Path) -> list[Comparison]:
    """The town's loop as both simulate it, where that is asked for, and every drive run by both with every input."""
    found, drives = [], [(path.name, path.resolve()) for path in options.drive]
    if options.simulate:
        towns = [work / name / "town" for name in ("before", "after")]
        for command, town in zip(commands, towns, strict=True):
            _call(command, "simulate", str(town), "--frames", str(options.simulate))
        found.append(Comparison(TOWN, None, *(digests(town, lambda file: file != OF_THE_CODE) for town in towns)))
        drives.append((TOWN, towns[0]))
    for drive, path in drives:
        for name, words in INPUTS.items():
            both = []
            for command in commands:
                with tempfile.TemporaryDirectory(dir=work) as run:
                    _call(command, "run", str(path), *words, f"--frames={options.frames}", "--out", run)
                    both.append(digests(Path(run), lambda file: file in FILES))
            found.append(Comparison(drive, name, *both))
    return found


def digests(folder: Path, wanted: Callable[[str], bool]) -> Digests:
    """Digests of the files in `folder` and below whose path is `wanted`."""
    files = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: hashlib.sha256(path.read_bytes()).hexdigest() for name, path in files.items() if wanted(name)}


def version(command: Path) -> str:
    """The commit of the checkout that the environment lies in, "-dirty" behind it where files are changed."""
    git = ["git", "-C", str(command.parent), "describe", "--always", "--dirty", "--exclude=*"]
    done = subprocess.run(git, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


def report(found: list[Comparison], versions: list[str], frames: str) -> str:
    """The Markdown page: a line for each sequence and input, a column for each file."""
    header = ("sequence", "input", *FILES)
    rows = [
        (comparison.drive, comparison.input, *(comparison.verdict(file) for file in FILES))
        for comparison in found
        if comparison.input
    ]
    lines = ["| " + " | ".join(row) + " |" for row in (header, ["---"] * len(header), *rows)]
    towns = [_simulated(comparison) for comparison in found if comparison.input is None]
    same = sum(comparison.same for comparison in found)
    of_drives = "all frames" if frames == ":" else f"frames {frames}"
    return "\n".join(
        [
            "# Same bytes\n",
            f"Commits {versions[0]} and {versions[1]}, {of_drives}; enriched by ray-segment. "
            f"{same} of {len(found)} comparisons are equal byte for byte. SHA-256 of every file: same_bytes.json.\n",
            *towns,
            *lines,
            "",
        ]
    )


def _simulated(town: Comparison) -> str:
    files = sorted({*town.before, *town.after})
    other = [f"{file} ({town.verdict(file)})" for file in files if town.verdict(file) != "same"]
    verdict = f"not the same: {', '.join(other)}" if other else "same"
    return f"Simulated, {town.drive}: {len(files)} files (without {OF_THE_CODE}, a digest of the code), {verdict}.\n"


def _call(command: Path, *words: str) -> None:
    """Run one version; its failure ends the comparison with the last line that it said."""
    print(command, *words, file=sys.stderr)
    done = subprocess.run([str(command), *words], capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip() or "it said nothing"
        sys.exit(f"error: {command} {' '.join(words)}: exit code {done.returncode}: {said.splitlines()[-1]}")


def _executable(path: Path) -> Path:
    if not path.is_file():
        sys.exit(f"error: {path}: no such command; name an environment's lidarlift, as in .venv/bin/lidarlift")
    return path.absolute()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.same_bytes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("before", type=Path, help="the command lidarlift of the older version")
    parser.add_argument("after", type=Path, help="the command of the newer version")
    parser.add_argument(
        "--sequence",
        "--drive",
        dest="drive",
        type=Path,
        action="append",
        default=[],
        metavar="PATH",
        help="may be repeated",
    )
    parser.add_argument("--simulate", type=int, metavar="N", help="also N frames of the town's loop")
    parser.add_argument("--frames", default=":", metavar="A:B", help="only these frames of every sequence")
    parser.add_argument("--results", type=Path, default=RESULTS, metavar="FOLDER", help="where to write")
    return parser


if __name__ == "__main__":
    sys.exit(main())
