"""The report of a run or of a comparison: report.html with its figures, next to the results."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path


def report_runs(folder: Path, title: str, folders: Mapping[str, Path], command: str | None = None) -> Path:
    """Write the report of finished runs on one sequence.

    Args:
        folder: The folder for report.html and figures/.
        title: The sequence, and what is compared.
        folders: The run folder of each row, by its label.
        command: The command line that makes the runs again, None if unknown.

    Returns:
        The page.

    Raises:
        InputError: A folder does not hold a complete run, or `folder` cannot be written.
    """
    from eval.report.content import report_of
    from eval.report.writing import write_report

    return write_report(folder, report_of(title, folders, command=command))


def report_run(folder: Path, title: str, command: str | None = None) -> Path:
    """Write the report of one run into its folder; the row is named by the input. See `report_runs`."""
    from slam.session import read_report

    return report_runs(folder, title, {read_report(folder)["protocol"]["input"]: folder}, command)
