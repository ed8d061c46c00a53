"""The systems that are compared, behind one call: a scan and its stamp in, a pose out."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from benchmarks.odometry.names import GENZ, OURS
from slam.config import load_config
from slam.data.cloud import Array, PointCloud
from slam.data.dataset import Dataset
from slam.mid_sweep import MidSweepOdometry
from slam.odometry import Odometry, OdometryStep
from slam.settings import Config, OdometrySettings
from slam.source import sweep_duration


class System(Protocol):
    """An odometry with a constant-velocity prediction.

    `status` of the last scan and the earlier steps `revised` by it are as in `OdometryStep`; None and none for peers.
    """

    @property
    def status(self) -> str | None: ...
    @property
    def revised(self) -> tuple[OdometryStep, ...]: ...
    def register(self, cloud: PointCloud, stamp: float) -> Array: ...


class Ours:
    """lidarlift's odometry as `lidarlift run` sets it up."""

    def __init__(self, config: Config, dataset: Dataset) -> None:
        self._odometry = our_odometry(config.odometry, dataset)
        self.status: str | None = None
        self.revised: tuple[OdometryStep, ...] = ()

    def register(self, cloud: PointCloud, stamp: float) -> Array:
        step = self._odometry.register(cloud, stamp)
        self.status, self.revised = step.status, step.revised
        return step.pose


class Theirs:
    """One of peers.py, on one thread; `sweeps` from one scan to the next."""

    status = None
    revised = ()

    def __init__(self, name: str, dataset: Dataset, sweeps: int = 1) -> None:
        from benchmarks.odometry import peers  # here: the memory of ours is measured without them

        kinds: dict[str, Callable[..., peers.Peer]] = {
            "kiss-icp": peers.Kiss,
            "vgicp": peers.VoxelizedGicp,
            "gicp": peers.Gicp,
            "point-to-plane": peers.PointToPlane,
            **{each: partial(peers.GenZ, configuration=configuration) for each, configuration in GENZ.items()},
        }
        self._peer = kinds[name](vertical_correction(dataset), threads=1)
        self._peer.period = sweeps * sweep_duration(dataset)

    def register(self, cloud: PointCloud, stamp: float) -> Array:
        del stamp  # the peers take scans to be evenly spaced
        return self._peer.register(cloud)


def build(name: str, channels: str, dataset: Dataset, sweeps: int = 1) -> System:
    """A fresh system of that name for `channels` of the data set's sensor, which turns `sweeps` times a scan."""
    if name in OURS:
        return Ours(load_config(OURS[name], input=channels), dataset)
    return Theirs(name, dataset, sweeps)


def our_odometry(settings: OdometrySettings, dataset: Dataset) -> MidSweepOdometry:
    """As `lidarlift run` sets it up for the data set."""
    about = {"sweep_duration": sweep_duration(dataset), "vertical_correction": vertical_correction(dataset)}
    return MidSweepOdometry(Odometry(settings, **about))


def vertical_correction(dataset: Dataset) -> float:
    """Vertical correction of the data set's sensor [rad]."""
    return dataset.sensor.vertical_correction if dataset.sensor else 0.0
