"""An angle comes back after whole turns: observables, periods of orbits, and what has none."""

import math
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.analysis import Maximum, PeriodTest, Recording, orbit_diagram, period_of, time_history
from stickslip.analysis._attractor import PERIOD_STATUS
from stickslip.analysis._builder import labelled_parameters
from stickslip.analysis.observable import as_observable, whole_of
from stickslip.sweep import Compute, Variable
from stickslip.systems import BlockOnDrivenBelt

TURN = 2.0 * math.pi
DRIVE = 1.0  # [rad/s]


class Swing(NamedTuple):
    theta: Any
    omega: Any


class Pendulum(ss.AbstractSmoothSystem):
    r"""$\ddot\theta + c\dot\theta + \sin\theta = T + A\cos t$."""

    torque: Any
    damping: Any = 0.3
    drive: Any = 1.0
    units: ClassVar = {"theta": "rad", "omega": "rad/s"}
    parameter_units: ClassVar = {"torque": "1", "damping": "1"}
    periods: ClassVar = {"theta": TURN}

    def vector_field(self, t, y, mode, args):
        pull = self.torque + self.drive * jnp.cos(DRIVE * t)
        return Swing(y.omega, pull - self.damping * y.omega - jnp.sin(y.theta))


class Unaware(Pendulum):
    """The same, which does not say that its angle is one."""

    periods: ClassVar = {}


STROBE = ss.Section(
    lambda system, t, y, dy, mode, args: jnp.sin(DRIVE * t - 1.0), "rising", name="strobe"
)
RK4 = ss.Integrator("rk4", ss.FixedStep(TURN / 200))
TORQUES = np.array([0.3, 0.6, 0.9])  # chaos, and locked to the drive: two turns and three in a period


def diagram(kind):
    return orbit_diagram(
        kind(0.5), {"torque": TORQUES}, Swing(0.1, 0.0),
        Recording(
            50 * TURN, 20.3 * TURN, STROBE, ["theta", "omega"], max_points=21,
            period=PeriodTest(longest=4), check=0,
        ),
        integrator=RK4,
        compute=Compute("portable", progress=False),
    )  # fmt: skip


@pytest.fixture(scope="module")
def found():
    return diagram(Pendulum)


def turns_of(torque):
    """Whole turns per period of the drive by SciPy, and how far the angle is from coming back."""

    def field(t, y):
        return [y[1], torque + np.cos(t) - 0.3 * y[1] - np.sin(y[0])]

    t = 1.0 + TURN * np.arange(50, 70)
    theta = solve_ivp(field, (0.0, t[-1]), [0.1, 0.0], "DOP853", t, rtol=1e-10, atol=1e-11).y[0]
    steps = np.diff(theta) / TURN
    return np.round(steps).astype(int), float(np.abs(steps - np.round(steps)).max())


@pytest.mark.slow
def test_a_pendulum_that_whirls_has_a_period(found):
    turns, off = zip(*map(turns_of, TORQUES), strict=True)
    # What comes back does so after one period of the drive, but for whole turns.
    assert [set(t.tolist()) for t in turns[1:]] == [{2}, {3}]
    assert max(off[1:]) < 1e-6 < 0.1 < off[0]
    assert found.period.values.tolist()[1:] == [1, 1]
    assert int(found.period[0]) <= 0
    assert found.theta.attrs["period"] == TURN
    assert float(np.abs(found.theta).max()) <= math.pi


@pytest.mark.slow
def test_without_the_period_of_the_angle_it_has_none(found):
    unaware = diagram(Unaware)
    assert all(unaware.period[1:] != 1)
    assert float(unaware.theta[1].max()) > 10 * TURN
    whole = (unaware.theta - found.theta) / TURN
    np.testing.assert_allclose(whole[1], np.round(whole[1]), atol=1e-9)
    np.testing.assert_allclose(found.omega[1:], unaware.omega[1:], atol=1e-9)


@pytest.mark.parametrize(("angle", "folded"), [(0.5, 0.5), (4.0, 4.0 - TURN), (-40.0, 6 * TURN - 40.0)])
def test_an_angle_is_folded(angle, folded):
    system, y = Pendulum(0.5), Swing(jnp.asarray(angle), jnp.asarray(1.0))
    observable, unit = as_observable("it", "theta", system, y)
    assert float(observable(system, 0.0, y, y, 0, None)) == pytest.approx(folded, abs=1e-12)
    assert unit == "rad"
    assert float(whole_of(observable)(system, 0.0, y, y, 0, None)) == angle
    unaware, _ = as_observable("it", "theta", Unaware(0.5), y)
    assert float(unaware(system, 0.0, y, y, 0, None)) == angle


def test_parameters_have_units():
    grid = {"torque": TORQUES, "drive": TORQUES}
    labels = labelled_parameters(Pendulum(0.5), grid, {"drive": Variable(long_name="drive")})
    assert (labels["torque"].units, labels["drive"].long_name) == ("1", "drive")
    belt = BlockOnDrivenBelt.constructed(85.0)
    parts = labelled_parameters(belt, {"drive__U_in": TORQUES, "k3": TORQUES}, {})
    assert [v.units for v in parts.values()] == ["V", "N/m"]
    # A function may make anything of a point: the unit is known where the parameter has its value.
    one = {"torque": TORQUES}
    made = labelled_parameters(lambda torque: Pendulum(torque), one, {})
    assert made["torque"].units == "1"
    assert labelled_parameters(lambda torque: Pendulum(2.0 * torque), one, {}) == {}
    assert labelled_parameters(lambda pull: Pendulum(pull), {"pull": TORQUES}, {}) == {}


@pytest.mark.slow
def test_observables_are_folded_and_sections_are_not():
    t = np.linspace(0.0, 6 * TURN, 601)
    maxima = {"top": Maximum("omega"), "far": Maximum("theta")}
    seen = time_history(
        Pendulum(0.75), Swing(0.0, 2.0), t, ["theta", "omega", "slope of theta"], sections=maxima,
        integrator=RK4,
    )  # fmt: skip
    free = time_history(Unaware(0.75), Swing(0.0, 2.0), t, ["theta"], integrator=RK4)
    assert float(free.theta.max()) > 3 * TURN
    folded = np.mod(free.theta + math.pi, TURN) - math.pi
    np.testing.assert_allclose(seen.theta, folded, atol=1e-9)
    np.testing.assert_array_equal(seen.slope_of_theta, seen.omega)
    # It never turns back: the angle has no maximum, though the folded one falls every turn.
    assert float(seen.omega.min()) > 0.0
    assert seen.sizes["far_point"] == 0
    assert seen.sizes["top_point"] > 0


@jax.jit
def judged(points, count, span):
    return period_of(points, count, span, tolerance=1e-4, max_period=6, periods=(TURN,))


@pytest.mark.parametrize(
    ("points", "period"),
    [
        (0.3 + TURN * np.arange(24), 1),
        (0.3 + TURN * np.arange(24) + 0.7 * (np.arange(24) % 2), 2),
        (TURN / 3 * np.arange(24) - 5.0, 3),
        (-TURN * np.arange(24) + math.pi + 1e-9 * (-1.0) ** np.arange(24), 1),  # where a fold would cut
        (0.3 + 0.618034 * TURN * np.arange(48), 0),
        (0.5 * (-1.0) ** np.arange(24), 2),  # does not go round
    ],
)
def test_period_of_points_on_a_circle(points, period):
    column = np.full((48, 1), np.nan)
    column[: points.size, 0] = points
    verdict = judged(column, points.size, np.array([[points.min()], [points.max()]]))
    assert int(verdict.period) == period
    word = PERIOD_STATUS[int(verdict.status)]
    assert word == ("repeats" if period else "none")


def test_wrong_periods():
    column, span = jnp.zeros((8, 1)), jnp.asarray([[0.0], [1.0]])
    with pytest.raises(ValueError, match=r"periods\[0\] = -1.0: it must be finite and positive"):
        period_of(column, 8, span, tolerance=1e-4, max_period=4, periods=(-1.0,))
    with pytest.raises(ValueError, match=r"periods = .*: it must be 1 of them"):
        period_of(column, 8, span, tolerance=1e-4, max_period=4, periods=(1.0, None))

    class Wrong(Pendulum):
        periods: ClassVar = {"theta": 0.0}

    with pytest.raises(ValueError, match=r"periods\['theta'\] = 0.0: it must be finite and positive"):
        time_history(Wrong(0.5), Swing(0.0, 0.0), [0.0, 1.0], "theta")
