"""What is wrong with a user's data but does not stop a run: reported, counted, gone around."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """`kind` is for counting ('truncated scan', 'missing image', ...), `message` for reading: file, fault, remedy."""

    kind: str
    message: str


def spans(runs: Sequence[tuple[int, int]]) -> str:
    """Runs of whole numbers, first and last, for reading: '3-5, 9', the first eight of them."""
    texts = [str(first) if first >= last else f"{first}-{last}" for first, last in runs]
    return ", ".join(texts[:8]) + (f" and {len(texts) - 8} more" if len(texts) > 8 else "")
