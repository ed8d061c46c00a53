"""Channels of Lift's input, in the order of the shipped weights.

Kernels have these numbers frozen into their compiled code, and numba's cache checks the time stamp of kernels.py only:
after moving a channel, save that file too (tests/enrichment/lift/test_features.py fails on a stale cache) and retrain
the network.
"""

from __future__ import annotations

from enum import IntEnum


class Ring(IntEnum):
    """Channels of each ring and azimuth column."""

    KNOWN = 0  # 1 with a return; without one all channels but the gaps are 0
    RANGE = 1  # log(rho / 10 m)
    HEIGHT = 2  # z / 3 m
    GAP_ABOVE = 3  # m at 10 m, to the next ring
    GAP_BELOW = 4
    SEEN = 5  # 1 if the camera sees the return
    RED = 6  # -1..1
    GREEN = 7
    BLUE = 8


class Candidate(IntEnum):
    """Candidate ranges of a ray: metres along rho, 0 for none.

    EDGE and GUESS need the image, PAST needs earlier scans.
    """

    SEGMENT = 0  # intersection with the segment between the returns above and below
    ABOVE = 1  # rho of the return above
    BELOW = 2
    FROM_ABOVE = 3  # extrapolation of the surface through the two returns above
    FROM_BELOW = 4
    EDGE = 5  # between the returns, by the colour change along the line between them
    PAST = 6  # return of an earlier scan next to the ray
    GUESS = 7  # weighted median of returns with similar colour, EDGE and the completed depth image


class Ray(IntEnum):
    """Channels of each ray; all 0 if a return above or below is missing."""

    KNOWN = 0  # 1 with both returns
    SHARE = 1  # share of the gap between the rings that is above the ray
    RANGE = 2  # log(segment / 10 m)
    ABOVE = 3  # log(candidate / segment), like the next four
    BELOW = 4
    FROM_ABOVE = 5
    FROM_BELOW = 6
    EDGE = 7
    LENGTH = 8  # of the segment, log(1 + m)
    SLOPE = 9  # rad
    TURN = 10  # rad, 1 at most
    OUTLIER_DISTANCE = 11  # distance of neighbouring returns from the segment's range interval, log(1 + m)
    SIGMA = 12  # sigma of ray-segment, log(1 + m)
    GAP = 13  # m at 10 m
    SEEN = 14  # 1 if the camera sees the ray's point on the segment and both returns
    CHANGE_ABOVE = 15  # colour change along the line from the return above to the ray's pixel
    CHANGE_BELOW = 16
    COLOUR_ABOVE = 17  # colour difference to the return above
    COLOUR_BELOW = 18
    PAST = 19  # log(candidate / segment)
    PAST_NEAREST = 20
    PAST_FURTHEST = 21
    PAST_RETURNS = 22  # log(1 + number)
    GUESS = 23  # log(candidate / segment)
    GUESS_SPREAD = 24  # mean distance from the median GUESS, log(1 + m)


RINGS, RAYS, CANDIDATES = len(Ring), len(Ray), len(Candidate)  # numbers of channels
COLUMN_MULTIPLE = 8  # the number of columns must be a multiple: the network halves it three times
