from pathlib import Path

import numpy as np
import pytest

from slam.data.errors import InputError
from slam.data.sensor import load_sensor


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
