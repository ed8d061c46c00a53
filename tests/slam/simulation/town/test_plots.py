import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slam.simulation.town.plots import Plots

inside = st.floats(10, 90)


def test_what_is_taken_is_not_given_again() -> None:
    plots = Plots(np.zeros(2), np.full(2, 100.0))
    assert plots.claim(np.array([50, 50]), 0.3, (10, 6))
    assert not plots.claim(np.array([52, 51]), 1.0, (3, 3))
    assert plots.claim(np.array([70, 50]), 0.3, (10, 6))


def test_a_blocked_line_keeps_its_distance() -> None:
    plots = Plots(np.zeros(2), np.full(2, 100.0))
    plots.block(np.column_stack([np.arange(101.0), np.full(101, 50.0)]), 5.0)
    assert not plots.claim(np.array([40, 57]), 0, (4, 6))
    assert plots.claim(np.array([40, 59.5]), 0, (4, 6))


@given(inside, inside, st.floats(0, 6.3), st.floats(1, 8), st.floats(1, 8))
def test_a_claim_holds_at_its_own_corners(x: float, y: float, yaw: float, length: float, width: float) -> None:
    plots = Plots(np.zeros(2), np.full(2, 100.0))
    assert plots.claim(np.array([x, y]), yaw, (length, width))
    c, s = np.cos(yaw), np.sin(yaw)
    for u, v in ((1, 1), (1, -1), (-1, 1), (-1, -1), (0, 0)):
        a, b = u * length / 2, v * width / 2
        assert not plots.claim(np.array([x + c * a - s * b, y + s * a + c * b]), 0, (0.1, 0.1))
