"""What can be set, typed, with a reason beside each default."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator


class Settings(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class FrontEndSettings(Settings):
    """From the recorded scan to the cloud that is registered."""

    # full: the scan as recorded, and so is 64; 16: 16 of its rings; enriched: 16 filled in
    input: Literal["full", "64", "16", "enriched"] = "64"
    drop: Literal["every-4th", "vlp16", "average-pool"] = "every-4th"  # which 16 of its rings; the literature's default
    phase: int = Field(0, ge=0, le=3)  # of every-4th: the first ring that stays
    # a name in enrichment.methods.registry, checked where the method is made. lift: our network; ray-segment: nothing
    # learned, some milliseconds a frame; joint: this with the image, a tenth of a second; l2l, li2l, f2l: the paper's
    # networks, a second or more
    enricher: str = "lift"
    coverage: float = Field(1.0, gt=0, le=1)  # share of the predicted points that is kept: the surest
    deskew: bool | None = None  # None: where the scans have times and are not motion-compensated already
    vertical_correction_deg: float | None = None  # None: the sensor's own (KITTI: 0.205)

    @field_validator("input", mode="before")
    @classmethod
    def _as_text(cls, value: Any) -> Any:
        return str(value) if isinstance(value, int) else value  # YAML reads a bare 16 as a number


class OdometrySettings(Settings):
    """Scan registration, frame by frame."""

    registration: Literal["ndt", "icp-point-to-plane"] = "ndt"
    target: Literal["map", "scan"] = "map"  # scan: the one before, as the paper has it; drifts 3 to 7 times more
    # the Gaussians hold a point by surface: along the directions in which the cell's surface is thin; by covariance: by
    # the cell's whole inverse covariance, as the paper has it, which takes the rings' pattern for structure
    information: Literal["surface", "covariance"] = "surface"
    # sizes that are None follow from the first scan, see slam/cell_sizes.py; cells are coarse to fine
    cell_sizes: tuple[float, ...] | None = None  # m; None: 1.5 times the finest, and the finest
    voxel_size: float | None = Field(None, ge=0.01)  # m, thinning of what is registered; near a cell's size it aliases
    map_voxel_size: float | None = Field(None, ge=0.01)  # m, thinning of what enters the map: evens out near and far
    min_range: float | None = Field(None, ge=0)  # m; nearer is the car itself, or who carries the sensor
    max_range: float = Field(80.0, gt=0)  # m
    neighbours: Literal[1, 7] = 1  # Gaussians a point is held against; 7 where the target is a single scan
    min_points: int = Field(5, ge=3)  # a cell with fewer has no Gaussian
    max_points: int = Field(1000, ge=3)  # a cell with so many is left as it is: bounds time, and a standing car's
    floor: float = Field(0.003, gt=0)  # of a cell's covariance, share of its trace: flat cells must not be too sure
    full_weight_sigma: float = Field(0.5, gt=0)  # m; less certain points weigh less, by the square of the ratio
    kernel: float = Field(1.0, gt=0)  # Cauchy's, on the Mahalanobis distance; hardly matters between 0.5 and 3
    max_iterations: int = Field(12, ge=1)  # at the finest level; 3 are usual
    map_radius: float = Field(100.0, gt=0)  # m around the sensor: the map forgets the rest
    min_inlier_ratio: float = Field(0.25, ge=0, le=1)  # below it a registration has failed
    max_position_sigma: float = Field(0.5, gt=0)  # m, along the worst direction that is held: above it, it has failed
    search_radius: float = Field(5.0, ge=0)  # m around the prediction, at start-up, after a gap and in a retry
    min_gate: float = Field(0.5, gt=0)  # m between prediction and registration that is never a jump

    @model_validator(mode="after")
    def _consistent(self) -> OdometrySettings:
        if self.registration != "ndt" and self.target != "scan":
            raise ValueError("ICP registers from scan to scan: set odometry.target=scan")
        sizes = self.cell_sizes
        if sizes is not None and (not sizes or min(sizes) <= 0 or list(sizes) != sorted(sizes)[::-1]):
            raise ValueError("odometry.cell_sizes are positive and fall, coarse to fine")
        if self.min_range is not None and self.min_range >= self.max_range:
            raise ValueError("odometry.min_range must be below odometry.max_range")
        return self


class MapSettings(Settings):
    """The global map."""

    voxel_size: float = Field(0.2, ge=0.01)  # m: one averaged point a voxel
    min_range: float = Field(2.5, ge=0)  # m; nearer is the car itself, which would leave a trail
    max_range: float = Field(60.0, gt=0)  # m; further points are sparse and less exact
    colour: bool = True  # where a camera sees it: an image a keyframe is read


class KeyframeSettings(Settings):
    """Which frames are kept, and in how much memory."""

    distance: float = Field(2.0, gt=0)  # m between two of them: a quarter of the width of what loops look for
    angle_deg: float = Field(20.0, gt=0)  # turned on the spot or around a corner, it sees something else
    voxel_size: float = Field(0.1, ge=0.01)  # m: one averaged point a voxel; half of the map's voxel
    min_range: float = Field(2.5, ge=0)  # m; nearer is the car itself
    max_range: float = Field(80.0, gt=0, le=90)  # m; scan context describes as much
    max_sigma: float = Field(0.2, gt=0)  # m; predicted points that are less certain would blur the map
    memory_mb: float = Field(1000.0, ge=0)  # for their clouds: about 1100 at 64 channels; older ones go to disk


class ScanContextSettings(Settings):
    """How places are described and looked for."""

    rings: int = Field(20, ge=1)  # the paper's
    sectors: int = Field(60, ge=4)  # the paper's: 6 deg of yaw a column
    max_range: float = Field(80.0, gt=0)  # m
    sensor_height: float = 2.0  # m, added to z: the ground must stay above 0, which means empty
    lateral_shifts: tuple[float, ...] = (0.0, -2.0, 2.0, -4.0, 4.0)  # m to the left: the lane beside and the one after
    preselected: int = Field(50, ge=1)  # at most so many places, nearest by ring key, are compared at all shifts
    min_travelled: float = Field(100.0, ge=0)  # m of way: what was passed more recently is the same visit, not a loop
    submap_length: float = Field(5.0, ge=0)  # m of way whose clouds are joined: sparse clouds need it


class VerificationSettings(Settings):
    """Which candidates of the loop search are loops."""

    match_reach: float = Field(10.0, ge=0)  # m of way on both sides of the match whose clouds make its submap
    query_reach: float = Field(5.0, ge=0)  # m of way around the query: less, for the match's submap has to cover it
    max_points: int = Field(10_000, ge=1)  # of each keyframe's cloud; more take time and change little
    voxel_size: float = Field(0.4, ge=0.01)  # m, thinning of a submap: evens out near and far
    registered_voxel_size: float = Field(1.5, ge=0.01)  # m, of what is registered; near a cell's size it aliases
    cell_sizes: tuple[float, ...] = Field((4.0, 2.0, 1.0), min_length=1)  # m: the coarse ones bridge the search's steps
    search_radius: float = Field(4.0, ge=0)  # m around the guess: a descriptor tells the heading, hardly the place
    search_step: float = Field(2.0, gt=0)  # m, half of a coarse cell
    search_yaw_deg: float = Field(5.0, ge=0)  # the guess's yaw is tried, and so much to the left and to the right
    common_range: float = Field(30.0, gt=0)  # m from both sensors: there both should have seen the same
    min_points: int = Field(200, ge=1)  # in common range; fewer say nothing
    min_inlier_ratio: float = Field(0.5, ge=0, le=1)  # true loops 0.6 to 1, wrong ones up to 0.8: not enough alone
    min_overlap: float = Field(0.2, ge=0, le=1)  # true 0.25 to 0.6: the query's submap is half as long
    min_distinctness: float = Field(0.16, ge=0, le=1)  # true 0.2 to 0.6; along a tunnel 0
    distinct_radius: float = Field(2.0, gt=0)  # m aside; what is wrong by less does little harm
    max_point_sigma: float = Field(1.25, gt=0)  # m; true 0.5 to 1.2, wrong 1 to 2
    max_correction: float = Field(8.0, gt=0)  # m between guess and registration: twice the search's radius
    max_correction_deg: float = Field(15.0, gt=0)  # sensors tilt by some degrees, which descriptors do not see


class LoopSettings(Settings):
    """Places seen before."""

    enabled: bool = True  # false: odometry alone
    candidates: int = Field(5, ge=1)  # places that are registered at most, most alike first: the first may lie 5 m off
    max_distance: float = Field(0.45, ge=0, le=1)  # of descriptors; 95 % of true first candidates lie below 0.28
    scan_context: ScanContextSettings = ScanContextSettings()
    verification: VerificationSettings = VerificationSettings()


class PoseGraphSettings(Settings):
    """How far the odometry is trusted between loops: it drifts by more than its registrations say."""

    rotation_deg: float = Field(0.2, gt=0)  # after one metre; grows with the root of the way: 2 deg after 100 m
    translation: float = Field(0.05, gt=0)  # m after one metre, likewise: 0.5 m after 100 m


class Config(Settings):
    front_end: FrontEndSettings = FrontEndSettings()
    odometry: OdometrySettings = OdometrySettings()
    keyframes: KeyframeSettings = KeyframeSettings()
    loops: LoopSettings = LoopSettings()
    pose_graph: PoseGraphSettings = PoseGraphSettings()
    map: MapSettings = MapSettings()
