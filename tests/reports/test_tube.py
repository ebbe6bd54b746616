"""The tube around a curve holds what the curve does nearby, and nothing else."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flipproof.curves.tube import tube_around


@given(st.lists(st.floats(-5, 5), min_size=2, max_size=12), st.floats(0.001, 3.0), st.floats(0.0, 1.0))
def test_the_bounds_are_those_of_a_dense_search(values, dt, dy):
    times, values = np.arange(len(values), dtype=float), np.array(values)
    at = np.linspace(0.0, times[-1], 23)
    lower, upper = tube_around(times, values, at, dt, dy)
    for k, moment in enumerate(at):
        near = np.linspace(max(moment - dt, 0.0), min(moment + dt, times[-1]), 2001)
        dense = np.interp(near, times, values)
        assert lower[k] == pytest.approx(dense.min() - dy, abs=0.1)
        assert upper[k] == pytest.approx(dense.max() + dy, abs=0.1)
        assert lower[k] <= dense.min() - dy + 1e-12
        assert upper[k] >= dense.max() + dy - 1e-12
