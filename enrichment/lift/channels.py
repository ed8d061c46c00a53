"""The layout of Lift's input: its channels, named once, at the places where the shipped weights have them.

Kernels have these numbers frozen into their compiled code, and numba's cache looks at the time stamp of kernels.py
alone: whoever moves a channel saves that file as well (tests/enrichment/lift/test_features.py fails on a stale cache)
and trains the network anew.
"""

from __future__ import annotations

from enum import IntEnum


class Ring(IntEnum):
    """Of each ring at each azimuth column."""

    KNOWN = 0  # 1 where there is a return; without one all channels but the gaps are 0
    RANGE = 1  # log(rho / 10 m)
    HEIGHT = 2  # z / 3 m
    GAP_ABOVE = 3  # m at 10 m, to the next ring
    GAP_BELOW = 4
    SEEN = 5  # 1 where the camera sees the return
    RED = 6  # -1..1
    GREEN = 7
    BLUE = 8


class Candidate(IntEnum):
    """Ranges that a ray may have, all on the ray: metres along rho, 0 where there is none.

    The edge and the guess need the image, the past needs scans before.
    """

    SEGMENT = 0  # where the ray meets the segment between the returns above and below
    ABOVE = 1  # as far as the return above
    BELOW = 2
    FROM_ABOVE = 3  # on the surface through the two returns above, extended
    FROM_BELOW = 4
    EDGE = 5  # between the returns by how the colours change on the way
    PAST = 6  # what scans before saw next to the ray
    GUESS = 7  # weighted median of returns of like colour, the edge and the completed depth image


class Ray(IntEnum):
    """Of each ray; all 0 where a return above or below is missing."""

    KNOWN = 0  # 1 where there are both returns
    SHARE = 1  # of the gap between the rings that lies above the ray
    RANGE = 2  # log(segment / 10 m)
    ABOVE = 3  # log(candidate / segment), as the four after it
    BELOW = 4
    FROM_ABOVE = 5
    FROM_BELOW = 6
    EDGE = 7
    LENGTH = 8  # of the segment, log(1 + m)
    SLOPE = 9  # rad
    TURN = 10  # rad, 1 at most
    BESIDE = 11  # how far returns beside lie off the segment, log(1 + m)
    SIGMA = 12  # ray-segment's own, log(1 + m)
    GAP = 13  # m at 10 m
    SEEN = 14  # 1 where the camera sees the ray's point on the segment and both returns
    CHANGE_ABOVE = 15  # of colours on the way from the return above to the ray's pixel
    CHANGE_BELOW = 16
    COLOUR_ABOVE = 17  # difference of colour from the return above
    COLOUR_BELOW = 18
    PAST = 19  # log(candidate / segment)
    PAST_NEAREST = 20
    PAST_FURTHEST = 21
    PAST_RETURNS = 22  # log(1 + number)
    GUESS = 23  # log(candidate / segment)
    GUESS_SPREAD = 24  # of what the guess is the median of, log(1 + m)


RINGS, RAYS, CANDIDATES = len(Ring), len(Ray), len(Candidate)  # how many channels there are
COLUMN_MULTIPLE = 8  # of which the number of columns is one: the network halves it three times
