"""Time histories, Poincaré points and energy ledgers of motions with closed forms."""

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.analysis import Maximum, Samples, energy_ledger, time_history
from stickslip.sweep import Labels, Variable
from stickslip.systems import BouncingBall, CoulombOscillator, Motion

from ._chaos import Point, lorenz

OSCILLATOR = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
PRECISE = ss.Integrator("tsit5", ss.AdaptiveStep(1e-11, 1e-12))
PERIOD = 5.0 + 2 * np.pi - 2 * np.arctan(2.5)


@pytest.fixture(scope="module")
def history():
    return time_history(
        OSCILLATOR,
        Motion(0.0, 0.2),
        Samples(np.linspace(30.0, 60.0, 301), transient=30.0),
        {
            "x": "x",
            "v": "v",
            "a": "slope of v",
            "work_rate": lambda system, t, y, dy, mode, args: y.v * dy.v,
        },
        sections={
            "top": Maximum("x"),
            "rising": ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "rising"),
        },
        integrator=PRECISE,
        labels=Labels({"a": Variable(units="m/s^2", long_name="acceleration")}, name="one run"),
    )


@pytest.mark.more
def test_history_is_the_motion(history):
    from tests.stickslip.hybrid._systems import stick_slip_motion

    exact = [stick_slip_motion(t, 0.2)[0] for t in history.time.values]
    np.testing.assert_allclose(history.x, exact, atol=1e-8)
    stuck = history.mode.values == 1
    assert 0.3 < stuck.mean() < 0.6
    np.testing.assert_array_equal(history.v.values[stuck], 0.2)
    np.testing.assert_allclose(history.work_rate, history.v * history.a, atol=1e-15)
    assert history.x.units == "m"
    assert history.a.attrs == {"units": "m/s^2", "long_name": "acceleration"}
    assert history.attrs["title"] == "one run"
    assert history.attrs["mode_names"] == ["slip backward", "stick", "slip forward"]


def test_poincare_points(history):
    """The top of the cycle is F_k + sqrt(D^2 + v^2); points repeat every period, none is too early."""
    tops = 5.0 + np.arctan(0.2 / 0.5) + PERIOD * np.arange(3, 7)
    np.testing.assert_allclose(history.at_top_t, tops, atol=1e-8)
    np.testing.assert_allclose(history.at_top_x, 0.5 + np.hypot(0.5, 0.2), atol=1e-9)
    np.testing.assert_allclose(history.at_top_v, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.diff(history.at_rising_t), PERIOD, atol=1e-9)
    np.testing.assert_allclose(history.at_rising_x, 0.3, atol=1e-12)
    assert float(history.at_top_t.min()) >= 30.0


def test_ledger_of_a_cycle():
    """Over one period the belt gives what friction takes; the stick gives nothing to friction."""
    t = np.linspace(0.0, PERIOD, 101)
    ledger = energy_ledger(OSCILLATOR, Motion(0.0, 0.2), t, integrator=PRECISE)
    assert float(abs(ledger.imbalance).max()) < 1e-9
    # Slip: friction takes F_k times the way against the belt, F_k (2 D + v t_slip).
    slipping = PERIOD - 5.0
    start = ledger.isel(time=0)
    assert float(start.work_belt) == 0.0
    way = 0.2 * slipping + 2 * 0.5
    stuck = t < 5.0
    np.testing.assert_allclose(ledger.power_friction.values[stuck], 0.0)
    assert float(ledger.work_friction[-1]) == pytest.approx(-0.5 * way, abs=1e-8)
    assert ledger.power_belt.units == "W"


@pytest.mark.more
def test_a_ledger_after_a_transient_is_the_rest_of_the_ledger():
    t = np.linspace(4.0, 9.0, 26)
    start = Motion(0.0, 0.2)
    late = energy_ledger(OSCILLATOR, start, Samples(t, transient=4.0), integrator=PRECISE)
    whole = energy_ledger(OSCILLATOR, start, np.concatenate([[0.0], t]), integrator=PRECISE)
    whole = whole.isel(time=slice(1, None))
    np.testing.assert_allclose(late.energy, whole.energy, atol=1e-9)
    works = whole.work_friction - whole.work_friction[0]
    np.testing.assert_allclose(late.work_friction, works, atol=1e-9)
    assert float(abs(works[-1])) > 0.1


def test_ledger_of_impacts():
    """The ball loses (1 - e^2) of its kinetic energy at each bounce, counted at events."""
    ball = BouncingBall(0.5, 9.81, 0.7, 0.2)
    ledger = energy_ledger(ball, Motion(1.0, 0.0), np.linspace(0.0, 1.0, 21), integrator=PRECISE)
    assert float(ledger.loss_at_events[-1]) == pytest.approx(-0.5 * 9.81 * (1 - 0.7**2), rel=1e-9)
    assert float(abs(ledger.imbalance).max()) < 1e-9


def test_bad_input():
    y0, t = Motion(0.0, 0.2), np.linspace(0.0, 1.0, 5)
    with pytest.raises(ValueError, match=r"observables\['z'\] = 'z': it must be a component"):
        time_history(OSCILLATOR, y0, t, "z")
    with pytest.raises(ValueError, match=r"observables = \(\): it must be a name.*at least one"):
        time_history(OSCILLATOR, y0, t, ())
    for wrong in ([1.0], [1.0, 0.0], np.zeros((2, 2))):
        with pytest.raises(ValueError, match=r"^record(\[1\])? = "):
            time_history(OSCILLATOR, y0, wrong, "x")
        with pytest.raises(ValueError, match=r"^record(\[1\])? = "):
            energy_ledger(OSCILLATOR, y0, wrong)
        with pytest.raises(ValueError, match=r"^ts(\[1\])? = "):
            Samples(wrong)
    with pytest.raises(ValueError, match=r"transient = -1\.0"):
        Samples(t, -1.0)
    with pytest.raises(ValueError, match="max_points = 0"):
        Samples(t, max_points=0)
    with pytest.raises(ValueError, match=r"variables\['z'\].*a label of one of x"):
        time_history(OSCILLATOR, y0, t, "x", labels=Labels({"z": Variable(units="m")}))
    with pytest.raises(ValueError, match=r"labels\.settings"):
        time_history(OSCILLATOR, y0, t, "x", labels=Labels(settings={"seed": 1}))
    with pytest.raises(TypeError, match="unexpected keyword argument 'transient'"):
        time_history(OSCILLATOR, y0, t, "x", transient=1.0)
    with pytest.raises(TypeError, match=r"sections\['a'\] = 'x': it must be a Section"):
        time_history(OSCILLATOR, y0, t, "x", sections={"a": "x"})
    with pytest.raises(TypeError, match="must be a system with a method `energy`"):
        energy_ledger(lorenz(), Point(0.0, 0.0, jnp.asarray(0.0)), t)
