"""Topics of the benchmarks: the command of each, what it needs, how long it takes, and the pages and pictures it makes.

Arguments have the needed data in braces: {kitti_raw_0013} is the folder of that recording. A path with * stands for all
files that match.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field

#: Data that a topic may need, by name: what it is, and where it comes from.
DATA = {
    "kitti_odometry_04": "KITTI odometry 04, 51 frames with images",
    "kitti_raw_0005": "KITTI raw 2011_09_26 drive 0005",
    "kitti_raw_0013": "KITTI raw 2011_09_26 drive 0013",
    "kitti_00_keyframes": "keyframes of KITTI odometry 00, with poses",
    "nclt_20130110": "keyframes of NCLT 2013-01-10, with poses",
    "trajectories": "kitti_05_ground_truth.txt and others, the paths that towns are built along",
    "town_vlp16": "`lidarlift simulate town_vlp16 --drive loop --spacing 2.5 --sensor vlp16 --seed 1`",
    "posegraphs": "public pose graphs in g2o format",
    "ouster_captures": "packet captures of Ouster LiDARs with their metadata",
    "loop": "the simulated loop with a camera, simulated when it is missing",
    "lift_trainings": "networks of weights.train_lift: without-0005, without-0013, seed-1, seed-1-blind ..",
    "network_packs": "recordings as weights.train_networks has packed them",
    "before": "the command lidarlift of an earlier version: --before VENV/bin/lidarlift",
    "after": "the command lidarlift of this version",
    "work": "a folder for what a topic writes beside its page",
}
SIMULATED, GIVEN = "loop", ("before", "after", "work")  # made or known by the command itself
#: Packages that a topic imports and lidarlift does not need; the last three have files outside .venv.
PEERS = {
    "kiss_icp": "make peers",
    "small_gicp": "make peers",
    "genz_icp": "make peers",
    "torch": "pip install '.[train]'",
    "atheris": "pip install atheris",
    ".peers/kiss-slam/bin/python": "make peers",
    ".peers/ouster-sdk/bin/python": "make peers",
}
FAST_PEERS = ("kiss_icp", "small_gicp", "genz_icp")
KITTI = ("{kitti_odometry_04}", "{kitti_raw_0005}", "{kitti_raw_0013}")
HELD_OUT = ("--held-out", "0005={lift_trainings}/without-0005", "--held-out", "0013={lift_trainings}/without-0013")
SEEDS = tuple("{lift_trainings}/" + name for name in ("seed-1", "seed-2", "seed-3"))


@dataclass(frozen=True)
class Topic:
    """A benchmark or a generator of pages and pictures.

    Attributes:
        module: Module below `benchmarks` that is run; the last part is the topic's name.
        arguments: Its arguments, with names of DATA in braces.
        minutes: Rough time on two cores, without what is in the cache.
        peers: Names in PEERS that it needs.
        also: Names in DATA that it needs beside those in the arguments, in the same folder.
        pictures: Pictures that it writes beside its page, or anywhere in the repository.
        pages: Pages that it writes, as paths in the repository. Default: that of its name in benchmarks/results.
        results: Whether it takes --results.
    """

    module: str
    arguments: tuple[str, ...]
    minutes: int
    peers: tuple[str, ...] = ()
    also: tuple[str, ...] = ()
    pictures: tuple[str, ...] = ()
    pages: tuple[str, ...] | None = None
    results: bool = True
    name: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "name", self.module.rpartition(".")[2])

    @property
    def needs(self) -> tuple[str, ...]:
        """Names of DATA that it needs, each once."""
        return tuple(dict.fromkeys([*re.findall(r"\{(\w+)\}", " ".join(self.arguments)), *self.also]))

    @property
    def made(self) -> tuple[str, ...]:
        """Pages and pictures, as paths in the repository."""
        pages = (f"benchmarks/results/{self.name}.md",) if self.pages is None else self.pages
        return (*pages, *self.pictures)


def _picture(name: str) -> tuple[str]:
    return (f"benchmarks/results/{name}.png",)


SCENES = (
    *("crawl", "motorway", "bridge", "tunnel", "lorries", "lorries-vls128", "traffic", "loop", "building-vlp16"),
    *("building-os1-64", "straight-vlp16", "straight-vlp16-20hz", "straight-vlp32c", "straight-os1-128"),
)
OBSERVED = (
    *("tunnel", "bridge", "loop", "straight", "jam", "crawl", "motorway", "lorries", "traffic", "building-vlp16"),
    "straight-vlp16",
)
INPUTS = ("--inputs", "full", "16", "ray-segment", "lift")
DISTURBED = ("{kitti_odometry_04}", "{kitti_raw_0013}", "{kitti_raw_0005}", "crawl", "--parts", "clock", "stops")
CLOUDS = ("{kitti_00_keyframes}", "{nclt_20130110}")
TRAINED = (*HELD_OUT, "--image", *SEEDS, "--blind", *(f"{seed}-blind" for seed in SEEDS))
BOTH = ("{before}", "{after}")

#: In the order in which they are run: pictures and quick ones first.
TOPICS = (
    Topic("inputs.cases", (), 1, pages=("docs/inputs.md",), results=False),
    Topic("enriched.readme_picture", (), 2, pictures=("docs/enriched.png",), pages=(), results=False),
    Topic("enriched.report_picture", (), 4, pictures=("docs/report.jpg",), pages=(), results=False),
    Topic(
        "simulation.scenes_picture", ("docs/scenes.jpg",), 20, pictures=("docs/scenes.jpg",), pages=(), results=False
    ),
    Topic("sensors.rings", (), 3),
    Topic("sensors.table", (), 1, pages=("docs/sensors.md",), results=False),
    Topic("inputs.read_speed", (), 2),
    Topic("odometry.frame_rate", KITTI, 30, FAST_PEERS, pictures=_picture("frame_rate")),
    Topic("whole.stages", (*BOTH, "{kitti_raw_0013}", "{loop}"), 60),
    Topic(
        "whole.whole_run", (*BOTH, "{kitti_raw_0013}", "{loop}", "--kiss-slam", "{trajectories}"), 90,
        ("kiss_icp", ".peers/kiss-slam/bin/python"),
    ),
    Topic("whole.start_up", (*BOTH, "{kitti_raw_0013}"), 5),
    Topic("odometry.paper_chain", (*KITTI, "--town", "{loop}"), 20),
    Topic("odometry.disturbed", (*DISTURBED, "repeated"), 60),
    Topic("odometry.observability", OBSERVED, 60),
    Topic("odometry.starts", ("traffic", "motorway", "bridge", "lorries"), 20, ("kiss_icp",)),
    Topic(
        "odometry.turns", ("{kitti_raw_0013}", "{kitti_raw_0005}", "loop", "motorway", "building-vlp16"), 30,
        ("kiss_icp",),
    ),
    Topic("odometry.scenes", (*SCENES, *INPUTS), 600, FAST_PEERS),
    Topic(
        "sensors.sensors", ("--data", "{kitti_odometry_04}/.."), 30, also=("kitti_raw_0005", "kitti_raw_0013"),
    ),
    Topic("enriched.enriched_odometry", KITTI, 60),
    Topic("enriched.network_odometry", KITTI[:2], 30),
    Topic("enriched.lift_odometry", (*KITTI, *HELD_OUT), 90),
    Topic("depth.depth_methods", KITTI, 60),
    Topic("depth.lift_depth", (*KITTI, *TRAINED), 120),
    Topic("depth.lift_time", ("{kitti_raw_0005}", "--before", "{before}"), 15),
    Topic("depth.lift_adaptation", ("{work}/lift_adaptation",), 120, ("torch",)),
    Topic("weights.network_seeds", ("{network_packs}",), 600, ("torch",)),
    Topic("loops.simulated_loops", ("{trajectories}",), 90, pictures=_picture("simulated_loops")),
    Topic(
        "loops.recorded_loops", ("{kitti_00_keyframes}/..",), 20, also=("nclt_20130110",),
        pictures=_picture("recorded_loops"),
    ),
    Topic("loops.place_recognition", CLOUDS, 10, pictures=_picture("place_recognition")),
    Topic("loops.ring_keys", CLOUDS, 5),
    Topic("loops.loop_verification", CLOUDS, 40),
    Topic("loops.search_time", (*BOTH, *CLOUDS), 15),
    Topic("loops.back_end", ("{posegraphs}/..",), 60, also=("trajectories",)),
    Topic("loops.kiss_slam", ("{trajectories}",), 120, (".peers/kiss-slam/bin/python",)),
    Topic("mapping.replayed", (*BOTH, "{kitti_raw_0013}", "{loop}"), 30),
    Topic("loops.long_run", ("{loop}", "--frames", "20000"), 20, pictures=_picture("long_run")),
    Topic("loops.visits", ("{loop}", "--frames", "4000"), 10),
    Topic("faults.faults", ("{town_vlp16}",), 30),
    Topic("faults.session_cost", ("{town_vlp16}",), 3),
    Topic("mapping.moving_objects", ("{loop}", "{kitti_raw_0013}", "{kitti_raw_0005}"), 20),
    Topic("calibration.extrinsics", ("{loop}", "{kitti_raw_0005}", "{kitti_raw_0013}"), 10),
    Topic(
        "simulation.realism", ("{kitti_raw_0005}", "{kitti_raw_0013}", "{loop}"), 40, FAST_PEERS,
        pictures=_picture("realism"),
    ),
    Topic("simulation.simulator_speed", BOTH, 20),
    Topic("same_bytes", (*BOTH, "--sequence", "{kitti_odometry_04}", "--simulate", "100"), 20),
    Topic("recordings.long_recordings", ("--forms", "mcap"), 10),
    Topic("recordings.read_recordings", (), 5),
    Topic(
        "recordings.ouster_packets", (".peers/ouster-sdk/bin/python", "{ouster_captures}/*.pcap"), 5,
        (".peers/ouster-sdk/bin/python",),
    ),
    Topic("inputs.fuzz", ("pcd", "ply", "npy", "bin", "las", "laz", "yaml", "--minutes", "3"), 25, ("atheris",)),
)  # fmt: skip
