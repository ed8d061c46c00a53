"""Models of the built-in LiDARs: rotation, range and errors.

Where no other source is named, figures were measured on KITTI's raw drives 0005 and 0013.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from slam.data.sensor import Sensor, load_sensor

#: What the recording car's roof and rack hide of its HDL-64E: first and last ring, azimuth from and to [deg].
KITTI_CAR = (
    (44, 52, 157, 164),
    (44, 52, 197, 204),
    (52, 52, 169, 194),
    (53, 59, 156, 205),
    (60, 63, 151, 211),
    (48, 56, 281, 302),
    (57, 60, 279, 299),
    (61, 63, 279, 290),
    (56, 61, 127, 136),
    (62, 63, 127, 145),
    (56, 61, 227, 235),
    (62, 63, 218, 235),
    (57, 63, 344, 360),
    (57, 59, 0, 13),
    (60, 63, 0, 19),
    (61, 63, 27, 37),
    (60, 63, 322, 333),
)
PACE = 10.0  # turns a second for which `columns` are given


@dataclass(frozen=True)
class Head:
    """Model of a LiDAR.

    Attributes:
        columns: Pulses of each laser per revolution, at 10 Hz.
        nearest: Minimum reported range [m].
        farthest: Maximum reported range [m].
        asphalt: Distance [m] at which half of the pulses from a car's roof on the road are lost.
        encoder: Step of the reported angles [rad]; the pulses themselves are evenly spaced.
        laser_sigma: Standard deviation of the constant range error of a laser [m].
        pulse_sigma: Standard deviation of the range error of a pulse [m].
        together: All lasers fire at once, with the same number of columns at any rate; otherwise one after the other,
            in a cycle of constant duration.
        hidden: Parts of the field of view blocked by the car, rows as in KITTI_CAR.
    """

    columns: int
    nearest: float
    farthest: float
    asphalt: float
    encoder: float
    laser_sigma: float = 0.023
    pulse_sigma: float = 0.011
    together: bool = False
    hidden: tuple[tuple[int, int, int, int], ...] = ()


FINE = np.deg2rad(0.01)  # step of the angles that most makers report [rad]


def _ouster(nearest: float, farthest: float, asphalt: float) -> Head:
    return Head(1024, nearest, farthest, asphalt, 2 * np.pi / 90112, 0.008, 0.015, together=True)


OS0, OS1, OS2 = _ouster(0.3, 50.0, 18.0), _ouster(0.5, 120.0, 38.0), _ouster(0.8, 240.0, 75.0)
#: Columns, ranges and encoders as manuals and data sheets have them. Beyond the HDL-64E, the distance on asphalt and
#: the share of the range error that is a laser's own are plausible, not measured: in the order of the ranges to a dark
#: target (10 %), within the accuracy of 3 cm that all promise.
HEADS = {
    "hdl64": Head(2156, 0.9, 80.0, 58.0, np.deg2rad(0.09), hidden=KITTI_CAR),
    "vlp16": Head(1800, 0.5, 100.0, 40.0, FINE),  # user manual 63-9243
    "hdl32": Head(2170, 1.0, 100.0, 40.0, FINE),  # user manual 63-9113; a cycle takes 46.08 us
    "vlp32c": Head(1800, 1.0, 200.0, 60.0, FINE, 0.015, 0.012),  # user manual 63-9325
    "vls128": Head(1876, 0.5, 245.0, 75.0, FINE, 0.015, 0.012),  # a cycle takes 53.3 us
    "puck-hires": Head(1800, 0.5, 100.0, 40.0, FINE),
    **{f"os0-{rings}": OS0 for rings in (16, 32, 64, 128)},
    **{f"os1-{rings}": OS1 for rings in (16, 32, 64, 128)},
    **{f"os2-{rings}": OS2 for rings in (16, 32, 64, 128)},
    "pandar40p": Head(1800, 0.3, 200.0, 60.0, FINE, 0.015, 0.012),
    "pandar64": Head(1800, 0.3, 200.0, 60.0, FINE, 0.015, 0.012),
    "xt16": Head(2000, 0.3, 120.0, 45.0, FINE, 0.008, 0.008),
    "xt32": Head(2000, 0.3, 120.0, 45.0, FINE, 0.008, 0.008),
    "qt64": Head(600, 0.1, 60.0, 15.0, FINE, 0.015, 0.012),
    "rs-16": Head(1800, 0.4, 150.0, 45.0, FINE, 0.015, 0.012),
    "rs-32": Head(1800, 0.4, 200.0, 60.0, FINE, 0.015, 0.012),
    "rs-helios": Head(1800, 0.2, 150.0, 55.0, FINE, 0.015, 0.012),
    "rs-ruby": Head(1800, 0.4, 250.0, 80.0, FINE, 0.015, 0.012),
    "rs-bpearl": Head(1800, 0.1, 100.0, 30.0, FINE, 0.015, 0.012),
}


@dataclass(frozen=True, eq=False)
class Lidar:
    """A spinning LiDAR: its laser lines, its model, and its rotation rate [Hz]."""

    sensor: Sensor
    head: Head
    rate: float = PACE

    @staticmethod
    def of(name: str, rate: float = PACE) -> Lidar:
        """Create a LiDAR from HEADS."""
        return Lidar(load_sensor(name), HEADS[name], rate)

    @property
    def columns(self) -> int:
        """Pulses of each laser per revolution."""
        return self.head.columns if self.head.together else round(self.head.columns * PACE / self.rate)

    def unhidden(self) -> Lidar:
        """Return the LiDAR with an unblocked field of view, as if not mounted on KITTI's car."""
        return replace(self, head=replace(self.head, hidden=()))
