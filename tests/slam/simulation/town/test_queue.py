"""Cars ahead and behind keep their distance in seconds, whatever the rate of the frames."""

import numpy as np

from slam.simulation.drives import at_rate, built_in
from slam.simulation.town.roadside import Stock
from slam.simulation.town.traffic import _queue


def test_the_queue_moves_the_same_at_another_rate() -> None:
    stock = Stock.of(np.random.default_rng(0))
    slow, fast = (
        _queue(drive, stock, np.random.default_rng(1)) for drive in (built_in("jam"), at_rate(built_in("jam"), 20.0))
    )
    assert len(slow) == len(fast) > 4
    for one, other in zip(slow, fast, strict=True):
        np.testing.assert_allclose(other.way[::2], one.way, atol=0.1)
