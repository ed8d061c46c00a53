"""How the built-in LiDARs turn, how far they see and how wrong they are.

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
    """One model of LiDAR.

    columns      pulses of each laser in a turn, at ten turns a second
    nearest      and `farthest`: the ranges that it reports [m]
    asphalt      distance [m] at which half of the pulses are lost that graze a road from a car's roof
    encoder      step [rad] of the angles that it reports; the pulses themselves come evenly
    laser_sigma  metres: of a laser's constant range error
    pulse_sigma  metres: of the error of each pulse
    together     its lasers fire at once, in so many columns a turn at any rate; otherwise one after the other, in a
                 cycle that lasts as long at any rate
    hidden       of its view by its own car: rows as in KITTI_CAR
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


#: Columns, ranges and encoders as manuals and data sheets have them. Beyond the HDL-64E, the distance on asphalt and
#: the share of the range error that is a laser's own are plausible, not measured: in the order of the ranges to a dark
#: target (10 %), within the accuracy of 3 cm that all promise.
HEADS = {
    "hdl64": Head(2156, 0.9, 80.0, 58.0, np.deg2rad(0.09), hidden=KITTI_CAR),
    "vlp16": Head(1800, 0.5, 100.0, 40.0, np.deg2rad(0.01)),  # user manual 63-9243
    "hdl32": Head(2170, 1.0, 100.0, 40.0, np.deg2rad(0.01)),  # user manual 63-9113; a cycle takes 46.08 us
    "vlp32c": Head(1800, 1.0, 200.0, 60.0, np.deg2rad(0.01), 0.015, 0.012),  # user manual 63-9325
    "vls128": Head(1876, 0.5, 245.0, 75.0, np.deg2rad(0.01), 0.015, 0.012),  # a cycle takes 53.3 us
    "os1-64": Head(1024, 0.5, 120.0, 38.0, 2 * np.pi / 90112, 0.008, 0.015, together=True),
    "os1-128": Head(1024, 0.5, 120.0, 38.0, 2 * np.pi / 90112, 0.008, 0.015, together=True),
}


@dataclass(frozen=True, eq=False)
class Lidar:
    """A LiDAR that turns: the lines of its lasers, the rest of its model, and its turns a second."""

    sensor: Sensor
    head: Head
    rate: float = PACE

    @staticmethod
    def of(name: str, rate: float = PACE) -> Lidar:
        """One of HEADS."""
        return Lidar(load_sensor(name), HEADS[name], rate)

    @property
    def columns(self) -> int:
        """Pulses of each laser in a turn."""
        return self.head.columns if self.head.together else round(self.head.columns * PACE / self.rate)

    def unhidden(self) -> Lidar:
        """The same with a free view, away from KITTI's car."""
        return replace(self, head=replace(self.head, hidden=()))
