from pathlib import Path

import numpy as np
import pytest

from slam.data.errors import InputError
from slam.data.sensor import Sensor, kitti_sensor, load_sensor


@pytest.mark.parametrize("name", ["hdl64", "HDL-64E", "hdl64e"])
def test_the_hdl64_has_64_falling_lines_from_2_to_minus_25_degrees(name: str) -> None:
    sensor = load_sensor(name)
    assert sensor.ring_count == 64
    assert (np.diff(sensor.elevation) < 0).all()
    assert np.rad2deg(sensor.elevation[[0, -1]]) == pytest.approx([1.9367, -24.9994])
    assert sensor.offset[[0, 32]] == pytest.approx([0.2091, 0.1258])


def test_the_vlp16_follows_its_data_sheet() -> None:
    sensor = load_sensor("vlp16")
    assert np.rad2deg(sensor.elevation) == pytest.approx(np.arange(15, -16, -2))
    assert sensor.offset[[0, 15]] == pytest.approx([-0.0112, 0.0112])  # the lines cross in front of the sensor


def test_a_file_describes_a_sensor_of_ones_own(tmp_path: Path) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_text("model: mine\nbeams: [[2, 0.01], [0, 0], [-2.0, -0.01]]\nvertical_correction_deg: 1\n")
    sensor = load_sensor(path)
    assert (sensor.name, sensor.ring_count, sensor.motion_compensated) == ("mine", 3, False)
    assert sensor.vertical_correction == pytest.approx(np.deg2rad(1))
    assert sensor.offset == pytest.approx([0.01, 0, -0.01])


def test_a_file_may_name_a_built_in_model(tmp_path: Path) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_text("model: hdl64e\nmotion_compensated: true\n")
    sensor = load_sensor(path)
    assert sensor.ring_count == 64
    assert sensor.motion_compensated


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("model: vlp61", "did you mean 'vlp16'"),
        ("modle: vlp16", "unknown key 'modle'; did you mean 'model'"),
        ("motion_compensated: true", "'model'"),
        ("model: vlp16\nmotion_compensated: maybe", "true or false"),
        ("beams: [[1, 0], [2, 0]]", "top first"),
        ("beams: [1, 2]", "n x 2"),
        ("beams: [[1, a]]", "n x 2"),
        ("beams: [[1, 0, 0], [0, 0]]", "n x 2"),
        ("model: vlp16\nvertical_correction_deg: .nan", "finite"),
        ("- a list", "key: value"),
        ("model: [", "not YAML"),
        ("!!python/object/apply:os.getcwd []", "not YAML"),
    ],
)
def test_a_wrong_file_is_refused_with_a_remedy(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=r"sensor\.yaml") as error:
        load_sensor(path)
    assert message in str(error.value)


def test_unknown_names_and_missing_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="did you mean 'hdl64'"):
        load_sensor("hdl46")
    with pytest.raises(InputError, match="cannot be read"):
        load_sensor(tmp_path / "none.yaml")


def test_the_vlp32c_follows_its_manual() -> None:
    sensor = load_sensor("VLP-32C")
    assert np.rad2deg(sensor.elevation[[0, 11, 31]]) == pytest.approx([15, 0, -25])
    assert -np.diff(np.rad2deg(sensor.elevation))[5:25] == pytest.approx([2 / 3, *[1 / 3] * 17, 2 / 3, 2 / 3], abs=1e-3)
    assert sorted(set(np.rad2deg(sensor.azimuth).round(3))) == [-4.2, -1.4, 1.4, 4.2]


def test_the_hdl32_is_even() -> None:
    sensor = load_sensor("HDL-32E")
    assert np.rad2deg(sensor.elevation[[0, 8, 31]]) == pytest.approx([10.667, 0, -30.667], abs=1e-3)
    assert -np.diff(np.rad2deg(sensor.elevation)) == pytest.approx(np.full(31, 1.333), abs=1e-3)


def test_the_vls128_is_dense_near_the_horizon() -> None:
    sensor = load_sensor("vls128")
    steps = -np.diff(np.rad2deg(sensor.elevation))
    assert sensor.ring_count == 128
    assert np.rad2deg(sensor.elevation[[0, -1]]) == pytest.approx([15, -25])
    assert steps[12:115] == pytest.approx(np.full(103, 0.11))
    assert (np.diff(steps[:12]) < 0).all()
    assert (np.diff(steps[115:]) > 0).all()
    assert len(set(sensor.azimuth.round(6))) == 8
    assert np.rad2deg(np.abs(sensor.azimuth).max()) == pytest.approx(6.354)


@pytest.mark.parametrize("rings", [64, 128])
def test_an_os1_is_even_and_staggered(rings: int) -> None:
    sensor = load_sensor(f"OS1-{rings}")
    assert np.rad2deg(sensor.elevation) == pytest.approx(np.linspace(22.5, -22.5, rings))
    assert np.rad2deg(sensor.azimuth[:8]) == pytest.approx([-3.164, -1.055, 1.055, 3.164] * 2)


def test_beams_may_be_staggered(tmp_path: Path) -> None:
    path = tmp_path / "sensor.yaml"
    path.write_text("beams: [[2, 0.01, 3], [0, 0, -3]]\n")
    assert np.rad2deg(load_sensor(path).azimuth) == pytest.approx([3, -3])
    assert np.rad2deg(load_sensor("vlp16").azimuth) == pytest.approx(np.zeros(16))
    assert np.rad2deg(load_sensor(path).only(np.array([1])).azimuth) == pytest.approx([-3])
    with pytest.raises(ValueError, match="different lengths"):
        Sensor("odd", np.zeros(2), np.zeros(2), azimuth=np.zeros(3))


def test_only_kittis_own_lidar_has_its_vertical_error(tmp_path: Path) -> None:
    error = pytest.approx(np.deg2rad(0.205))
    assert kitti_sensor(tmp_path, None, True).vertical_correction == error
    assert kitti_sensor(tmp_path, "HDL-64E", True).vertical_correction == error
    assert kitti_sensor(tmp_path, "vlp16", True).vertical_correction == 0
    (tmp_path / "sensor.yaml").write_text("model: hdl64\nvertical_correction_deg: 0.3\n")
    assert kitti_sensor(tmp_path, "hdl64", True).vertical_correction == pytest.approx(np.deg2rad(0.3))
    assert kitti_sensor(tmp_path, "vlp16", True).vertical_correction == 0  # 0.3 deg are those of the HDL-64E
