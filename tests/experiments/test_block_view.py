"""What the viewer is given for the block on a belt: orbit and diagram are of one motion."""

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from experiments.block.view import diagram, orbit


@pytest.mark.slow
def test_the_orbit_passes_through_the_points_of_the_diagram(compiled):
    k3, model, protocol = 80.0, "simplified", "paper"
    run = orbit(k3=k3, model=model, protocol=protocol)
    moved = cumulative_trapezoid(run.velocity.values, run.time.values, initial=0.0)
    np.testing.assert_allclose(run.x.values - run.x.values[0], moved, atol=1e-5)
    # The diagram's section is passed at the maxima of the velocity, seen here to one sample.
    v = run.velocity.values
    at = 1 + np.flatnonzero((v[1:-1] > v[:-2]) & (v[1:-1] >= v[2:]))
    found = diagram(k3=(k3, k3 + 1.0), model=model, protocol=protocol)
    assert found.k3.values[[0, -1]].tolist() == [80.0, 81.0]
    points = found.x.values[0, : at.size]
    np.testing.assert_allclose(run.x.values[at], points, rtol=0, atol=0.002 * v.max())
    programs = len(compiled)
    diagram(k3=(90.0, 90.5), model=model, protocol=protocol)
    orbit(k3=90.0, model=model, protocol=protocol)
    assert len(compiled) == programs
