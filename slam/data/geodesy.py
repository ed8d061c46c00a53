"""Positions on the Earth in metres."""

from __future__ import annotations

import numpy as np

from slam.data.cloud import Array

#: Semi-major axis [m] and flattening of WGS 84.
SEMI_MAJOR, FLATTENING = 6378137.0, 1 / 298.257223563


def east_north_up(places: Array) -> Array:
    """Convert places to positions east, north and up of the first one.

    The conversion is that by Earth-centred coordinates: Hofmann-Wellenhof et al., "GNSS", 2008, section 8.2.

    Args:
        places: (N, 3) latitude and longitude [deg] and height above the ellipsoid [m], WGS 84.

    Returns:
        (N, 3) [m]; the first is zero.

    Example:
        >>> east_north_up(np.array([[49.0, 8.0, 100.0], [49.0, 8.0, 103.0], [49.0001, 8.0, 100.0]])).round(2) + 0.0
        array([[ 0.  ,  0.  ,  0.  ],
               [ 0.  ,  0.  ,  3.  ],
               [ 0.  , 11.12,  0.  ]])
    """
    latitude, longitude = np.deg2rad(places[:, :2]).T
    height, squared = places[:, 2], FLATTENING * (2 - FLATTENING)
    normal = SEMI_MAJOR / np.sqrt(1 - squared * np.sin(latitude) ** 2)
    centred = np.column_stack(
        [
            (normal + height) * np.cos(latitude) * np.cos(longitude),
            (normal + height) * np.cos(latitude) * np.sin(longitude),
            (normal * (1 - squared) + height) * np.sin(latitude),
        ]
    )
    sin, cos, s, c = np.sin(latitude[0]), np.cos(latitude[0]), np.sin(longitude[0]), np.cos(longitude[0])
    axes = np.array([[-s, c, 0], [-sin * c, -sin * s, cos], [cos * c, cos * s, sin]])
    return np.asarray((centred - centred[0]) @ axes.T)
