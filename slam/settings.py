"""Typed settings, with a reason for each default."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator


class Settings(BaseModel):
    """Base of all sections: unknown keys are errors, values cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class FrontEndSettings(Settings):
    """Conversion of the recorded scan into the cloud that is registered."""

    # full: as recorded, and so is 64; 16 or another number: so many of its rings; enriched: 16 enriched to about 64
    input: str = "64"
    enriched_rings: int | None = Field(None, ge=2)  # that input enriched keeps; None: 16 of 64, else all
    # of its rings; every-4th as in papers, vlp16: those nearest to a VLP-16's, average-pool: as in the paper
    ring_selection: Literal["every-4th", "vlp16", "average-pool"] = "every-4th"
    phase: int = Field(0, ge=0, le=3)  # of every-4th: index of the first ring that is kept
    # a name in enrichment.methods.registry, checked when the method is created. ray-segment: no learning, some
    # milliseconds per frame; lift: our network, a tenth of a second; joint: ray-segment guided by the image, a tenth of
    # a second; l2l, li2l, f2l: the paper's networks, a second or more
    enricher: str = "ray-segment"
    coverage: float = Field(1.0, gt=0, le=1)  # share of the predicted points that is kept, smallest sigma first
    deskew: bool | None = None  # None: if the scans have times and are not motion-compensated
    vertical_correction_deg: float | None = None  # None: that of the sensor (KITTI: 0.205)

    @field_validator("input", mode="before")
    @classmethod
    def _as_text(cls, value: Any) -> Any:
        return str(value) if isinstance(value, int) else value  # YAML parses an unquoted 16 as a number

    @field_validator("input")
    @classmethod
    def _known(cls, value: str) -> str:
        if value in ("full", "enriched") or (value.isascii() and value.isdigit() and int(value) > 1):
            return value
        raise ValueError("input must be full, enriched or a number of rings, as in 16")


class OdometrySettings(Settings):
    """Scan registration, frame by frame."""

    registration: Literal["ndt", "icp-point-to-plane"] = "ndt"
    target: Literal["map", "scan"] = "map"  # scan: the previous scan, as in the paper; drifts 3 to 7 times more
    # surface: a Gaussian constrains a point along the thin directions of the cell's surface only; covariance: by the
    # full inverse covariance of the cell, as in the paper, which mistakes the ring pattern for structure
    information_matrix: Literal["surface", "covariance"] = "surface"
    # sizes that are None follow from the first scan, see slam/cell_sizes.py; cells are coarse to fine
    cell_sizes: tuple[float, ...] | None = None  # m; None: 1.5 times the finest, and the finest
    voxel_size: float | None = Field(None, ge=0.01)  # m, downsampling for registration; aliases near a cell's size
    map_voxel_size: float | None = Field(None, ge=0.01)  # m, downsampling for the map: evens out the density
    min_range: float | None = Field(None, ge=0)  # m; nearer points are the vehicle or the person with the sensor
    max_range: float = Field(80.0, gt=0)  # m
    neighbours: Literal[1, 7] = 1  # Gaussians that a point is matched with; 7 if the target is a single scan
    min_points: int = Field(5, ge=3)  # a cell with fewer points has no Gaussian
    max_points: int = Field(1000, ge=3)  # a cell with this many is final: bounds the time, also of a standing vehicle
    regularisation: float = Field(0.003, gt=0)  # share of a cell covariance's trace on its diagonal: bounds confidence
    full_weight_sigma: float = Field(0.5, gt=0)  # m; points with a larger sigma weigh less, by the ratio squared
    kernel_scale: float = Field(1.0, gt=0)  # of the Cauchy kernel, Mahalanobis distance; insensitive from 0.5 to 3
    max_iterations: int = Field(12, ge=1)  # at the finest level; 3 are typical
    map_radius: float = Field(100.0, gt=0)  # m around the sensor; the local map drops cells beyond
    min_inlier_ratio: float = Field(0.25, ge=0, le=1)  # below it a registration has failed
    max_position_sigma: float = Field(0.5, gt=0)  # m, along the worst observed direction; above it, it has failed
    search_radius: float = Field(5.0, ge=0)  # m around the prediction, at start-up, after a gap and in a retry
    min_gate: float = Field(0.5, gt=0)  # m; a smaller distance between prediction and registration is never a jump

    @model_validator(mode="after")
    def _consistent(self) -> OdometrySettings:
        if self.registration != "ndt" and self.target != "scan":
            raise ValueError("ICP registers scan to scan: set odometry.target=scan")
        sizes = self.cell_sizes
        if sizes is not None and (not sizes or min(sizes) <= 0 or list(sizes) != sorted(sizes)[::-1]):
            raise ValueError("odometry.cell_sizes must be positive and decrease from coarse to fine")
        if self.min_range is not None and self.min_range >= self.max_range:
            raise ValueError("odometry.min_range must be below odometry.max_range")
        return self


class MapSettings(Settings):
    """The global map."""

    voxel_size: float = Field(0.2, ge=0.01)  # m; one averaged point per voxel
    min_range: float = Field(2.5, ge=0)  # m; nearer points are the vehicle itself, which would leave a trail
    max_range: float = Field(60.0, gt=0)  # m; points beyond are sparse and less accurate
    colour: bool = True  # colour points from the camera: reads one image per keyframe


class KeyframeSettings(Settings):
    """Selection of keyframes, and memory for their clouds."""

    distance: float = Field(2.0, gt=0)  # m between keyframes: a quarter of the diameter of the loop search
    angle_deg: float = Field(20.0, gt=0)  # rotation between keyframes: after a turn the sensor sees other surfaces
    voxel_size: float = Field(0.1, ge=0.01)  # m; one averaged point per voxel; half the voxel of the map
    min_range: float = Field(2.5, ge=0)  # m; nearer points are the vehicle itself
    max_range: float = Field(80.0, gt=0, le=90)  # m; as far as scan context describes
    max_sigma: float = Field(0.2, gt=0)  # m; predicted points with a larger sigma would blur the map
    # of a place in one direction that are mapped; keyframes of later ones only get poses, so memory and time stay
    # flat where one drives again and again. None: all. Fewer and all are compared in benchmarks/results/visits.md
    max_visits: int | None = Field(3, ge=1)
    memory_mb: float = Field(150.0, ge=0)  # for clouds: about 130 keyframes at 64 channels; older ones go to disk


class ScanContextSettings(Settings):
    """Descriptors of places, and their search."""

    rings: int = Field(20, ge=1)  # as in the scan context paper
    sectors: int = Field(60, ge=4)  # as in the scan context paper: 6 deg of yaw per column
    max_range: float = Field(80.0, gt=0)  # m
    sensor_height: float = 2.0  # m, added to z: the ground must be above 0, which means empty
    lateral_shifts: tuple[float, ...] = (0.0, -2.0, 2.0, -4.0, 4.0)  # m to the left: the next lane and the one after
    max_preselected: int = Field(50, ge=1)  # places with the nearest ring keys that are compared at all shifts
    min_travelled_distance: float = Field(100.0, ge=0)  # m since a place was passed: a shorter one is the same visit
    submap_length: float = Field(5.0, ge=0)  # m of travelled distance whose clouds are joined: sparse clouds need it


class VerificationSettings(Settings):
    """Verification of loop candidates by registration."""

    match_submap_radius: float = Field(10.0, ge=0)  # m of travelled distance before and after the match in its submap
    query_submap_radius: float = Field(5.0, ge=0)  # m, for the query: shorter, since the match's submap must cover it
    max_points: int = Field(10_000, ge=1)  # of each keyframe's cloud; more cost time and change little
    voxel_size: float = Field(0.4, ge=0.01)  # m, downsampling of a submap: evens out the density
    registration_voxel_size: float = Field(1.5, ge=0.01)  # m, downsampling for registration; aliases near a cell's size
    cell_sizes: tuple[float, ...] = Field((4.0, 2.0, 1.0), min_length=1)  # m; coarse cells bridge the search steps
    search_radius: float = Field(4.0, ge=0)  # m around the guess: descriptors tell the heading, the position roughly
    search_step: float = Field(2.0, gt=0)  # m, half of a coarse cell
    search_yaw_deg: float = Field(5.0, ge=0)  # yaw angles tried: that of the guess, and this much to both sides
    # of the score in the coarsest cells, relative to that of the match's own points: most false candidates end there
    min_coarse_score: float = Field(0.4, ge=0, le=1)  # true loops 0.45 to 1, false ones 0.1 to 0.6: not enough alone
    common_range: float = Field(30.0, gt=0)  # m from both sensors: points that both should have seen
    min_points: int = Field(200, ge=1)  # within common_range; fewer are no evidence
    min_inlier_ratio: float = Field(0.5, ge=0, le=1)  # true loops 0.6 to 1, false ones up to 0.8: not enough alone
    min_overlap: float = Field(0.2, ge=0, le=1)  # true loops 0.25 to 0.6: the query's submap is half as long
    min_distinctness: float = Field(0.16, ge=0, le=1)  # true loops 0.2 to 0.6; along a tunnel 0
    distinctness_radius: float = Field(2.0, gt=0)  # m between the compared poses; smaller errors do little harm
    max_point_sigma: float = Field(1.25, gt=0)  # m; true loops 0.5 to 1.2, false ones 1 to 2
    max_correction: float = Field(8.0, gt=0)  # m between guess and registration: twice the search radius
    max_correction_deg: float = Field(15.0, gt=0)  # sensors tilt by some degrees, and descriptors ignore tilt


class LoopSettings(Settings):
    """Loop closure."""

    enabled: bool = True  # false: odometry only
    max_candidates: int = Field(5, ge=1)  # places registered at most, most similar first: the first may be 5 m off
    max_descriptor_distance: float = Field(0.45, ge=0, le=1)  # 95 % of the true first candidates are below 0.28
    scan_context: ScanContextSettings = ScanContextSettings()
    verification: VerificationSettings = VerificationSettings()


class PoseGraphSettings(Settings):
    """Drift of the odometry in the pose graph: it exceeds the covariances of the registrations."""

    rotation_drift_deg: float = Field(0.2, gt=0)  # deg/sqrt(m): grows with the root of the distance, 2 deg after 100 m
    translation_drift: float = Field(0.05, gt=0)  # m/sqrt(m): 0.5 m after 100 m


class Config(Settings):
    """All settings of a run."""

    front_end: FrontEndSettings = FrontEndSettings()
    odometry: OdometrySettings = OdometrySettings()
    keyframes: KeyframeSettings = KeyframeSettings()
    loops: LoopSettings = LoopSettings()
    pose_graph: PoseGraphSettings = PoseGraphSettings()
    map: MapSettings = MapSettings()
