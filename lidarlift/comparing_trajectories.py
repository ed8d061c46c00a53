"""Comparison of finished runs and of other systems' trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from slam.data.atomic import require_writable, write_text
from slam.data.errors import InputError

if TYPE_CHECKING:
    from eval.compare import Comparison
    from eval.metrics import Metrics
    from eval.runs import Row, Track
    from eval.sources import Named

TEXT = (".txt", ".csv", ".tum")  # files that can be trajectories and no data set


def compare_trajectories(
    trajectories: Sequence[str | Path],
    out: str | Path | None = None,
    *,
    reference: str | Path | None = None,
    sequence: str | None = None,
    truth_topic: str | None = None,
    calib: str | Path | None = None,
) -> Comparison:
    """Compare finished runs and trajectories of other systems with a reference, and with each other.

    Poses are associated and body frames are treated as by `evaluate`. Trajectories of KITTI's camera 0 are transformed
    into the LiDAR frame, by `calib` or by the calibration that one of the runs has.

    Args:
        trajectories: Each a run folder, a trajectory file in KITTI, TUM or EuRoC format, or RECORDING:TOPIC; LABEL=PATH
            names its row.
        out: Folder for compare.json, compare.md and report.html. Default: nothing is written.
        reference: A trajectory, or a data set with ground truth. Default: the ground truth in the run folders; without
            any, the trajectories are compared with each other only.
        sequence: Name of the sequence, if the reference is a data set that has several.
        truth_topic: Topic of the ground truth, if the reference is a recording.
        calib: KITTI's calib.txt.

    Returns:
        The figures of each trajectory by its label, and the distances between every two.

    Raises:
        InputError: A trajectory cannot be read, trajectories cannot be associated, their body frames differ, runs are
            of different sequences, or `out` cannot be written.
    """
    about = (reference, sequence, truth_topic, calib)
    return compared(trajectories, None if out is None else Path(out), *about)[0]


def compared(
    trajectories: Sequence[str | Path],
    folder: Path | None,
    reference: str | Path | None,
    sequence: str | None,
    truth_topic: str | None,
    calib: str | Path | None,
    command: str | None = None,
) -> tuple[Comparison, str]:
    """Compare as `compare_trajectories`, and return the title as well; `command` is printed in the report."""
    from eval.compare import compare_rows
    from eval.evaluation import write_json
    from eval.report.content import Report
    from eval.report.writing import write_report
    from eval.sources import labelled, read_source, source_of
    from eval.tables import comparison_markdown

    sources = labelled([source_of(str(each)) for each in trajectories])
    if folder is not None:
        _require_apart(folder)
    entries = [read_source(source) for source in sources]
    _require_one_sequence([entry.row for entry in entries])
    truth = _reference([source.path for source in sources], reference, sequence, truth_topic)
    if truth is None and len(entries) < 2:
        raise InputError(f"{trajectories[0]}: a single trajectory and no ground truth; name another, or --reference")
    entries, truth = _in_one_frame(entries, truth, None if calib is None else Path(calib))
    rows = [_with_figures(entry.row, truth.row.track if truth else None) for entry in entries]
    notes = [f"{each.row.label}: {note}" for each in (*entries, *([truth] if truth else [])) for note in each.notes]
    comparison = compare_rows(rows, truth.row.label if truth else None, notes)
    title = f"{', '.join(row.label for row in rows)}; {f'against {comparison.reference}' if truth else 'no reference'}"
    if folder is not None:
        write_json(folder / "compare.json", comparison.as_dict())
        write_text(folder / "compare.md", comparison_markdown(comparison, title))
        track, name = (truth.row.track, truth.row.label) if truth else (None, "")
        write_report(folder, Report(title, rows, track, name, command))
    return comparison, title


def is_of_trajectories(paths: Sequence[str], reference: str | None = None) -> bool:
    """Decide whether paths name finished runs and trajectories, or a data set that is to be run.

    Several paths are of the former kind. A single one is a data set, unless a reference is given, or it is a run
    folder, a text file, RECORDING:TOPIC or LABEL=PATH.
    """
    path = Path(paths[0]).expanduser()
    if len(paths) > 1 or reference is not None:
        return True
    if path.exists():
        return (path / "run.json").is_file() or path.suffix.lower() in TEXT
    return "=" in paths[0] or ":" in paths[0]


def _require_apart(folder: Path) -> None:
    """Check that the comparison can be written, and not into a run folder, which has a report of its own."""
    require_writable(folder)
    if (folder / "run.json").is_file():
        raise InputError(f"{folder}: is a run folder; choose another folder for the comparison")


def _require_one_sequence(rows: Sequence[Row]) -> None:
    names = {row.label: row.run.report["protocol"]["dataset"] for row in rows if row.run}
    if len(set(names.values())) > 1:
        listed = ", ".join(f"{label} is of {name}" for label, name in names.items())
        raise InputError(f"runs of different sequences cannot be compared: {listed}")


def _reference(
    folders: Sequence[Path], said: str | Path | None, sequence: str | None, truth_topic: str | None
) -> Named | None:
    """The stated reference, else the longest ground truth in the run folders, else None."""
    from eval.runs import Row, read_truth
    from eval.sources import Named, read_reference

    if said is not None:
        return read_reference(str(said), sequence, truth_topic=truth_topic)
    for option, value in (("--sequence", sequence), ("--truth-topic", truth_topic)):
        if value is not None:
            raise InputError(f"{option} {value}: is for a data set as --reference; leave it out, or name the data set")
    truths = [truth for folder in folders if folder.is_dir() and (truth := read_truth(folder))]
    return Named(Row("ground truth", max(truths, key=lambda truth: len(truth.poses)))) if truths else None


def _in_one_frame(entries: list[Named], truth: Named | None, calib: Path | None) -> tuple[list[Named], Named | None]:
    """All trajectories with poses of the same body, and the reference's quaternions in the order that fits."""
    from eval.body_frame import read_camera0_calibration
    from eval.sources import as_estimate_tells, in_lidar_frame

    T, origin = None, ""
    if calib is not None:
        T, origin = read_camera0_calibration(calib), calib.name
    else:
        found = next((each for each in entries if each.T_camera0_lidar is not None), None)
        if found:
            T, origin = found.T_camera0_lidar, f"the calibration of {found.row.label}"
    if truth:
        truth = as_estimate_tells(truth, entries[0].row.track, T)
    both = in_lidar_frame([*entries, *([truth] if truth else [])], T, origin)
    if calib is not None and all(each is before for each, before in zip(both, [*entries, truth], strict=False)):
        raise InputError(f"--calib {calib}: no trajectory has to be transformed; leave it out")
    return both[: len(entries)], both[-1] if truth else None


def _with_figures(row: Row, truth: Track | None) -> Row:
    """The row with its figures against the reference, in place of those against a ground truth of its own."""
    from eval.evaluation import evaluate_poses

    if truth is None:
        return replace(row, metrics=None)

    def figures(track: Track) -> Metrics:
        try:
            return evaluate_poses(track.poses, truth.poses, track.stamps, truth.stamps)
        except InputError as error:
            raise InputError(f"{row.label} against the reference: {error}") from error

    run = row.run and replace(row.run, odometry_metrics=figures(row.run.odometry))
    return replace(row, metrics=figures(row.track), run=run)
