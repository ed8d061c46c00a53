"""Rows that grow with a run."""

from __future__ import annotations

import numpy as np
import pytest

from slam.data.growing import BLOCK, Growing


@pytest.mark.parametrize("count", [0, 1, BLOCK, BLOCK + 1, 2 * BLOCK + 3])
def test_rows_come_back_as_they_were_appended(count: int) -> None:
    rows, expected = Growing(3), np.arange(3.0 * count).reshape(-1, 3)
    for row in expected:
        rows.append(row)
    assert len(rows) == count
    np.testing.assert_array_equal(rows.array(), expected)
    np.testing.assert_array_equal(rows.array(1), expected[:, 1])
    np.testing.assert_array_equal(rows.array(slice(1, None)), expected[:, 1:])
    if count:
        np.testing.assert_array_equal(rows[-1], expected[-1])


def test_a_row_that_was_read_does_not_change() -> None:
    rows = Growing(2)
    rows.append(np.array([1.0, 2.0]))
    read = rows[0]
    rows[0] = np.array([3.0, 4.0])
    assert read.tolist() == [1, 2]
    assert rows[-1].tolist() == [3, 4]
    with pytest.raises(IndexError):
        rows[1]


def test_single_numbers() -> None:
    laps = Growing()
    laps.append(1.5)
    laps.append(2.5)
    assert laps.array().tolist() == [1.5, 2.5]
