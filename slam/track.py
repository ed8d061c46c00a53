"""Scan-to-map odometry of one motion hypothesis: downsample, deskew, predict, register, validate, update the map."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from slam.cell_sizes import Sizes
from slam.consistency import LastScan, Sample
from slam.data import se3
from slam.data.cloud import Array, PointCloud
from slam.odometry_step import OdometryStep
from slam.pose_search import DISTINCT, registrations, search
from slam.preprocessing import MIN_POINTS, Prepared, Preprocessing
from slam.registration.icp import IcpTarget
from slam.registration.ndt import NdtTarget
from slam.registration.result import RegistrationResult
from slam.registration.target import Points, Target
from slam.settings import OdometrySettings

MIN_INTERVAL = 0.2  # sweeps between two stamps; a shorter interval is an error of the stamps
GAP = 5.0  # sweeps between two stamps, after which registration starts with a search around the prediction
MAX_PREDICTION_TIME = 5.0  # s of constant velocity
EVICTION_DISTANCE = 5.0  # m between two evictions of distant cells
MAX_FAILURES = 5  # in a row, after which the map is restarted at the predicted pose
CLEARLY_MORE = 1.1  # evidence to leave a sound registration: in the door to a room, few points decide the search
MAX_HYPOTHESES = 5  # of the first motion
FIRST_POINTS = 2_000  # of a scan, about, that follow the guesses of the first motion: with 1,000, more are wrong
MAX_INITIAL_SPEED = 45.0  # m/s, of the first motion: a row of posts fits at any multiple of their spacing
MIN_OVERLAP_RATIO, OVERLAP_WINDOW = 0.8, 10  # of a plausible registration, to the running mean; scans in the mean
MIN_INLIER_RATIO = 0.8  # of a registration, to the running mean: at another place walls and ground fit by half
MIN_YOUNG_RATIO = 0.7  # the same of the first scans
SURE_INLIER_RATIO = 0.9  # the same, above which the points that fit are evidence
MIN_UPRIGHT_RATIO = (
    0.75  # the same of points on upright surfaces: at right poses 0.85 to 1.1, at wrong ones 0.2 to 0.65
)
MAX_CONFLICTS = 0.02  # share of points in space that another scan looked through; sound: 0.000 to 0.015, by traffic
MAX_SURE_CONFLICTS = 0.05  # the same if the points fit, but fewer meet the map; sound: up to 0.021, on a motorway
RELATIVE_VARIANCE_FACTOR = 2  # both poses of a motion have a registration error
ALL_OBSERVED = np.zeros((0, 3))  # no unobservable directions
FAILED_SIGMA = np.array([0.1, 0.1, 0.1, 2.0, 2.0, 2.0])  # rad, m; of a predicted pose
VELOCITY_WINDOW = 10  # scans of the median velocity: two steps of a person with the sensor, one second of a car
VELOCITY_CHANGE_GAIN = 0.2  # of the newest change of the velocity in their running covariance
DISTORTION_POINTS = 4  # every 4th point is enough for the effect of a scan's distortion
ABRUPT_TURN = np.deg2rad(0.75)  # per sweep, between the motion by which a scan was deskewed and its own
MAX_DESKEWS = 3  # of such a scan; fewer when the motions agree to a quarter of an abrupt turn
ACCELERATION_SIGMA = 1.0  # m/s^2, of an unobservable velocity


class Track:
    """Registers successive scans against a local map, or the last scan, with a constant-velocity prediction.

    Args:
        settings: Settings of the odometry.
        sweep_duration: Duration of a sweep [s].
        vertical_correction: Angle [rad] added to each elevation.

    Attributes:
        target: The target of the registration, None before the first scan.
        competing: Whether this is one of several hypotheses of the first motion.
        evidence: Sum of the scores of the registered scans, while competing.
    """

    def __init__(
        self, settings: OdometrySettings, *, sweep_duration: float = 0.1, vertical_correction: float = 0.0
    ) -> None:
        self.settings = settings
        self.sweep_duration = sweep_duration
        self._preprocessing = Preprocessing(settings, vertical_correction)
        self.target: Target | None = None
        self._pose, self._stamp = np.eye(4), float("nan")  # of the last registered scan
        self._velocity = np.zeros(6)  # rad/s, m/s in the sensor's axes
        self._velocities: deque[Array] = deque(maxlen=VELOCITY_WINDOW)
        self._velocity_changes = np.zeros((6, 6))  # running mean of d d^T for the changes d from scan to scan
        self._registered = self._failures = 0
        self._deviations = self._squared_deviations = self._mean_overlap = 0.0
        self._mean_inliers = self._mean_upright_inliers = 0.0
        self._unobserved, self._unobserved_for = np.zeros((0, 3)), 0.0  # in the map's axes; s
        self._last_eviction = np.zeros(3)
        self._last = LastScan()
        self._first: PointCloud | None = None  # as recorded; deskewed again with the motion to the second scan
        self.competing, self.evidence = False, 0.0

    @property
    def sizes(self) -> Sizes | None:
        """Cell and voxel sizes; None before the first scan."""
        return self._preprocessing.sizes

    @property
    def scans(self) -> int:
        """Number of registered scans."""
        return self._registered

    def register(self, cloud: PointCloud, stamp: float) -> OdometryStep:
        """Register the next scan.

        Args:
            cloud: Points as recorded.
            stamp: Time of the scan [s].
        """
        prediction = self.predict(stamp)
        prepared = self._prepared(cloud)
        if self.target is None or len(prepared.points[0]) < MIN_POINTS:
            step = self._prediction_step(prediction, prepared)
        elif len(self.target) == 0:
            step = OdometryStep(prediction, 1e-12 * np.eye(6), "registered", None, *prepared.scan)
        else:
            step, prepared = self._registration_step(self.target, prepared, prediction, stamp)
        self._first = cloud if self._registered == 0 and cloud.time is not None else None
        return self._update(step, prepared, stamp)

    def hypotheses(self, cloud: PointCloud, stamp: float) -> list[tuple[Track, OdometryStep]]:
        """Register the second scan, and return a track and its step for each motion found by the search, best first."""
        prepared = self._prepared(cloud)
        points = prepared.points
        if self.target is None or len(points[0]) < MIN_POINTS:
            return []
        every = max(1, len(points[0]) // FIRST_POINTS)
        candidates = registrations(self.target, points, [self._pose], self.settings.search_radius, every)
        score = self.target.scorer(*points, self._pose)
        distinct = self._distinct_motions(candidates, prepared.sample, score, stamp)
        if distinct and len(self.target.unobserved(*points, distinct[0].pose, ALL_OBSERVED)) > 1:
            return []  # over a bare plane, every motion fits
        hypotheses = []
        for found in distinct[:MAX_HYPOTHESES]:
            track = copy.deepcopy(self)
            track.competing = True
            if self._first is not None:
                found, prepared = track._deskew_again(self._first, cloud, found, stamp)
            covariance = RELATIVE_VARIANCE_FACTOR * found.sandwich
            step = OdometryStep(found.pose, covariance, "registered", found, *prepared.scan)
            hypotheses.append((track, track._update(step, prepared, stamp)))
        return hypotheses

    def _deskew_again(
        self, first: PointCloud, second: PointCloud, found: RegistrationResult, stamp: float
    ) -> tuple[RegistrationResult, Prepared]:
        """Deskew the first two scans again by the motion between them, and register the second one again.

        The velocity was unknown at the first scan.
        """
        assert self.target is not None
        self._velocity = self._velocity_to(found.pose, stamp)
        self.target.clear()
        self.target.insert(*self._prepared(first).map_points, self._pose)
        prepared = self._prepared(second)
        return self.target.align(*prepared.points, found.pose), prepared

    def _deskew_by_motion(
        self, target: Target, prepared: Prepared, found: RegistrationResult, stamp: float
    ) -> tuple[RegistrationResult, Prepared]:
        """If a scan turned abruptly, deskew it by its own motion and register it again, until both agree."""
        limit = ABRUPT_TURN
        for _ in range(MAX_DESKEWS):
            cloud, correction = prepared.scan
            velocity = self._velocity_to(found.pose, stamp)
            change = np.linalg.norm(velocity[:3] - correction.velocity[:3]) * self.sweep_duration
            if prepared.time is None or change <= limit:
                break
            prepared, limit = self._preprocessing(cloud, velocity), ABRUPT_TURN / 4
            found = target.align(*prepared.points, found.pose)
        return found, prepared

    def _distinct_motions(
        self, candidates: list[RegistrationResult], some: Sample, score: Callable[[Array], float], stamp: float
    ) -> list[RegistrationResult]:
        """The valid registrations of possible motions, best first, without near duplicates; none of a damaged scan.

        One of them must agree with the first scan, not each: in traffic, vehicles that keep their distance agree with
        standing still, and contradict the true motion.
        """
        assert self.target is not None
        min_distance, max_distance = DISTINCT * self.target.convergence_radius, MAX_INITIAL_SPEED * self._elapsed(stamp)
        distinct: list[RegistrationResult] = []
        for found in sorted(candidates, key=lambda result: score(result.pose), reverse=True):
            duplicate = any(_distance(other.pose, found.pose) < min_distance for other in distinct)
            possible = _distance(self._pose, found.pose) < max_distance
            if possible and not duplicate and self._is_valid(found, ALL_OBSERVED):
                distinct.append(found)
        return distinct if any(self._agrees(some, found, stamp) for found in distinct) else []

    def _prepared(self, cloud: PointCloud) -> Prepared:
        """A scan deskewed by the last velocity. The target is created with the first one."""
        prepared = self._preprocessing(cloud, self._velocity)
        if self.target is None and self.sizes:
            self.target = _target(self.settings, self.sizes.cell_sizes)
        return prepared

    def _update(self, step: OdometryStep, prepared: Prepared, stamp: float) -> OdometryStep:
        """Update evidence, motion and map with a step; return the step with its velocity."""
        if self.competing and self.target is not None and step.status != "failed":
            self.evidence += self.target.scorer(*prepared.points, step.pose)(step.pose)
        if step.status != "failed":
            self._update_motion(step, stamp)
        restarted = self.target is not None and self._update_map(self.target, step, prepared.map_points)
        if step.status != "failed" or restarted:
            self._last.keep(prepared.sample, step.pose)
        return replace(step, velocity=self._velocity, restarted=restarted and self.settings.target == "map")

    def predict(self, stamp: float) -> Array:
        """Return the pose (4, 4) at `stamp` for a constant velocity since the last registered scan."""
        return self._pose @ se3.exp(self._velocity * min(self._elapsed(stamp), MAX_PREDICTION_TIME))

    def _elapsed(self, stamp: float) -> float:
        """Time [s] since the last registered scan; one sweep if the stamps do not rise."""
        elapsed = stamp - self._stamp
        return elapsed if elapsed >= MIN_INTERVAL * self.sweep_duration else self.sweep_duration

    def _registration_step(
        self, target: Target, prepared: Prepared, prediction: Array, stamp: float
    ) -> tuple[OdometryStep, Prepared]:
        """Register a scan, with a search after a gap or an implausible registration, and validate the result.

        Returns:
            The step, and the scan: deskewed again if it turned abruptly.
        """
        if self.competing:
            return self._competing_step(target, prepared, prediction, stamp), prepared
        status: Literal["registered", "retried", "degenerate"] = "registered"
        recorded, points = prepared, prepared.points
        gap = self._failures > 0 or self._elapsed(stamp) > GAP * self.sweep_duration
        if self._registered < 2 or gap:
            one_sweep_on = self.predict(self._stamp + self.sweep_duration)
            centres = [prediction, one_sweep_on, self._pose]  # the clock may have been stepped, or scans be missing
            found = search(target, points, centres, self.settings.search_radius)
            prediction = min(centres, key=lambda centre: _distance(centre, found.pose))
        else:
            locked = _unobserved_twists(self._unobserved)
            found = target.align(*points, prediction, locked)
            if not found.converged:  # as after an abrupt turn: more iterations are a fraction of a search
                found = target.align(*points, found.pose, locked)
        lost = target.unobserved(*points, found.pose, self._unobserved)
        if len(lost):
            steady_pose = prediction if gap else self._steady_prediction(prediction, lost, stamp)
            found = target.align(*points, steady_pose, _unobserved_twists(lost))
        else:
            found, prepared = self._deskew_by_motion(target, prepared, found, stamp)
            if self._registered > 1 and not gap and not self._is_plausible(target, prediction, found):
                sound = found.converged and self._is_valid(found, ALL_OBSERVED)
                needed = CLEARLY_MORE if sound else 1.0
                found = search(target, prepared.points, [prediction], self.settings.search_radius, found, needed)
                found, prepared = self._deskew_by_motion(target, prepared, found, stamp)
                status = "retried"
        if not self._is_valid(found, lost) or not self._agrees(prepared.sample, found, stamp):
            return self._prediction_step(prediction, recorded, found), recorded
        self._unobserved_for = self._unobserved_for + self._elapsed(stamp) if len(lost) else 0.0
        self._unobserved = lost
        covariance = self._motion_covariance(target, prepared, found)
        if not len(lost):
            return OdometryStep(found.pose, covariance, status, found, *prepared.scan), prepared
        directions = _unobserved_twists(lost @ found.pose[:3, :3])
        covariance = self._drift_covariance(covariance, directions, stamp)
        return OdometryStep(found.pose, covariance, "degenerate", found, *prepared.scan, directions), prepared

    def _competing_step(self, target: Target, prepared: Prepared, prediction: Array, stamp: float) -> OdometryStep:
        """Register a scan without a search: a competing hypothesis keeps to its own motion."""
        found = target.align(*prepared.points, prediction)
        diverged = _distance(prediction, found.pose) > DISTINCT * target.convergence_radius
        if diverged or not self._is_valid(found, ALL_OBSERVED) or not self._agrees(prepared.sample, found, stamp):
            return self._prediction_step(prediction, prepared, found)
        return OdometryStep(
            found.pose, self._motion_covariance(target, prepared, found), "registered", found, *prepared.scan
        )

    def _steady_prediction(self, prediction: Array, lost: Array, stamp: float) -> Array:
        """The prediction (4, 4) with the median of the last velocities along the unobservable directions `lost` (K, 3).

        The last velocities come from scans that hardly constrained these directions, and their error would accumulate
        from scan to scan. Without earlier velocities, the velocity along these directions is 0.
        """
        steady = np.median([velocity[3:] for velocity in self._velocities] or [np.zeros(3)], axis=0)
        change = self._pose[:3, :3] @ (steady - self._velocity[3:]) * self._elapsed(stamp)
        steady_pose = prediction.copy()
        steady_pose[:3, 3] += lost.T @ (lost @ change)
        return steady_pose

    def _is_plausible(self, target: Target, prediction: Array, found: RegistrationResult) -> bool:
        """Whether a registration converged near the prediction, with about the overlap of the last scans, and fits.

        After an abrupt turn, the ground fits at a wrong yaw too, but the walls do not; where they do, a pose at the
        predicted place may be turned by any angle.
        """
        if (
            not found.converged
            or found.overlap < MIN_OVERLAP_RATIO * self._mean_overlap
            or not self._upright_fit(found)
        ):
            return False
        close = self._deviation(prediction, found.pose) < self._max_deviation()
        turned = _distance(prediction, found.pose) < DISTINCT * target.convergence_radius
        return (close or turned) and self._is_valid(found, ALL_OBSERVED)

    def _upright_fit(self, found: RegistrationResult) -> bool:
        """Whether about as many points on upright surfaces fit as in the last scans."""
        return found.upright_inlier_ratio >= MIN_UPRIGHT_RATIO * self._mean_upright_inliers

    def _agrees(self, some: Sample, found: RegistrationResult, stamp: float) -> bool:
        """Whether a scan can show the scene of the last ones: not so if it is damaged, or the sensor was carried.

        About as many points must fit as in the last scans. If somewhat fewer fit or meet the map, the last scan itself
        must agree, unless the one before this failed: traffic may be dense.
        """
        young = self._registered < OVERLAP_WINDOW
        if young and self.settings.target == "scan":
            return True  # against a single scan the share of points that fit varies
        fit = found.inlier_ratio / (self._mean_inliers or 1.0)
        if fit < (MIN_YOUNG_RATIO if young else MIN_INLIER_RATIO):
            return False
        if self._elapsed(stamp) > GAP * self.sweep_duration:
            return True
        if not self._last.resembles(some):
            return False
        few_fit = fit < SURE_INLIER_RATIO or not self._upright_fit(found) or self._registered < 2
        few_meet = found.overlap < MIN_OVERLAP_RATIO * self._mean_overlap
        if self._failures or not (few_fit or few_meet):
            return True
        return self._last.conflicts(some, found.pose) <= (MAX_CONFLICTS if few_fit else MAX_SURE_CONFLICTS)

    def _is_valid(self, found: RegistrationResult, lost: Array) -> bool:
        """Whether inlier ratio and covariance are within limits, except along the unobservable directions `lost`."""
        P, R = np.eye(3) - lost.T @ lost, found.pose[:3, :3]  # P projects onto the observable directions
        variance = float(np.linalg.eigvalsh(P @ R @ found.covariance[3:, 3:] @ R.T @ P)[-1])
        return found.inlier_ratio >= self.settings.min_inlier_ratio and variance < self.settings.max_position_sigma**2

    def _deviation(self, prediction: Array, pose: Array) -> float:
        """Maximum displacement [m] of a point at the maximum range, from the predicted to the registered pose."""
        difference = se3.inverse(prediction) @ pose
        turn = 2 * self.settings.max_range * np.sin(float(se3.angle(difference)) / 2)
        return float(np.linalg.norm(difference[:3, 3])) + turn

    def _max_deviation(self) -> float:
        """Three times the RMS deviation (the adaptive threshold of KISS-ICP, Vizzo et al. 2023, eq. 8)."""
        rms = np.sqrt(self._squared_deviations / self._deviations) if self._deviations else np.inf
        return max(3 * float(rms), self.settings.min_gate)

    def _motion_covariance(self, target: Target, prepared: Prepared, found: RegistrationResult) -> Array:
        """Covariance (6, 6) of the motion since the last scan: of the points, and of changes of the velocity.

        A scan is deskewed with the velocity before it, and its points are displaced by the change of the velocity.
        """
        covariance = found.sandwich
        if prepared.time is not None:
            some = slice(None, None, DISTORTION_POINTS)
            xyz, weight = prepared.points
            xyz = np.ascontiguousarray(xyz[some])  # for an array with strides, the kernels would be compiled once more
            response = target.distortion_response(xyz, DISTORTION_POINTS * weight[some], prepared.time[some], found)
            covariance = covariance + response @ self._velocity_changes @ response.T
        return RELATIVE_VARIANCE_FACTOR * covariance

    def _drift_covariance(self, covariance: Array, directions: Array, stamp: float) -> Array:
        """The covariance with that of the prediction along `directions`, for a random walk of the velocity."""
        P = np.eye(6) - directions.T @ directions  # projects onto the observable directions
        elapsed = self._elapsed(stamp)
        variance = (ACCELERATION_SIGMA * elapsed) ** 2 * self._unobserved_for * elapsed
        return np.asarray(P @ covariance @ P + variance * directions.T @ directions)

    def _prediction_step(
        self, prediction: Array, prepared: Prepared, found: RegistrationResult | None = None
    ) -> OdometryStep:
        """A failed step, which keeps the prediction."""
        return OdometryStep(prediction, np.diag(FAILED_SIGMA**2), "failed", found, *prepared.scan)

    def _update_motion(self, step: OdometryStep, stamp: float) -> None:
        """Update velocity, deviation and mean overlap with a registered scan."""
        if self._registered > 1:
            self._deviations += 1
            self._squared_deviations += self._deviation(self.predict(stamp), step.pose) ** 2
        if step.registration:
            scans = min(self._registered, OVERLAP_WINDOW)
            found = step.registration
            self._mean_overlap += (found.overlap - self._mean_overlap) / scans
            self._mean_inliers += (found.inlier_ratio - self._mean_inliers) / scans
            self._mean_upright_inliers += (found.upright_inlier_ratio - self._mean_upright_inliers) / scans
        if self._registered:
            velocity = self._velocity_to(step.pose, stamp)
            if self._registered > 1:
                change = velocity - self._velocity
                gain = max(VELOCITY_CHANGE_GAIN, 1 / (self._registered - 1))
                self._velocity_changes += gain * (np.outer(change, change) - self._velocity_changes)
            self._velocity = velocity
            self._velocities.append(self._velocity)
        self._pose, self._stamp = step.pose, stamp
        self._registered += 1

    def _velocity_to(self, pose: Array, stamp: float) -> Array:
        """Velocity (6,) of the motion since the last registered scan to a pose (4, 4).

        The motion took the time between the stamps, or one sweep if that agrees better with the last velocity: a clock
        that was stepped must not reduce the velocity.
        """
        motion = se3.log(se3.normalized(se3.inverse(self._pose) @ pose))
        durations = [self._elapsed(stamp)]
        if durations[0] > GAP * self.sweep_duration and self._registered > 1:
            durations.append(self.sweep_duration)
        velocities = (motion / duration for duration in durations)
        return min(velocities, key=lambda velocity: float(np.linalg.norm((velocity - self._velocity)[3:])))

    def _update_map(self, target: Target, step: OdometryStep, points: Points) -> bool:
        """Insert the scan into the map, evict distant cells, and restart the map after too many failures.

        Returns:
            Whether it was restarted.
        """
        self._failures = self._failures + 1 if step.status == "failed" else 0
        restart = self._failures >= MAX_FAILURES and len(points[0]) >= MIN_POINTS
        if step.status == "failed" and not restart:
            return False
        if restart or self.settings.target == "scan":
            target.clear()
            self._failures = 0
        target.insert(*points, step.pose)
        if np.linalg.norm(step.pose[:3, 3] - self._last_eviction) > EVICTION_DISTANCE:
            self._last_eviction = step.pose[:3, 3].copy()
            target.evict(self._last_eviction, self.settings.map_radius)
        return restart


def _distance(pose: Array, other: Array) -> float:
    """Distance [m] between the positions of two poses."""
    return float(np.linalg.norm((other - pose)[:3, 3]))


def _unobserved_twists(positions: Array) -> Array:
    """Unobservable directions (K, 6) of the pose, given those (0 to 2, 3) of the position, in the same axes.

    With two unobservable directions of the position, all surfaces face the third one, and the rotation about it is
    unobservable too.
    """
    directions = np.pad(positions, ((0, 0), (3, 0)))
    if len(positions) < 2:
        return directions
    return np.concatenate([directions, np.pad(np.cross(*positions)[None], ((0, 0), (0, 3)))])


def _target(settings: OdometrySettings, cell_sizes: tuple[float, ...]) -> Target:
    """The target of the chosen registration method."""
    if settings.registration != "ndt":
        return IcpTarget(settings.max_iterations)
    return NdtTarget(
        cell_sizes,
        min_points=settings.min_points,
        max_points=settings.max_points,
        regularisation=settings.regularisation,
        surfaces=settings.information_matrix == "surface",
        neighbours=settings.neighbours,
        kernel_scale=settings.kernel_scale,
        max_iterations=settings.max_iterations,
    )
