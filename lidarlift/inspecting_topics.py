"""Inspection of a recording's topics."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from slam.data.dataset import Dataset

PAUSE = 3.0  # minimum length of a gap, in usual steps between messages, which networks deliver unevenly


@dataclass(frozen=True)
class TopicInfo:
    """A topic of a recording.

    Attributes:
        name: Name of the topic.
        type: Type of its messages, as ROS 2 writes it.
        messages: Number of messages.
        rate_hz: Messages per second.
        longest_gap_s: Longest time [s] between successive messages that is much longer than usual; 0 without one.
        use: How a run uses it; '' if it does not.
    """

    name: str
    type: str
    messages: int
    rate_hz: float
    longest_gap_s: float
    use: str


def topics_of(data: Dataset) -> tuple[TopicInfo, ...]:
    """Return the topics of a recording, and how a run uses each; nothing for another data set."""
    recording = getattr(data, "recording", None)
    if recording is None:
        return ()
    from slam.data.recordings.recording import USES

    uses = {topic: use.partition(" ")[0] for use, topic in getattr(data, "topics", {}).items()}
    return tuple(
        TopicInfo(
            name,
            topic.type,
            topic.count,
            topic.rate,
            topic.longest_step if topic.longest_step * topic.rate > PAUSE else 0.0,
            uses.get(name) or USES.get(topic.type, ""),
        )
        for name, topic in recording.topics.items()
    )
