"""Wrong arguments: an error that names the argument, its value and what is allowed, at once."""

from typing import ClassVar

import diffrax as dfx
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from tests.stickslip.hybrid._systems import Circle, Pendulum, State

Y0 = State(1.0, 0.0)


class ThreeGuards(Circle):
    """Names two guards, returns three."""

    def guards(self, t, y, mode, args):
        return (y.x, y.v, y.x)


class VectorGuard(Circle):
    """A guard that is not a scalar."""

    def guards(self, t, y, mode, args):
        return jnp.stack([y.x, y.v]), y.x


class WrongSlope(Circle):
    """The slope has another structure than the state."""

    def vector_field(self, t, y, mode, args):
        return (y.v, -y.x)


class WrongScales(Circle):
    """One scale for two guards."""

    guard_scales: ClassVar = (1.0,)


class ScalesOfAMethod(Circle):
    def guard_scales(self):
        return 1.0, 1.0


class NegativeScale(Circle):
    guard_scales: ClassVar = (1.0, -1.0)


class WrongDirection(Circle):
    """It was taken for "falling" without a word."""

    guard_directions: ClassVar = ("falling", "sideways")


class NamesOfAMethod(Circle):
    def mode_names(self):
        return "above", "below"


def with_atol(atol):
    return ss.Integrator(step=ss.AdaptiveStep(1e-8, atol))


def run(system=None, t0=0.0, t1=1.0, y0=Y0, mode0=None, **kwargs):
    return ss.simulate(Circle() if system is None else system, t0, t1, y0, mode0, **kwargs)


@pytest.mark.parametrize(
    ("kwargs", "error", "words"),
    [
        (dict(t0=2.0, t1=1.0), ValueError, ["t1 = ", "1.0", "at least t0 = 2.0"]),
        (dict(t1=np.inf), ValueError, ["t1", "inf", "finite"]),
        (dict(t1="soon"), TypeError, ["t1", "soon", "real number"]),
        (dict(t1=jnp.zeros(2)), ValueError, ["t1", "(2,)", "one number"]),
        (dict(y0=State(np.nan, 0.0)), ValueError, ["y0.x", "nan", "finite"]),
        (dict(y0=State(1.0, 1j)), TypeError, ["y0.v", "1j", "real"]),
        (dict(y0=State(jnp.float32(1.0), 0.0)), ValueError, ["y0.x", "float32", "float64"]),
        (dict(mode0="sideways"), ValueError, ["mode0", "sideways", "above"]),
        (dict(mode0=7), ValueError, ["mode0", "7", "0 to 1"]),
        (dict(mode0=0.5), ValueError, ["mode0", "0.5", "integer"]),
        (dict(system=ThreeGuards()), ValueError, ["guards", "3 values", "2"]),
        (dict(system=VectorGuard()), ValueError, ["guards", "(2,)", "scalars"]),
        (dict(system=WrongSlope()), ValueError, ["vector_field", "structure", "y0"]),
        (dict(system=WrongScales()), ValueError, ["guard_scales", "2 entries"]),
        (dict(system=ScalesOfAMethod()), TypeError, ["guard_scales = ", "not a method"]),
        (dict(system=NegativeScale()), ValueError, ["guard_scales[1] = -1.0", "positive"]),
        (dict(system=WrongDirection()), ValueError, ["guard_directions[1] = 'sideways'", "'both'"]),
        (dict(system=NamesOfAMethod()), TypeError, ["mode_names = ", "not a method"]),
        (dict(system="a spring"), TypeError, ["system", "a spring", "AbstractHybridSystem"]),
        (dict(saveat=ss.SaveAt(ts=[0.5, 0.2])), ValueError, ["saveat.ts[1] = 0.2", "increase", "0.5"]),
        (dict(saveat=ss.SaveAt(ts=[0.5, 2.0])), ValueError, ["saveat.ts", "2.0", "[0.0, 1.0]"]),
        (dict(integrator=with_atol({"kg": 1e-9})), ValueError, ["atol = {'kg': 1e-09}", "'x'"]),
        (dict(integrator=with_atol([1e-9])), ValueError, ["atol = ", "structure of the state"]),
        (dict(integrator=with_atol(jnp.ones(2))), ValueError, ["atol = ", "(2,)", "one number"]),
        (dict(saveat=8), TypeError, ["saveat = 8", "a SaveAt"]),
        (dict(max_events=8), TypeError, ["unexpected keyword argument", "max_events"]),
    ],
)
def test_simulate(kwargs, error, words):
    with pytest.raises(error) as raised:
        run(**kwargs)
    for word in words:
        assert word in str(raised.value), (word, str(raised.value))


def test_sections_of_another_type():
    with pytest.raises(TypeError, match=r"sections = 'x': it must be a Section or a sequence of Sec"):
        ss.SaveAt(sections="x")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ss.FixedStep(0.0), ["h = 0", "positive"]),
        (lambda: ss.FixedStep(float("nan")), ["h = nan", "finite"]),
        (lambda: ss.AdaptiveStep(-1e-8, 1e-8), ["rtol", "positive"]),
        (lambda: ss.AdaptiveStep(1e-8, 0.0), ["atol", "positive"]),
        (lambda: ss.AdaptiveStep(1e-8, {"x": -1.0}), ["atol", "['x'] = -1.0", "positive"]),
        (lambda: ss.AdaptiveStep(1e-8, State(1e-9, 0.0)), ["atol.v = 0.0", "positive"]),
        (lambda: ss.AdaptiveStep(1e-8, []), ["atol = []", "None, a positive number"]),
        (lambda: ss.AdaptiveStep(1e-8, dtmax=0.1, dtmin=1.0), ["dtmax = 0.1", "dtmin = 1.0"]),
        (lambda: ss.WithBreaks(Circle(), [2.0, 1.0]), ["times", "[1] = 1.0", "decrease"]),
        (lambda: ss.WithBreaks(Circle(), 1.0), ["times = 1.0, of shape ()", "one row"]),
        (lambda: ss.AdaptiveStep(1e-8, 1e-8, dtmin=-1.0), ["dtmin", "-1"]),
        (lambda: ss.AdaptiveStep(1e-8, 1e-8, dtmax=0.0), ["dtmax", "positive"]),
        (lambda: ss.Integrator("euler's"), ["method", "euler's", "dop853"]),
        (lambda: ss.Integrator("rk4"), ["step = AdaptiveStep", "'rk4'", "error estimate", "FixedStep"]),
        (lambda: ss.Integrator(dfx.Euler()), ["step = AdaptiveStep", "Euler", "error estimate"]),
        (lambda: ss.Integrator(max_steps=0), ["max_steps = 0", "integer of at least 1"]),
        (lambda: ss.SaveAt(ts=[[0.5]]), ["ts = [[0.5]]", "(1, 1)", "a vector"]),
        (lambda: ss.SaveAt(max_events=-1), ["max_events = -1", "integer of at least 0"]),
        (lambda: ss.SaveAt(max_crossings=0), ["max_crossings = 0", "integer of at least 1"]),
        (lambda: ss.Section(lambda *a: 0.0, "up"), ["direction = 'up'", "rising"]),
        (lambda: ss.map_lanes(abs, executor="fast"), ["executor = 'fast'", "portable"]),
        (lambda: ss.map_lanes(abs, chunk_size=0), ["chunk_size = 0", "integer of at least 1"]),
        (
            lambda: ss.map_lanes(abs, executor="portable")(jnp.zeros((0,))),
            ["inputs", "(0,)", "one lane"],
        ),
        (lambda: ss.map_lanes(abs, executor="portable")({}), ["inputs = {}", "an array"]),
        (
            lambda: ss.map_lanes(abs, executor="portable")((jnp.zeros(2), jnp.zeros(3))),
            ["leading axes", "one length"],
        ),
    ],
)
def test_constructors(make, words):
    with pytest.raises(ValueError, match=words[0].split(" = ")[0]) as raised:
        make()
    for word in words:
        assert word in str(raised.value), (word, str(raised.value))


def test_interpolate_wants_steps():
    with pytest.raises(ValueError, match="SaveAt"):
        ss.interpolate(Pendulum(), run(Pendulum(), t1=0.0), [0.0])
