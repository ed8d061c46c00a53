"""Flying pixels: predicted points that hang in the air, counted in the simulated town, whose surfaces are known."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import open3d as o3d

from benchmarks.common.simulated import scene
from enrichment.enricher import Enricher
from enrichment.geometry.held_out import past_of
from enrichment.geometry.sparse_scan import Method, select_rings
from slam.config import load_config
from slam.data.cloud import HISTORY, Array, Frame, History, PointCloud
from slam.data.sensor import load_sensor
from slam.front_end import RingFrontEnd
from slam.simulation.mesh import joined
from slam.simulation.rig import RADIUS, Rig
from slam.simulation.simulation import Simulation, SimulationConfig

TOWN, FRAMES = "loop", range(20, 640, 64)
COVERAGE = 0.8  # share of the trusted points, the surest: those of least sigma for their range
IN_THE_AIR = 0.5  # m from the next surface
MEASURED = "measured"


def flying_pixels(methods: Mapping[str, Method]) -> dict[str, dict[str, float | None]]:
    """Count flying pixels by method, over FRAMES, and for the measured points, some of which are mixed returns.

    Returns:
        Number of trusted points, share of flying pixels among them, and among those with the smallest sigma.
    """
    rig = Simulation(SimulationConfig(drive=TOWN)).rig
    distances: dict[tuple[str, float], list[Array]] = {}
    for frame, past in _frames():
        surfaces = _Surfaces(rig, frame.index)
        for name, method in methods.items():
            for coverage in (1.0, COVERAGE):
                cloud = _enriched(frame, past, method, coverage)
                distances.setdefault((name, coverage), []).append(surfaces.distance(cloud.xyz[~cloud.measured]))
        distances.setdefault((MEASURED, 1.0), []).append(surfaces.distance(cloud.xyz[cloud.measured]))
    found = {key: np.concatenate(parts) for key, parts in distances.items()}
    shares = {key: float(np.mean(distance > IN_THE_AIR)) for key, distance in found.items()}
    return {
        name: {
            "points": len(found[name, 1.0]),
            "in_the_air": shares[name, 1.0],
            "surest": shares.get((name, COVERAGE)),
        }
        for name in (MEASURED, *methods)
    }


def _frames() -> Iterator[tuple[Frame, History]]:
    """FRAMES of the drive, each with all rings of the scans before it."""
    data = scene(TOWN, camera=True, frames=[number - age for number in FRAMES for age in range(HISTORY, -1, -1)])
    for position in np.searchsorted(data.numbers, FRAMES):
        yield data[position], past_of(data, position)


def _enriched(frame: Frame, past: History, method: Method, coverage: float) -> PointCloud:
    sensor = load_sensor("hdl64")
    sparse = RingFrontEnd(load_config(input="16").front_end, sensor)
    lines, rings = sparse.lines()
    fill = Enricher(sparse, method, lines, rings, sensor, coverage)
    return fill(frame, [(select_rings(cloud, rings), T_now_then) for cloud, T_now_then in past])


class _Surfaces:
    """All that stands and moves around the car in a frame of the drive, in float32 around the sensor."""

    def __init__(self, rig: Rig, number: int) -> None:
        pose = rig.poses[number]
        mesh = joined([rig.scene.around(pose[:2, 3], RADIUS), *rig.scene.moving(number)])
        vertices = (mesh.vertices - pose[:3, 3]) @ pose[:3, :3]
        self._scene = o3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(vertices, np.float32)),
            o3d.core.Tensor.from_numpy(np.ascontiguousarray(mesh.triangles, np.uint32)),
        )

    def distance(self, xyz: Array) -> Array:
        """(N,) metres from points (N, 3) in the sensor's frame to the nearest surface."""
        return np.asarray(self._scene.compute_distance(o3d.core.Tensor.from_numpy(xyz), nthreads=1).numpy())
