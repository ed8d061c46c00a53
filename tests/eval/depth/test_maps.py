"""KITTI's depth completion images: files that belong together, and the benchmark's own figures."""

import cv2
import numpy as np
import pytest

from eval.depth.maps import depth_map_figures, depth_map_triples, is_depth_map_folder, mean_over_images
from slam.data.errors import InputError

NAMES = {
    "velodyne_raw": "drive_0002_sync_velodyne_raw_0000000005_image_02.png",
    "groundtruth_depth": "drive_0002_sync_groundtruth_depth_0000000005_image_02.png",
    "image": "drive_0002_sync_image_0000000005_image_02.png",
}


@pytest.fixture
def folder(tmp_path):
    """One triple, 2 x 3 pixels: 1.5 m measured in one of them, the truth 2 m everywhere."""
    sparse, image = np.zeros((2, 3), np.uint16), np.zeros((2, 3, 3), np.uint8)
    sparse[0, 1], image[..., 2] = 384, 200  # OpenCV's order: red
    for kind, values in zip(NAMES, (sparse, np.full((2, 3), 512, np.uint16), image), strict=True):
        (tmp_path / kind).mkdir()
        cv2.imwrite(str(tmp_path / kind / NAMES[kind]), values)
    return tmp_path


def test_triples_are_found_by_file_names(folder):
    assert is_depth_map_folder(folder)
    (triple,) = depth_map_triples(folder)
    sparse, truth, image = triple.read()
    np.testing.assert_array_equal(sparse, [[0, 1.5, 0], [0, 0, 0]])
    np.testing.assert_array_equal(truth, np.full((2, 3), 2.0))
    np.testing.assert_array_equal(image[0, 0], [200, 0, 0])


def test_other_folders_are_not_depth_map_folders(tmp_path):
    assert not is_depth_map_folder(tmp_path)
    (tmp_path / "velodyne_raw").mkdir()
    with pytest.raises(InputError, match="velodyne_raw"):
        depth_map_triples(tmp_path)


@pytest.mark.parametrize("kind", NAMES)
def test_a_missing_file_is_an_error(folder, kind):
    triple = depth_map_triples(folder)[0]
    (folder / kind / NAMES[kind]).unlink()
    with pytest.raises(InputError, match=NAMES[kind]):
        triple.read()


def test_eight_bit_depth_is_an_error(folder):
    cv2.imwrite(str(folder / "velodyne_raw" / NAMES["velodyne_raw"]), np.zeros((2, 3), np.uint8))
    with pytest.raises(InputError, match="16-bit"):
        depth_map_triples(folder)[0].read()


def test_different_sizes_are_an_error(folder):
    cv2.imwrite(str(folder / "image" / NAMES["image"]), np.zeros((5, 3, 3), np.uint8))
    with pytest.raises(InputError, match="image"):
        depth_map_triples(folder)[0].read()


def test_figures_cover_pixels_with_ground_truth():
    truth, dense = np.array([[2.0, 4.0, 0.0, 5.0]]), np.array([[2.5, 4.0, 9.0, 0.0]])
    figures = depth_map_figures(truth, dense)
    assert figures.coverage == pytest.approx(2 / 3)
    assert figures.mae_mm == pytest.approx(250)
    assert figures.rmse_mm == pytest.approx(1000 * np.sqrt(0.25 / 2))
    assert figures.imae == pytest.approx(50)


def test_means_are_over_images_not_over_pixels():
    one, other = np.ones((1, 1)), np.ones((3, 1))
    figures = mean_over_images([depth_map_figures(one, one + 1), depth_map_figures(other, other)])
    assert figures.images == 2
    assert figures.rmse_mm == pytest.approx(500)


def test_images_without_a_prediction_count_as_uncovered():
    one = np.ones((1, 1))
    figures = mean_over_images([depth_map_figures(one, one + 1), depth_map_figures(one, one * 0)])
    assert figures.coverage == 0.5
    assert figures.mae_mm == pytest.approx(1000)
