"""Frames and problems of a run as rows of its session."""

from __future__ import annotations

import json

from slam.data.errors import InputError
from slam.data.problem import Problem
from slam.journal.session_file import REMEDY, SessionFile
from slam.journal.tables import FRAME, PROBLEM, Row, RowError, array_of, text_of
from slam.records import STAGES, STATUSES, FrameRecord, Records


def row_of(record: FrameRecord) -> Row:
    """Return the row of a frame."""
    return (
        int(record.index),
        float(record.stamp),
        record.status,
        float(record.inlier_ratio),
        int(record.points),
        *(text_of(values) for values in (record.pose, record.covariance, record.unobserved)),
        json.dumps(record.milliseconds),
    )


def records_in(file: SessionFile) -> Records:
    """Return the records of all frames.

    Raises:
        InputError: A row is damaged.
    """
    try:
        return Records(_record(row) for row in file.rows(FRAME))
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"{file.path}: damaged ({error}); {REMEDY}") from error


def problems_in(file: SessionFile) -> list[Problem]:
    """Return the problems of the data found so far.

    Raises:
        InputError: A row is damaged.
    """
    return [Problem(kind, message) for kind, message in file.rows(PROBLEM)]


def _record(row: Row) -> FrameRecord:
    index, stamp, status, inliers, points, pose, covariance, unobserved, laps = row
    milliseconds = {str(stage): float(value) for stage, value in json.loads(laps).items()}
    if status not in STATUSES or not milliseconds.keys() >= set(STAGES):
        raise RowError(f"frame {index}: its status or its run times are unknown")
    matrices = array_of(pose, 4, 4), array_of(covariance, 6, 6)
    return FrameRecord(index, stamp, *matrices, status, inliers, points, milliseconds, array_of(unobserved, -1, 6))
