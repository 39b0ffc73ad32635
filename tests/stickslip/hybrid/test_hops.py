"""A mass that bounces, goes through the stop and comes back within one step: no such hop is missed.

The stops are affine in the state, so that their guards are only as well known as the motion itself is
between the ends of a step; the reference is the closed form of the free motion.
"""

import functools

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from stickslip.hybrid._tableau import DOP853, TSIT5, from_diffrax
from stickslip.hybrid._within import weights_within
from stickslip.hybrid.accuracy import ACCURACY
from stickslip.hybrid.executor import COMPACT
from stickslip.hybrid.stepper import ExplicitRungeKutta
from stickslip.systems import Motion, OscillatorBetweenStops

END = 15.0
# Hops of 0.1 to 0.3 s under a force of a period of 1 to 7 s; found by random search, all were missed.
CHOSEN = [
    (0.8898062995, 0.4935437709, -0.4065169700, 0.4433854309, 0.4107586054, 0.0839664425, 2.3396155164,
     1.1929405640, -0.0277879149, -0.3275190685),
    (0.5558400199, 1.9936402522, -0.7206543048, 0.9607307453, 0.4621846635, 0.1504899395, 2.8737085350,
     0.9578921940, 0.0272536483, 0.0405529488),
    (1.0719208058, 0.1606227203, -0.3464940693, 0.1009981670, 0.2736117287, 0.0569946137, 1.3854396185,
     6.0564758046, -0.0150448723, 0.5090036340),
    (2.6843039807, 0.1148246932, -0.3404529648, 0.6812593536, 0.5653603551, 0.2188454979, 2.7978991317,
     1.6203249630, -0.0035695443, -0.6790655867),
]  # fmt: skip
REST_SPEED = 1e-3


def random_machines(number, seed):
    rng = np.random.default_rng(seed)
    low = [0.3, 0.1, -1.0, 0.05, 0.1, 1e-3, 0.0, 0.2, -0.04, -1.0]
    high = [3.0, 10.0, -0.05, 1.0, 0.8, 1.0, 3.0, 10.0, 0.04, 1.0]
    return rng.uniform(low, high, (number, 10))


def by_closed_form(m, k, lower, upper, e, c, force, omega, x, v):
    """End and number of events of a march from event to event along the closed form."""
    forced = force / (k - m * omega**2 + 1j * c * omega)
    roots = np.roots([m, c, k]).astype(complex)

    def free(t0, x0, v0):
        x0 = x0 - (forced * np.exp(1j * omega * t0)).real
        v0 = v0 - (1j * omega * forced * np.exp(1j * omega * t0)).real
        a, b = np.linalg.solve([[1, 1], roots], [x0, v0])

        def at(t):
            s, drive = t - t0, forced * np.exp(1j * omega * t)
            e0, e1 = np.exp(roots[0] * s), np.exp(roots[1] * s)
            place = (a * e0 + b * e1 + drive).real
            return place, (a * roots[0] * e0 + b * roots[1] * e1 + 1j * omega * drive).real

        return at

    t, stop, events = 0.0, 0.0, 0
    while True:
        grid = np.concatenate([t + np.arange(1, 4000) * 1e-4, np.arange(t + 0.4, END, 1e-3), [END]])
        if stop:
            place = upper if stop > 0 else lower

            def pressed(t, place=place, stop=stop):
                return stop * (force * np.cos(omega * t) - k * place)

            gone = np.flatnonzero(pressed(grid) < 0)
            if not gone.size or grid[gone[0]] >= END:
                return place, events
            i = gone[0]
            t = brentq(pressed, grid[i - 1] if i else t, grid[i], xtol=1e-13)
            x, v, stop, events = place, 0.0, 0.0, events + 1
            continue
        at = free(t, x, v)

        def room(t, at=at):
            return np.minimum(at(t)[0] - lower, upper - at(t)[0])

        gone = np.flatnonzero(room(grid) < 0)
        if not gone.size or grid[gone[0]] >= END:
            return at(END)[0], events
        i = gone[0]
        t = brentq(room, grid[i - 1], grid[i], xtol=1e-13)
        place, speed = at(t)
        side = 1.0 if place > 0.5 * (lower + upper) else -1.0
        x, v, events = upper if side > 0 else lower, -e * speed, events + 1
        if abs(v) <= REST_SPEED and side * (force * np.cos(omega * t) - k * x) > 0:
            stop, v = side, 0.0


@functools.cache
def machines_and_truth():
    machines = np.concatenate([CHOSEN, random_machines(40, seed=5)])
    return machines, np.array([by_closed_form(*p) for p in machines])


@pytest.mark.more
@pytest.mark.parametrize("method", ["dop853", "tsit5", diffrax.Dopri8()], ids=str)
def test_no_hop_is_missed(method):
    @jax.jit
    @functools.partial(jax.vmap, in_axes=(0, None))
    def run(p, rtol):
        m, k, lower, upper, e, c, force, omega, x, v = p
        stops = OscillatorBetweenStops(
            m, k, lower=lower, upper=upper, restitution=e, damping=c, rest_speed=REST_SPEED,
            force_amplitude=force, force_frequency=omega,
        )  # fmt: skip
        integrator = ss.Integrator(method=method, step=ss.AdaptiveStep(rtol))
        out = ss.simulate(
            stops,
            0.0,
            END,
            Motion(x, v),
            integrator=integrator,
            saveat=ss.SaveAt(max_events=512),
            throw=False,
        )
        return out.y1.x, out.num_events, out.flags

    machines, exact = machines_and_truth()
    for rtol in (1e-7, 1e-9, 1e-11):
        x, events, flags = map(np.asarray, run(jnp.asarray(machines), rtol))
        right = (events == exact[:, 1]) & (np.abs(x - exact[:, 0]) < 1e6 * rtol)
        assert np.all(right | (flags != 0)), (rtol, np.flatnonzero(~right & (flags == 0)))
        if rtol < 1e-8:
            assert np.all(events == exact[:, 1])


@pytest.mark.parametrize("tableau", [DOP853, TSIT5, from_diffrax(diffrax.Dopri8())], ids=str)
def test_states_inside_a_step_have_a_higher_order_than_the_cubic(tableau):
    """On x' = x cos t, whose solution is exp(sin t): errors fall with the fifth power or better."""
    stepper, t0, errors = ExplicitRungeKutta(tableau), 0.3, []
    y0 = jnp.exp(jnp.sin(t0))
    points = ACCURACY.points_inside
    for h in (0.4, 0.2):
        step = stepper.step_and_look(
            lambda t, y: jnp.cos(t) * y, t0, y0, jnp.cos(t0) * y0, h, COMPACT, points, (True,), False
        )
        exact = np.exp(np.sin(t0 + h * np.array(points)))
        errors.append(np.abs(np.asarray(step.states) - exact).max())
    assert np.log2(errors[0] / errors[1]) > 4.5
    assert weights_within(tableau, ACCURACY.points_inside)
