"""Records whose times are in another unit than seconds."""

import warnings

import numpy as np
import pytest

from stickslip.identification import LevenbergMarquardt, Observed, Problem, Record
from stickslip.systems import CoulombOscillator, Motion


def fitted(times):
    """One step of a fit to a record that the model does not explain; it swings once in 5.7 s."""
    problem = Problem(
        system=lambda p, inputs: CoulombOscillator(1.0, p["k"], 1.0, 0.5, 0.2),
        initial_state=lambda p, inputs: Motion(x=0.1, v=0.2),
        unknowns={"k": 1.2},
        observed={"position": Observed(lambda t, y, system: y.x, 1e-3, "m")},
        records=Record(times, {"position": np.cos(np.arange(21.0))}),
    )
    fit = problem.fit(method=LevenbergMarquardt(max_steps=1))
    assert float(fit.reduced_chi_squared) > 100.0


def test_stamps_are_named_before_anything_runs(monkeypatch):
    """A run over thousands of swings, and a fit of such runs, takes minutes."""

    def solved(*_):
        raise AssertionError("a fit has begun without a word")

    monkeypatch.setattr("stickslip.identification._problem.solve_run", solved)
    with pytest.warns(UserWarning, match="times lie 500 s apart"), pytest.raises(AssertionError):
        fitted(np.linspace(0.0, 10e3, 21))


@pytest.mark.more
def test_stamps_between_which_the_model_swings_are_named():
    with pytest.warns(UserWarning, match=r"times lie 500 s apart, .* swings 87.2 times .* in seconds"):
        fitted(np.linspace(0.0, 10e3, 21))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fitted(np.linspace(0.0, 10.0, 21))
