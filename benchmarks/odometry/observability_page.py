"""The page observability.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, target, verdict, without_about
from eval.text import number
from slam.data.covariance_file import AXES

#: What there is along the road of a frame: nothing within reach; in the same tube, but one of its ends within reach;
#: what looks the same again after a period; all that a town has.
NOTHING, ENDS, REPEATS, ELSEWHERE = "nothing", "an end", "repeats", "elsewhere"
OFF = 0.1  # m along the way, from one frame to the next: wrong
NEAR = 10.0  # deg between the direction that is named and the true one
TOLD, FALSE = 0.95, 0.01  # shares that are aimed at: told where nothing holds, and elsewhere
LEAST, MOST = 0.3, 3.0  # NEES along an axis
HEADER = (
    "drive", "input", "along the road", "frames", "told %", "lost %", "off", "untold", "verdict",
)  # fmt: skip
ERRORS = (
    "drive", "input", "named", "angle deg", f"within {NEAR:g} deg %", "ATE m", "along m", "path m", "true path m",
)  # fmt: skip

PROTOCOL = f"""\
* Our odometry as lidarlift sets it up for the input, no loops. `full` as recorded, `16` sixteen rings evenly, a
  method's name where it fills these in. Truth is exact.
* Along the road, of each frame: `{NOTHING}`: within the range that the odometry uses, {{reach}} m, nothing tells how
  far along the car is (in the tunnel, its ends out of reach). `{ENDS}`: in the tunnel, an end within reach, which
  sparse rings may not hit: not judged. `{REPEATS}`: all looks the same again after a period longer than a frame's step
  (the bridge: spans of 36 m, posts every 2 m): the step can be told, or be taken for another, and whoever is wrong
  there has to say so. `{ELSEWHERE}`: all else.
* Told: the odometry called the frame degenerate. Lost: it kept the prediction in all directions. Off: the motion from
  the frame before is wrong by more than {OFF:g} m along the way; untold: of these, those that are neither degenerate
  nor lost.
* Named: degenerate frames where nothing holds, an end is in reach or all repeats; the angle (median) between the
  direction that the frame names, the one nearest to the axis if there are several, and the true axis.
* NEES of the motion from frame to frame, each axis of the sensor alone (x ahead, y left, z up): 1 where the covariance
  is true, {LEAST:g} to {MOST:g} is the aim. The first frames do not count.
* ATE: rmse of positions after SE(3) alignment. Along: how far ahead of the truth the last position lies.
"""


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the drives by name, [drive][input] -> figures, and "about"."""
    about, results = found["about"], without_about(found)
    note = f"\n{found['about']['note']}\n" if "note" in found["about"] else ""
    cases = list(_cases(results))
    reach = ", ".join(sorted({f"{entry['reach_m']:g}" for _, _, entry in cases}))
    return f"""# Observability and consistency

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.

```
{about["command"]}
```
{note}
{PROTOCOL.format(reach=reach)}
{table(("target", "figure", "limit", "verdict"), targets(results))}
{table(HEADER, _kinds(cases), words=3)}
{table(ERRORS, _errors(cases), words=2)}
NEES

{table(("drive", "input", *AXES, "all", "verdict"), _nees(cases), words=2)}"""


def targets(results: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Targets: name, figure, limit, and whether it is met."""
    cases = list(_cases(results))
    aims: list[tuple[str, float | None, str, float, int]] = []
    for drive, name, entry in cases:
        for kind, goal in ((NOTHING, "told where nothing holds"), (REPEATS, "told where it is off, all repeating")):
            if kind in entry["kinds"]:
                aims.append((f"{goal}, {drive}, {name} [share]", _told(kind, entry["kinds"][kind]), ">=", TOLD, 2))
    false = [entry["kinds"][ELSEWHERE]["degenerate"] for *_, entry in cases if ELSEWHERE in entry["kinds"]]
    along = [value for *_, entry in cases for value in entry["nees_by_axis"].values()]
    aims += [
        ("told elsewhere, most of all drives [share]", max(false, default=None), "<=", FALSE, 3),
        ("NEES along an axis, least of all drives", min(along, default=None), ">=", LEAST, 2),
        ("NEES along an axis, most of all drives", max(along, default=None), "<=", MOST, 2),
    ]
    return [target(*aim) for aim in aims]


def _told(kind: str, facts: Mapping[str, Any]) -> float | None:
    """The share that a target is about: of all frames, but of those alone that are off where all repeats."""
    if kind == REPEATS:
        return 1 - facts["off_untold"] / facts["off"] if facts["off"] else None
    return float(facts["degenerate"])


def _cases(results: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Drive, input and figures, of those inputs that the drive has."""
    for drive, by_input in results.items():
        for name, entry in by_input.items():
            if entry["reason"] is None:
                yield drive, name, entry


Cases = list[tuple[str, str, Mapping[str, Any]]]
GOALS = {NOTHING: (">=", TOLD), REPEATS: (">=", TOLD), ELSEWHERE: ("<=", FALSE)}


def _kinds(cases: Cases) -> Iterator[tuple[str, ...]]:
    for drive, name, entry in cases:
        for kind in (NOTHING, ENDS, REPEATS, ELSEWHERE):
            if kind in entry["kinds"]:
                facts = entry["kinds"][kind]
                yield (
                    drive, name, kind, str(facts["frames"]), number(facts["degenerate"], 1, 100),
                    number(facts["lost"], 1, 100), str(facts["off"]), str(facts["off_untold"]),
                    verdict(_told(kind, facts), *GOALS[kind]) if kind in GOALS else "-",
                )  # fmt: skip


def _errors(cases: Cases) -> Iterator[tuple[str, ...]]:
    for drive, name, entry in cases:
        yield (
            drive, name, str(entry["named"]), number(entry["angle_deg"], 1), number(entry["near"], 0, 100),
            number(entry["ate_m"], 3), number(entry["along_track_m"], 3), number(entry["path_length_m"], 1),
            number(entry["truth_path_length_m"], 1),
        )  # fmt: skip


def _nees(cases: Cases) -> Iterator[tuple[str, ...]]:
    for drive, name, entry in cases:
        values = entry["nees_by_axis"]
        missed = [axis for axis in AXES if not LEAST <= values[axis] <= MOST]
        figures = (number(values[axis], 2) for axis in AXES)
        said = f"missed: {', '.join(missed)}" if missed else "met"
        yield drive, name, *figures, number(entry["nees"], 2), said
