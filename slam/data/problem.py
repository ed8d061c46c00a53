"""Faults in a user's data that do not end a run: they are reported and counted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """A fault in a user's data that does not end the run.

    Attributes:
        kind: For counting: 'truncated scan', 'missing image', ...
        message: One line for the reader: file, fault, remedy.
    """

    kind: str
    message: str


def spans(runs: Sequence[tuple[int, int]]) -> str:
    """Format runs of whole numbers, given by first and last: '3-5, 9'; at most eight are listed."""
    texts = [str(first) if first >= last else f"{first}-{last}" for first, last in runs]
    return ", ".join(texts[:8]) + (f" and {len(texts) - 8} more" if len(texts) > 8 else "")
