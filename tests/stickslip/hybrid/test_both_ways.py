"""Guards that fire both ways: once at each change of their sign, whatever the location leaves of it."""

from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import Motion


class Kicked(ss.AbstractHybridSystem):
    """A mass on a spring under a force; the speed is multiplied, and the place moved, at two marks."""

    stiffness: Any
    force: Any
    kick: Any
    reset: Any
    mark: Any

    mode_names: ClassVar = ("free",)
    guard_names: ClassVar = ("first", "second")
    guard_directions: ClassVar = ("both", "both")

    def vector_field(self, t, y, mode, args):
        return Motion(x=y.v, v=self.force - self.stiffness * y.x)

    def guards(self, t, y, mode, args):
        return y.x, y.x - self.mark

    def transition(self, t, y, mode, guard, args):
        reset = jnp.where(guard == 0, self.reset, 0.0)
        return Motion(x=y.x + reset, v=self.kick * y.v), mode

    def initial_mode(self, t, y, args):
        return 0


def marches(stiffness, force, kick, reset, mark, x, v, t1):
    """The same by closed forms, with the sign of each mark kept by hand."""
    w, centre, t, events = np.sqrt(stiffness), force / stiffness, 0.0, []
    marks, sides = np.array([0.0, mark]), np.sign([x, x - mark])
    while True:
        times = []
        for m, side in zip(marks, sides, strict=True):
            # x - centre = a cos(w s - phase) passes m - centre at the two arcs, for ever.
            a, phase = np.hypot(x - centre, v / w), np.arctan2(v / w, x - centre)
            if abs(m - centre) >= a:
                continue
            arc = np.arccos((m - centre) / a)
            # Falling at phase + arc, rising at phase - arc; from zero it goes on by its own slope.
            goes = -1.0 if side > 0 else 1.0
            first = (phase + (arc if goes < 0 else -arc)) % (2.0 * np.pi) / w
            times.append((first, m))
        after, m = min(times, default=(np.inf, 0.0))
        step = min(after, t1 - t)
        c, s = np.cos(w * step), np.sin(w * step)
        x, v = centre + (x - centre) * c + v / w * s, v * c - (x - centre) * w * s
        t += step
        if step < after:
            return x, v, events
        i = int(np.flatnonzero(marks == m)[0])
        events.append((t, i))
        goes = np.sign(v)
        x, v = m + (reset if i == 0 else 0.0), kick * v
        sides = np.sign(x - marks)
        sides[x == marks] = np.sign(kick) * goes


CASES = {
    "kicked on": dict(kick=1.1, reset=0.0, mark=-5.0),
    "thrown back": dict(kick=-0.9, reset=0.0, mark=-5.0),
    "set back to the side it comes from": dict(kick=1.0, reset=0.2, mark=-5.0),
    "set on to the side it goes to": dict(kick=1.0, reset=-0.2, mark=-5.0),
    "two marks": dict(kick=1.05, reset=0.0, mark=0.25),
    "thrown to and fro between marks": dict(kick=-1.0, reset=0.0, mark=0.4),
}


@pytest.mark.parametrize("case", CASES)
def test_a_mark_fires_once_each_time_it_is_passed(case):
    given = dict(stiffness=2.0, force=0.3, **CASES[case])
    x, v, events = marches(**given, x=0.5, v=0.1, t1=4.0)
    y0 = Motion(x=0.5, v=0.1)
    for tolerance in (1e-8, 1e-13):
        for rows in (41, 400):
            run = ss.simulate(
                Kicked(**given), 0.0, 4.0, y0, throw=False,
                integrator=ss.Integrator(step=ss.AdaptiveStep(tolerance)),
                saveat=ss.SaveAt(ts=jnp.linspace(0.0, 4.0, rows), events=True, max_events=40),
            )  # fmt: skip
            n = int(run.num_events)
            found = np.asarray(run.events.t)[:n]
            assert list(np.asarray(run.events.guard)[:n]) == [i for _, i in events], (tolerance, rows)
            close = 1e3 * tolerance + 1e-11
            np.testing.assert_allclose(found, [t for t, _ in events], rtol=0.0, atol=close)
            np.testing.assert_allclose([run.y1.x, run.y1.v], [x, v], rtol=0.0, atol=close)
            assert int(run.flags) == 0


class Level(NamedTuple):
    x: Any


class Relay(ss.AbstractHybridSystem):
    """A level that is driven up below a set point and down above; the set point steps at `step`."""

    step: Any

    mode_names: ClassVar = ("up", "down")
    guard_names: ClassVar = ("never", "crosses the set point")
    guard_directions: ClassVar = ("falling", "both")

    def vector_field(self, t, y, mode, args):
        return Level(jnp.where(mode == 0, 1.0, -1.0))

    def guards(self, t, y, mode, args):
        return 1.0, jnp.where(t < self.step, 2.0, 0.5) - y.x

    def transition(self, t, y, mode, guard, args):
        return y, 1 - mode

    def initial_mode(self, t, y, args):
        return 0


@pytest.mark.parametrize("how", ["once", pytest.param("periodic", marks=pytest.mark.more)])
def test_a_declared_jump_through_zero_fires(how):
    def end(step):
        relay = Relay(step)
        if how == "once":
            machine = ss.WithBreaks(relay, jnp.stack([step]))
            y0 = machine.start(Level(0.0))
        else:
            machine = ss.WithPeriodicBreaks(relay, jnp.stack([step]), 100.0)
            y0 = Level(0.0)
        run = ss.simulate(machine, 0.0, 1.3, y0, "up" if how == "once" else None, throw=False)
        return jax.tree.leaves(run.y1)[0], run

    (x, run), slope = jax.value_and_grad(end, has_aux=True)(1.0)
    # It turns at the step, not at the set point of 2 or of 0.5.
    assert float(x) == pytest.approx(0.7, abs=1e-12)
    assert float(slope) == pytest.approx(2.0, abs=1e-12)
    assert int(run.num_events) == 1
    assert int(run.flags) == 0
