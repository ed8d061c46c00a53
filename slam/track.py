"""One hypothesis of where the sensor is, scan by scan: deskew, thin, predict, register, judge, remember."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np

from slam.cell_sizes import Sizes, sized
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.data.distortion import correct_vertical, deskew
from slam.registration.icp import IcpTarget
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.registration.voxels import VoxelFilter
from slam.settings import OdometrySettings

MIN_POINTS = 50  # a thinned scan with fewer is not registered: an empty or all but empty file
SHORTEST = 0.2  # sweeps between two stamps; less makes no sense
GAP = 5.0  # sweeps between two stamps; after more, the prediction is searched around
LONGEST = 5.0  # s that a velocity is believed to last
EVICT_EVERY = 5.0  # m of way between two clean-ups of the map
LOST_AFTER = 5  # so many failures in a row, and the map starts anew where the sensor is thought to be
SEARCH_STEP = 0.5  # m, below the reach of a coarse cell
SEARCH_TURNS = np.deg2rad([4, -4, 8, -8, 12, -12, 16, -16])  # about the vertical: a sharp corner in one frame
TRIED_MOVES, TRIED_TURNS = 12, 3  # of a search's starts, that are registered
HYPOTHESES = 5  # about the first motion
FASTEST = 45.0  # m/s, of a first motion: posts a few metres apart fit at any multiple of their distance
DISTINCT = 0.4  # of the finest cells: motions nearer to each other are one
USUAL_OVERLAP, OVERLAP_MEMORY = 0.8, 10  # share of the mean overlap of so many scans that none falls below in passing
ENDS = 2  # of a motion: the scan before was registered with an error as well
NOTHING = np.zeros((0, 3))  # that is not observed
FAILED_SIGMA = np.array([0.1, 0.1, 0.1, 2.0, 2.0, 2.0])  # rad, m: what a pose kept from the prediction is worth
STEADY = 10  # scans whose median velocity is kept: two steps of who carries the sensor, a second of a car
ACCELERATION = 1.0  # m/s^2, 1 sigma: what a velocity that is not observed may change by


class Target(Protocol):
    """What scans are registered against: NdtTarget or IcpTarget."""

    reach: float  # m: poses so near to each other are led to the same one

    def __len__(self) -> int: ...
    def clear(self) -> None: ...
    def insert(self, xyz: Array, weight: Array, pose: Array) -> None: ...
    def evict(self, centre: Array, radius: float) -> None: ...
    def scorer(self, xyz: Array, weight: Array, centre: Array) -> Callable[[Array], float]: ...
    def align(self, xyz: Array, weight: Array, guess: Array, locked: Array = ...) -> RegistrationResult: ...
    def unobserved(self, xyz: Array, weight: Array, pose: Array, before: Array) -> Array: ...


@dataclass(frozen=True, eq=False)
class OdometryStep:
    """What the odometry says of one scan.

    pose          (4, 4) T_world_lidar; the world is the first scan's frame
    covariance    (6, 6) of pose @ exp(xi), xi = (rotation, translation), given the scan before: of the motion
    status        'registered'; 'retried': only after a search around the prediction; 'degenerate': the scan does not
                  hold the pose along `unobserved`, there the prediction was kept; 'failed': the prediction was kept
    registration  of the scan against the map, or None (first scan, too few points)
    cloud         the scan as registered: deskewed, vertically corrected, in the sensor's frame
    unobserved    (K, 6) unit vectors (rotation, translation) in the sensor's axes; none but in a degenerate scan
    velocity      (6,) [rad/s, m/s] in the sensor's axes, on the way here; 0 where nothing is known as yet
    provisional   the drive has just begun, and the pose may still be put right
    revised       where that is over: the steps of the scans before, oldest first, as they are now known to be
    """

    pose: Array
    covariance: Array
    status: Literal["registered", "retried", "degenerate", "failed"]
    registration: RegistrationResult | None
    cloud: PointCloud
    unobserved: Array = field(default_factory=lambda: np.zeros((0, 6)))
    velocity: Array = field(default_factory=lambda: np.zeros(6))
    provisional: bool = False
    revised: tuple[OdometryStep, ...] = ()


class Track:
    """Registers scans one after the other against a local map (or the scan before), from constant velocity."""

    def __init__(
        self, settings: OdometrySettings, *, sweep_duration: float = 0.1, vertical_correction: float = 0.0
    ) -> None:
        self.settings = settings
        self.sweep_duration, self.vertical_correction = sweep_duration, vertical_correction  # s, rad
        self.sizes: Sizes | None = None  # with the first scan, as the target
        self.target: Target | None = None
        self._pose, self._stamp = np.eye(4), float("nan")  # of the last scan that was registered
        self._velocity = np.zeros(6)  # rad/s, m/s in the sensor's axes
        self._velocities: deque[Array] = deque(maxlen=STEADY)
        self._registered = self._failures = 0
        self._jumps = self._squared_jumps = self._overlap = 0.0
        self._unobserved, self._unobserved_for = np.zeros((0, 3)), 0.0  # in the map's axes; since so many seconds
        self._evicted_at = np.zeros(3)
        self._first: PointCloud | None = None  # the first scan as recorded, until the second tells how fast it was
        self.weighing, self.evidence = False, 0.0  # whether it competes with other hypotheses, and what speaks for it

    @property
    def scans(self) -> int:
        """How many were registered."""
        return self._registered

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Pose of the next scan: points as recorded, taken at `stamp` [s]."""
        prediction = self.predict(stamp)
        scan, map_points, points = self._prepared(cloud)
        if self.target is None or len(points[0]) < MIN_POINTS:
            step = self._kept(prediction, scan)
        elif len(self.target) == 0:
            step = OdometryStep(prediction, 1e-12 * np.eye(6), "registered", None, scan)
        else:
            step = self._registered_step(self.target, points, prediction, scan, stamp)
        self._first = cloud if self._registered == 0 and cloud.time is not None else None
        return self._taken(step, map_points, points, stamp)

    def branches(self, cloud: PointCloud, stamp: float) -> list[tuple[Track, OdometryStep]]:
        """The same for the second scan, by each motion that the search finds: a track each, best first, weighing."""
        scan, map_points, points = self._prepared(cloud)
        if self.target is None or len(points[0]) < MIN_POINTS:
            return []
        score = self.target.scorer(*points, self._pose)
        tried = self._tried(self.target, points, [self._pose], score)
        distinct = self._distinct(tried, score, stamp)
        if distinct and len(self.target.unobserved(*points, distinct[0].pose, NOTHING)) > 1:
            return []  # over a bare plane every motion fits
        branches = []
        for found in distinct[:HYPOTHESES]:
            track = copy.deepcopy(self)
            track.weighing = True
            if self._first is not None:
                found, scan, map_points, points = track._deskewed(self._first, cloud, found, stamp)
            step = OdometryStep(found.pose, ENDS * found.sandwich, "registered", found, scan)
            branches.append((track, track._taken(step, map_points, points, stamp)))
        return branches

    def _deskewed(
        self, first: PointCloud, second: PointCloud, found: RegistrationResult, stamp: float
    ) -> tuple[RegistrationResult, PointCloud, Points, Points]:
        """The second scan and its registration, once both scans are deskewed by the motion between them: how fast the
        sensor was at the first one, nobody knew."""
        assert self.target is not None
        self._velocity = se3.log(se3.normalized(se3.inverse(self._pose) @ found.pose)) / self._elapsed(stamp)
        self.target.clear()
        self.target.insert(*self._prepared(first)[1], self._pose)
        scan, map_points, points = self._prepared(second)
        return self.target.align(*points, found.pose), scan, map_points, points

    def _distinct(
        self, tried: list[RegistrationResult], score: Callable[[Array], float], stamp: float
    ) -> list[RegistrationResult]:
        """Those that are possible, of those that are near to each other the best, best first."""
        assert self.target is not None
        apart, farthest = DISTINCT * self.target.reach, FASTEST * self._elapsed(stamp)
        distinct: list[RegistrationResult] = []
        for found in sorted(tried, key=lambda result: score(result.pose), reverse=True):
            known = any(_moved(other.pose, found.pose) < apart for other in distinct)
            if not known and _moved(self._pose, found.pose) < farthest and self._sound(found, NOTHING):
                distinct.append(found)
        return distinct

    def _prepared(self, cloud: PointCloud) -> tuple[PointCloud, Points, Points]:
        """A scan as it is registered, its points for the map, and those that are held against it."""
        scan = deskew(cloud, self._velocity)
        scan = correct_vertical(scan, self.vertical_correction)
        if self.target is None and len(scan) >= MIN_POINTS:
            self._begin(scan)
        if self.target is None:
            return scan, NO_POINTS, NO_POINTS
        map_points = self._thin(scan.xyz, self._weights(scan))[:2]
        return scan, map_points, self._thin_more(*map_points)[:2]

    def _taken(self, step: OdometryStep, map_points: Points, points: Points, stamp: float) -> OdometryStep:
        """The step, once it is remembered."""
        if self.weighing and self.target is not None and step.status != "failed":
            self.evidence += self.target.scorer(*points, step.pose)(step.pose)
        if step.status != "failed":
            self._follow(step, stamp)
        if self.target is not None:
            self._remember(self.target, step, map_points)
        return replace(step, velocity=self._velocity)

    def predict(self, stamp: float) -> Array:
        """Pose (4, 4) at `stamp`, had the velocity stayed as it was at the last registered scan."""
        return self._pose @ se3.exp(self._velocity * min(self._elapsed(stamp), LONGEST))

    def _begin(self, scan: PointCloud) -> None:
        """Cells and thinning, from the first scan."""
        self.sizes = sizes = sized(self.settings, scan.xyz)
        self._thin = VoxelFilter(sizes.map_voxel_size, sizes.min_range, self.settings.max_range)
        self._thin_more = VoxelFilter(sizes.voxel_size)
        self.target = _target(self.settings, sizes.cell_sizes)

    def _weights(self, scan: PointCloud) -> Array:
        """(N,) float32: 1 for a point that is sure enough, less for one whose range is less certain."""
        full = np.float32(self.settings.full_weight_sigma)
        return np.asarray((full / np.maximum(scan.sigma, full)) ** 2)

    def _elapsed(self, stamp: float) -> float:
        """Seconds since the last registered scan; one sweep where the stamps make no sense."""
        elapsed = stamp - self._stamp
        return elapsed if elapsed >= SHORTEST * self.sweep_duration else self.sweep_duration

    def _registered_step(
        self, target: Target, points: Points, prediction: Array, scan: PointCloud, stamp: float
    ) -> OdometryStep:
        if self.weighing:  # a hypothesis is followed, not put right
            found = target.align(*points, prediction)
            led_away = _moved(prediction, found.pose) > DISTINCT * target.reach
            if led_away or not self._sound(found, NOTHING):
                return self._kept(prediction, scan, found)
            return OdometryStep(found.pose, ENDS * found.sandwich, "registered", found, scan)
        status: Literal["registered", "retried", "degenerate"] = "registered"
        gap = self._failures > 0 or self._elapsed(stamp) > GAP * self.sweep_duration
        if self._registered < 2 or gap:
            centres = self._centres(prediction)
            found = self._search(target, points, centres)
            prediction = min(centres, key=lambda centre: _moved(centre, found.pose))
        else:
            found = target.align(*points, prediction, _all_unobserved(self._unobserved))
        lost = target.unobserved(*points, found.pose, self._unobserved)
        if len(lost):
            steadied = prediction if gap else self._steadied(prediction, lost, stamp)
            found = target.align(*points, steadied, _all_unobserved(lost))
        elif self._registered > 1 and not gap and not self._expected(prediction, found):
            status, found = "retried", self._search(target, points, [prediction], found)
        if not self._sound(found, lost):
            return self._kept(prediction, scan, found)
        self._unobserved_for = self._unobserved_for + self._elapsed(stamp) if len(lost) else 0.0
        self._unobserved = lost
        if not len(lost):
            return OdometryStep(found.pose, ENDS * found.sandwich, status, found, scan)
        directions = _all_unobserved(lost @ found.pose[:3, :3])
        covariance = self._drifting(ENDS * found.sandwich, directions, stamp)
        return OdometryStep(found.pose, covariance, "degenerate", found, scan, directions)

    def _steadied(self, prediction: Array, lost: Array, stamp: float) -> Array:
        """The prediction with the median of the last velocities along the directions `lost` (K, 3), none if there are
        none: the last ones, from scans that hardly held them, are wrong, and that would add up from scan to scan."""
        steady = np.median([velocity[3:] for velocity in self._velocities] or [np.zeros(3)], axis=0)
        change = self._pose[:3, :3] @ (steady - self._velocity[3:]) * self._elapsed(stamp)
        steadied = prediction.copy()
        steadied[:3, 3] += lost.T @ (lost @ change)
        return steadied

    def _centres(self, prediction: Array) -> list[Array]:
        """What is searched around after a gap: the clock may have been stepped, or scans may be missing."""
        return [prediction, self.predict(self._stamp + self.sweep_duration), self._pose]

    def _search(
        self, target: Target, points: Points, centres: list[Array], *found: RegistrationResult
    ) -> RegistrationResult:
        """The best of registrations started all around `centres`, and of those `found` already."""
        score = target.scorer(*points, centres[0])
        return max((*found, *self._tried(target, points, centres, score)), key=lambda result: score(result.pose))

    def _tried(
        self, target: Target, points: Points, centres: list[Array], score: Callable[[Array], float]
    ) -> list[RegistrationResult]:
        """Registrations from `centres` and from the best poses all around them."""
        moves, arcs = [], []
        for centre in centres:
            for radius in np.arange(0.0, self.settings.search_radius + 1e-9, SEARCH_STEP):
                arcs += [centre @ se3.exp(np.array([0, 0, turn, radius, 0, 0])) for turn in SEARCH_TURNS]
                for heading in np.arange(8 if radius else 1) * np.pi / 4:
                    offset = np.eye(4)
                    offset[:2, 3] = radius * np.cos(heading), radius * np.sin(heading)
                    moves.append(centre @ offset)
        best = _apart(sorted(moves, key=score, reverse=True), target.reach)[:TRIED_MOVES]
        best += sorted(arcs, key=score, reverse=True)[:TRIED_TURNS]
        return [target.align(*points, pose) for pose in (*centres, *best)]

    def _expected(self, prediction: Array, found: RegistrationResult) -> bool:
        """It has settled near the prediction, and meets about as much of the map as scans did before: after an abrupt
        turn, a wrong pose still finds ground and walls that fit."""
        usual = found.converged and found.overlap >= USUAL_OVERLAP * self._overlap
        return usual and self._sound(found, NOTHING) and self._jump(prediction, found.pose) < self._gate()

    def _sound(self, found: RegistrationResult, lost: Array) -> bool:
        """Enough of the scan fits, and it fits along every direction that it should hold."""
        held = np.eye(3) - lost.T @ lost
        turn = found.pose[:3, :3]
        worst = float(np.linalg.eigvalsh(held @ turn @ found.covariance[3:, 3:] @ turn.T @ held)[-1])
        return found.inlier_ratio >= self.settings.min_inlier_ratio and worst < self.settings.max_position_sigma**2

    def _jump(self, prediction: Array, pose: Array) -> float:
        """How far the registration moved a point at the end of the range away from its prediction, at most [m]."""
        difference = se3.inverse(prediction) @ pose
        turn = 2 * self.settings.max_range * np.sin(float(se3.angle(difference)) / 2)
        return float(np.linalg.norm(difference[:3, 3])) + turn

    def _gate(self) -> float:
        """Three times the usual jump (the adaptive threshold of KISS-ICP, Vizzo et al. 2023, eq. 8)."""
        usual = np.sqrt(self._squared_jumps / self._jumps) if self._jumps else np.inf
        return max(3 * float(usual), self.settings.min_gate)

    def _drifting(self, covariance: Array, directions: Array, stamp: float) -> Array:
        """The covariance, along `directions` of what the prediction may be off by: its velocity changes at random."""
        held = np.eye(6) - directions.T @ directions
        elapsed = self._elapsed(stamp)
        variance = (ACCELERATION * elapsed) ** 2 * self._unobserved_for * elapsed
        return np.asarray(held @ covariance @ held + variance * directions.T @ directions)

    def _kept(self, prediction: Array, scan: PointCloud, found: RegistrationResult | None = None) -> OdometryStep:
        return OdometryStep(prediction, np.diag(FAILED_SIGMA**2), "failed", found, scan)

    def _follow(self, step: OdometryStep, stamp: float) -> None:
        """Velocity and usual jump after a registered scan, over the time since the last one."""
        if self._registered > 1:
            self._jumps += 1
            self._squared_jumps += self._jump(self.predict(stamp), step.pose) ** 2
        if step.registration:
            self._overlap += (step.registration.overlap - self._overlap) / min(self._registered, OVERLAP_MEMORY)
        motion = se3.log(se3.normalized(se3.inverse(self._pose) @ step.pose))
        if self._registered:
            self._velocity = motion / self._likely_elapsed(motion, stamp)
            self._velocities.append(self._velocity)
        self._pose, self._stamp = step.pose, stamp
        self._registered += 1

    def _likely_elapsed(self, motion: Array, stamp: float) -> float:
        """Seconds of a motion: those of the stamps, or one sweep where that is nearer to the velocity before. A clock
        that was stepped must not slow the car down."""
        choices = [self._elapsed(stamp)]
        if choices[0] > GAP * self.sweep_duration and self._registered > 1:
            choices.append(self.sweep_duration)
        return min(choices, key=lambda elapsed: float(np.linalg.norm((motion / elapsed - self._velocity)[3:])))

    def _remember(self, target: Target, step: OdometryStep, points: Points) -> None:
        """Put the scan into the map, or start a new one after too many failures; forget what lies behind."""
        self._failures = self._failures + 1 if step.status == "failed" else 0
        lost = self._failures >= LOST_AFTER and len(points[0]) >= MIN_POINTS
        if step.status == "failed" and not lost:
            return
        if lost or self.settings.target == "scan":
            target.clear()
            self._failures = 0
        target.insert(*points, step.pose)
        if np.linalg.norm(step.pose[:3, 3] - self._evicted_at) > EVICT_EVERY:
            self._evicted_at = step.pose[:3, 3].copy()
            target.evict(self._evicted_at, self.settings.map_radius)


Points = tuple[Array, Array]  # xyz (N, 3) and weights (N,), float32
NO_POINTS: Points = (np.zeros((0, 3), np.float32), np.zeros(0, np.float32))


def _moved(pose: Array, other: Array) -> float:
    """How far apart two poses are [m]."""
    return float(np.linalg.norm((other - pose)[:3, 3]))


def _apart(poses: list[Array], distance: float) -> list[Array]:
    """Those that are no nearer than `distance` to one before them."""
    kept: list[Array] = []
    for pose in poses:
        if all(_moved(other, pose) >= distance for other in kept):
            kept.append(pose)
    return kept


def _all_unobserved(positions: Array) -> Array:
    """(K, 6) unit vectors, in the axes of the directions (0 to 2, 3) of position that are not observed: these, and with
    two of them the turn about the third, for surfaces that all face one way do not tell it."""
    directions = np.pad(positions, ((0, 0), (3, 0)))
    if len(positions) < 2:
        return directions
    return np.concatenate([directions, np.pad(np.cross(*positions)[None], ((0, 0), (0, 3)))])


def _target(settings: OdometrySettings, cell_sizes: tuple[float, ...]) -> Target:
    if settings.registration != "ndt":
        return IcpTarget(settings.max_iterations)
    return NdtTarget(
        cell_sizes,
        min_points=settings.min_points,
        max_points=settings.max_points,
        floor=settings.floor,
        surfaces=settings.information == "surface",
        neighbours=settings.neighbours,
        kernel=settings.kernel,
        max_iterations=settings.max_iterations,
    )
