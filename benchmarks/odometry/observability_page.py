"""The page observability.md, made of the figures in the JSON file and nothing else."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from benchmarks.common.page import table, target, verdict, without_about
from benchmarks.odometry.nees import ABSOLUTE, KEYFRAMES
from eval.text import number
from slam.data.covariance_file import AXES

#: Structure along the road of a frame: none within range; an end of the tunnel within range; structure that repeats
#: after a period; any other.
NOTHING, ENDS, REPEATS, ELSEWHERE = "nothing", "an end", "repeats", "elsewhere"
OFF = 0.1  # m along the path, from one frame to the next: wrong
NEAR = 10.0  # deg between the reported direction and the true one
TOLD, FALSE = 0.95, 0.01  # target shares of degenerate frames: without structure, and elsewhere
LEAST, MOST = 0.3, 3.0  # NEES
LENGTHS = (*(str(count) for count in KEYFRAMES), ABSOLUTE)
HEADER = (
    "sequence", "input", "along the road", "frames", "reported %", "lost %", "off", "unreported", "verdict",
)  # fmt: skip
ERRORS = (
    "sequence", "input", "named", "angle deg", f"within {NEAR:g} deg %", "ATE m", "along m", "path m", "true path m",
)  # fmt: skip

PROTOCOL = f"""\
* Our odometry with the default settings for the input, without loops. Inputs: `full`, as recorded; `16`, sixteen evenly
  spaced rings; or these enriched by the method named. The ground truth is exact.
* Along the road, for each frame: `{NOTHING}`: within the range that the odometry uses, {{reach}} m, no structure
  determines the position along the road (in the tunnel, with its ends out of range). `{ENDS}`: in the tunnel, with an
  end within range, which sparse rings may miss: no target. `{REPEATS}`: the structure repeats after a period longer
  than the motion between frames (the bridge: spans of 36 m, posts every 2 m): the motion can be observed, or be
  confused with another, and wrong frames should be degenerate. `{ELSEWHERE}`: all other frames.
* Reported: the frame is `degenerate`. Lost: the frame is `failed`, with the prediction kept in all directions. Off: the
  error of the motion from the frame before is more than {OFF:g} m along the path; unreported: the frames among these
  that are neither degenerate nor failed.
* Named: degenerate frames of the first three kinds; the angle (median) between the reported direction, the one nearest
  to the axis if there are several, and the true axis.
* NEES of the motion between frames, for each axis of the sensor (x ahead, y left, z up): 1 for a consistent covariance,
  the target is {LEAST:g} to {MOST:g}. The first frames do not count. The motion from a failed frame has its error too.
* NEES over longer ways: of the motions over some keyframes, 2 m apart, and of the {ABSOLUTE} relative to the first
  one, as `trajectory_covariance.csv` has them: the registration errors of both ends, which do not accumulate, and the
  drift of the local map, which does. All six degrees of freedom together, and the smallest and largest along an axis.
  Such motions overlap, and the {ABSOLUTE} of a sequence are little more than one sample.
* ATE: rmse of positions after SE(3) alignment. Along: how far the last position is ahead of the ground truth.
"""


def page(found: Mapping[str, Any]) -> str:
    """`found` is the JSON file: the drives by name, [drive][input] -> figures, and "about"."""
    about, results = found["about"], without_about(found)
    cases = list(_cases(results))
    reach = ", ".join(sorted({f"{entry['reach_m']:g}" for _, _, entry in cases}))
    return f"""# Observability and consistency

{about["date"]}, {about["cpu"]}, {about["cores"]} cores.

```
{about["command"]}
```

{PROTOCOL.format(reach=reach)}
{table(("target", "figure", "limit", "verdict"), targets(results))}
{table(HEADER, _kinds(cases), words=3)}
{table(ERRORS, _errors(cases), words=2)}
NEES

{table(("sequence", "input", *AXES, "all", "verdict"), _nees(cases), words=2)}
NEES over longer ways: keyframes, and {ABSOLUTE}

{table(("sequence", "input", *LENGTHS, "along an axis", "verdict"), _over_keyframes(cases), words=2)}"""


def targets(results: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Targets: name, figure, limit, and whether it is met."""
    cases = list(_cases(results))
    aims: list[tuple[str, float | None, str, float, int]] = []
    for drive, name, entry in cases:
        for kind, goal in ((NOTHING, "reported, no structure"), (REPEATS, "reported if off, repeating structure")):
            if kind in entry["kinds"]:
                aims.append((f"{goal}, {drive}, {name} [share]", _told(kind, entry["kinds"][kind]), ">=", TOLD, 2))
    false = [entry["kinds"][ELSEWHERE]["degenerate"] for *_, entry in cases if ELSEWHERE in entry["kinds"]]
    along = [value for *_, entry in cases for value in entry["nees_by_axis"].values()]
    aims += [
        ("reported elsewhere, maximum over sequences [share]", max(false, default=None), "<=", FALSE, 3),
        ("NEES along an axis, minimum over sequences", min(along, default=None), ">=", LEAST, 2),
        ("NEES along an axis, maximum over sequences", max(along, default=None), "<=", MOST, 2),
    ]
    over = [entry["nees_over_keyframes"] for *_, entry in cases]
    for length in LENGTHS:
        name = f"NEES of the {ABSOLUTE}" if length == ABSOLUTE else f"NEES over keyframes: {length}"
        all_axes = [figures[length]["all"] for figures in over if length in figures]
        within = [LEAST <= value <= MOST for value in all_axes]
        aims.append(
            (f"{name}, share within {LEAST:g} to {MOST:g}", sum(within) / len(within) if within else None, ">=", 1, 2)
        )
    return [target(*aim) for aim in aims]


def _told(kind: str, facts: Mapping[str, Any]) -> float | None:
    """Share of a target: of all frames, or of the wrong ones if the structure repeats."""
    if kind == REPEATS:
        return 1 - facts["off_untold"] / facts["off"] if facts["off"] else None
    return float(facts["degenerate"])


def _cases(results: Mapping[str, Any]) -> Iterator[tuple[str, str, Mapping[str, Any]]]:
    """Sequence, input and figures, for the inputs that the sequence has."""
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


def _over_keyframes(cases: Cases) -> Iterator[tuple[str, ...]]:
    for drive, name, entry in cases:
        by_length = entry["nees_over_keyframes"]
        values = {length: figures["all"] for length, figures in by_length.items()}
        axes = [value for figures in by_length.values() for axis, value in figures.items() if axis != "all"]
        missed = [length for length, value in values.items() if not LEAST <= value <= MOST]
        said = f"missed: {', '.join(missed)}" if missed else "met"
        spread = f"{min(axes):.2f} to {max(axes):.2f}" if axes else "-"
        yield drive, name, *(number(values.get(length), 2) for length in LENGTHS), spread, said if values else "-"
