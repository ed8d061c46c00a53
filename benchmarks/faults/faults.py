"""Faults that runs must survive: kills at random moments, full disks, and some 60 kinds of damaged input.

    python -m benchmarks.faults.faults town --kills 160 --final 40 --disks 20

`town` is a data set of `lidarlift simulate town --drive loop --spacing 2.5 --sensor vlp16 --seed 1`: a round through a
town, with loops. A run that was killed or that met a full disk is resumed, until it is finished; then its files must
have the bytes of a run that was not disturbed. Runs are forked from a process that has compiled all kernels, write a
snapshot every 0.3 s instead of every 10, so that many kills meet one, and no report. Writes faults.md and .json in
benchmarks/results.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from benchmarks.faults.process import SNAPSHOT_EVERY

PACKAGES = ("numpy", "numba", "gtsam")
SAID = 110  # characters of a message in the table


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("drive", type=Path, help="the simulated data set")
    arguments.add_argument("--kills", type=int, default=160, metavar="N", help="at moments of whole runs")
    arguments.add_argument("--final", type=int, default=40, metavar="N", help="after the last frame")
    arguments.add_argument("--disks", type=int, default=20, metavar="N", help="limits of the size of files")
    add_results(arguments)
    options = arguments.parse_args()
    write_results(options.results, "faults", measure(options.drive, options.kills, options.final, options.disks), page)


def measure(drive: Path, kills: int, final: int, disks: int) -> dict[str, Any]:
    from benchmarks.faults import damage, disk
    from benchmarks.faults import kills as killing
    from benchmarks.faults.process import warmed_up

    found: dict[str, Any] = {"about": surroundings(PACKAGES)}
    warmed_up(drive)
    with tempfile.TemporaryDirectory() as folder:
        found["kills"] = killing.campaign(drive, Path(folder), kills, final)
        found["disks"] = disk.campaign(drive, Path(folder), disks)
    with tempfile.TemporaryDirectory() as folder:
        found["damage"] = damage.campaign(drive, Path(folder))
    return found


def page(found: Mapping[str, Any]) -> str:
    from benchmarks.faults.damage import is_sound

    kills, disks, damage, about = found["kills"], found["disks"], found["damage"], found["about"]
    places = table(("killed", "kills"), [(place, str(count)) for place, count in kills["kills"].items()])
    endings = table(("with a full disk", "runs"), [(how, str(count)) for how, count in disks["endings"].items()])
    rows = table(
        ("damage", "ended", "sound scans off", "said"),
        [(kind, one["how"], _off(one), _said(one["said"])) for kind, one in damage.items()],
        words=4,
    )
    bad = [kind for kind, one in damage.items() if not is_sound(one)]
    return f"""
# Kills, full disks and damaged input

`{about["command"]}` on {about["date"]}: {about["cpu"]}, {about["cores"]} cores, load {about["load_average"]}.

A round through a simulated town, {kills["frames"]} scans of a VLP-16, {kills["seconds_of_a_run"]} s a run. A snapshot
is written every {SNAPSHOT_EVERY} s (usually every 10 s), and no report. Runs that were killed are resumed, and killed
again, until they are finished. Then odometry, trajectory, covariances, map, loops, graph and metrics are compared with
those of a run that was not killed.

## Kills

{places}
{sum(kills["kills"].values())} kills in {kills["runs"]} runs. {_verdict(kills["faults"])}

A kill by the system leaves what was written to the disk's cache. Power losses are not simulated: the page on
[sessions](../../docs/session.md) says what is flushed when.

## Full disks

No file can grow beyond a limit, from 2 kB to the size of the largest file of a run. Afterwards the run is resumed
without a limit.

{endings}
{_verdict(disks["faults"])}

## Damaged input

{len(damage)} kinds of damage to one of the first scans, to the images, stamps, calibration or ground truth. A run must
end in a correct result, in which the other scans are less than 0.5 m from those without damage, or in an error of one
line. {f"Not so: {', '.join(bad)}." if bad else "All do."}

{rows}"""


def _verdict(faults: list[str]) -> str:
    return f"Faults: {'; '.join(faults)}." if faults else "All were resumed, and ended with the same bytes."


def _off(figures: Mapping[str, Any]) -> str:
    return f"{figures['off']:.3f} m" if "off" in figures else "-"


def _said(text: str) -> str:
    short = text if len(text) <= SAID else f"{text[: SAID - 3]}..."
    return short.replace("|", "/") or "-"


if __name__ == "__main__":
    run_script(main)
