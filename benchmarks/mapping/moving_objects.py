"""Removal of moving objects from the map: share of traffic removed, share of the rest lost, time and memory.

    python -m benchmarks.mapping.moving_objects SEQUENCE [SEQUENCE ...]

writes moving_objects.md and .json in benchmarks/results. Simulated drives (`lidarlift simulate`) are mapped at their
true poses and held against the town without traffic; others at the poses of the odometry.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import open3d as o3d
from scipy.spatial import cKDTree

from benchmarks.common.page import surroundings, table, write_results
from benchmarks.common.script import add_results, parser, run_script
from eval.text import number
from slam.compilation import compile_kernels
from slam.config import load_config
from slam.data.cloud import Array
from slam.data.dataset import Dataset, open_dataset
from slam.data.errors import InputError
from slam.front_end import RingFrontEnd
from slam.mapping.global_map import GlobalMap
from slam.mapping.keyframes import Keyframes
from slam.mapping.picture import map_png
from slam.odometry import Odometry
from slam.settings import MapSettings
from slam.simulation.simulation import Simulation, SimulationConfig
from slam.source import sweep_duration

CHANNELS = ("64", "16")
HEIGHT = 1.73  # m of the LiDAR above the road, KITTI's and the simulated car's
BODY = (0.4, 1.5)  # m above the road, and
HALF_WIDTH = 0.8  # m: the space that the car itself drove through has no static objects
ROAD, BESIDE = 0.15, 3.0  # m: within this of the road's height, and this far from the path, there is road
MOVING, STILL = 0.3, 0.1  # m from static surfaces of the simulated town: farther than the first, nearer than the second

NOTES = """
* Keyframes every 2 m or 20 deg; a map with voxels of 0.2 m. Percentages are of the voxels of the map before the
  removal.
* moving: farther than 0.3 m from all static surfaces of the simulated town; still: nearer than 0.1 m.
* driven space: 0.4 to 1.5 m above the road and at most 0.8 m from the path of the LiDAR. The car itself drove there, so
  that everything in this space has moved. road: within 0.15 m of the road's height and 3 m of the path; it is static.
* If the odometry drifts, the map has the road twice, and the beams remove one of the two layers: on 0005 at 16 channels
  (a height error of 1 m over 72 m) all removed voxels of the road are above others that stay.
* gather: a scan into its keyframe; insert and carve: a keyframe into the map, and its beams through it. Medians, except
  for carve: the mean.
* picture: the whole map from above, as PNG.
"""


def main() -> None:
    arguments = parser(__doc__)
    arguments.add_argument("datasets", nargs="+", type=Path, metavar="SEQUENCE", help="folder of a drive")
    arguments.add_argument(
        "--pictures", type=Path, metavar="FOLDER", help="also draw each map, with moving objects and without"
    )
    add_results(arguments)
    options = arguments.parse_args()
    about = surroundings(("numpy", "numba"))
    maps = [mapped(path, channels, options.pictures) for path in options.datasets for channels in CHANNELS]
    write_results(options.results, "moving_objects", {"about": about, "maps": maps}, page)


def mapped(path: Path, channels: str, pictures: Path | None) -> dict[str, Any]:
    """The figures of one drive at 64 or 16 channels."""
    dataset, still = open_dataset(path), _distance_to_what_stands(path)
    print(f"{dataset.name}, {channels} channels", file=sys.stderr)
    keyframes, way, gather = _gathered(dataset, channels, true_poses=still is not None)
    world = GlobalMap(MapSettings())
    insert = [_milliseconds(partial(world.insert, keyframe.cloud, keyframe.pose)) for keyframe in keyframes]
    full = world.points()
    carve = _milliseconds(lambda: world.carve((keyframe.view, keyframe.pose) for keyframe in keyframes))
    points = world.points()
    removed = ~np.isin(_rows(full.xyz), _rows(points.xyz))
    body, road = _driven_space(full.xyz, way)
    name = f"{path.name}_{channels}"
    with tempfile.TemporaryDirectory() as folder:
        map_png(full, way, (pictures or Path(folder)) / f"{name}_all.png")
        drawn = _milliseconds(lambda: map_png(points, way, (pictures or Path(folder)) / f"{name}.png"))
    distance = None if still is None else still(full.xyz)
    return {
        "drive": path.name if still else dataset.name,
        "channels": channels,
        "poses": "true" if still else "odometry",
        "keyframes": len(keyframes),
        "keyframe_kb": keyframes.spill.in_memory / len(keyframes) / 1e3,
        "voxels": len(full),
        "removed": removed.mean(),
        "moving": None if distance is None else removed[distance > MOVING].mean(),
        "still": None if distance is None else removed[distance < STILL].mean(),
        "body": removed[body].mean() if body.any() else None,
        "road": removed[road].mean(),
        "gather_ms": float(np.median(gather)),
        "insert_ms": float(np.median(insert)),
        "carve_ms": carve / len(keyframes),
        "picture_s": drawn / 1e3,
    }


def _gathered(dataset: Dataset, channels: str, true_poses: bool) -> tuple[Keyframes, Array, list[float]]:
    """Keyframes of a drive, the positions (N, 3) of its frames, and milliseconds a scan."""
    config = load_config(input=channels)
    compile_kernels(config, lambda: None)
    front_end = RingFrontEnd(config.front_end, dataset.sensor)
    correction = dataset.sensor.vertical_correction if dataset.sensor else 0.0
    odometry = Odometry(config.odometry, sweep_duration=sweep_duration(dataset), vertical_correction=correction)
    keyframes, way, milliseconds = Keyframes(), [], []
    for position in range(len(dataset)):
        frame = dataset[position]
        cloud = front_end(frame, ())
        if true_poses:
            assert dataset.ground_truth is not None
            pose = dataset.ground_truth[position]
        else:
            step = odometry.register(cloud, frame.stamp)
            cloud, pose = step.cloud, step.pose
        way.append(pose[:3, 3])
        milliseconds.append(_milliseconds(partial(keyframes.add, cloud, pose, position, 0.0)))
    keyframes.finish()
    return keyframes, np.array(way), milliseconds


def _distance_to_what_stands(path: Path) -> Callable[[Array], Array] | None:
    """Metres from points (N, 3) of a simulated drive to the nearest thing that does not move; None for other drives."""
    about = path / "simulation.json"
    if not about.is_file():
        return None
    content = json.loads(about.read_text(encoding="utf-8")) | {"trajectory": None}
    content["spacing"] = content.pop("spacing_m")
    known = {field.name: content[field.name] for field in fields(SimulationConfig) if field.name in content}
    simulation = Simulation(SimulationConfig(**known))
    if not simulation.matches(path):
        raise InputError(f"{path}: simulated by another version; simulate it again with lidarlift simulate")
    town = simulation.rig.scene.around(simulation.drive.position[:, :2].mean(axis=0), 1000.0)
    centre, T = np.round(town.vertices.mean(axis=0)), simulation.rig.poses[0]
    scene = o3d.t.geometry.RaycastingScene()
    vertices = np.ascontiguousarray(town.vertices - centre, np.float32)
    triangles = np.ascontiguousarray(town.triangles, np.uint32)
    scene.add_triangles(o3d.core.Tensor.from_numpy(vertices), o3d.core.Tensor.from_numpy(triangles))

    def distance(xyz: Array) -> Array:
        places = (xyz @ T[:3, :3].T + T[:3, 3] - centre).astype(np.float32)
        return np.asarray(scene.compute_distance(o3d.core.Tensor.from_numpy(places)).numpy())

    return distance


def _driven_space(xyz: Array, way: Array) -> tuple[Array, Array]:
    """(N,) bool each: in the space that the car drove through; on the road next to its path."""
    finely = np.arange(0, len(way) - 1 + 1e-9, 0.1)
    line = np.column_stack([np.interp(finely, np.arange(len(way)), way[:, axis]) for axis in range(3)])
    beside, nearest = cKDTree(line[:, :2]).query(xyz[:, :2], distance_upper_bound=BESIDE)
    near = np.isfinite(beside)
    above = np.full(len(xyz), np.inf)
    above[near] = xyz[near, 2] - line[nearest[near], 2] + HEIGHT
    return (beside < HALF_WIDTH) & (above > BODY[0]) & (above < BODY[1]), near & (np.abs(above) < ROAD)


def _rows(xyz: Array) -> Array:
    """Points (N, 3) float32 as single values, to be compared whole."""
    return np.ascontiguousarray(xyz).view("V12").ravel()


def _milliseconds(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - begin)


def page(found: Mapping[str, Any]) -> str:
    about, results = found["about"], found["maps"]

    accuracy = table(
        ("sequence", "channels", "poses", "voxels", "removed %", "moving %", "still %", "driven space %", "road %"),
        (
            (row["drive"], row["channels"], row["poses"], str(row["voxels"]), number(row["removed"], 1, 100),
             number(row["moving"], 1, 100), number(row["still"], 3, 100), number(row["body"], 1, 100),
             number(row["road"], 3, 100))
            for row in results
        ),
        words=3,
    )  # fmt: skip
    cost = table(
        ("sequence", "channels", "keyframes", "KB a keyframe", "gather ms", "insert ms", "carve ms", "picture s"),
        (
            (row["drive"], row["channels"], str(row["keyframes"]), number(row["keyframe_kb"], 0),
             *(number(row[f"{stage}_ms"], 1) for stage in ("gather", "insert", "carve")), number(row["picture_s"], 1))
            for row in results
        ),
        words=2,
    )  # fmt: skip
    where = f"{about['date']}, {about['cpu']}, {about['cores']} cores, {about['memory_gib']} GiB"
    removed = "## Removed voxels by kind\n"
    return "\n".join(
        ["# Map", "", f"{where}.", "", f"```\n{about['command']}\n```", NOTES, removed, accuracy, "## Cost\n", cost]
    )


if __name__ == "__main__":
    run_script(main)
