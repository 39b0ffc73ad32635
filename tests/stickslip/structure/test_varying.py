"""Bounds that follow time and place, lift-off, and sliders on mechanisms with contacts of their own."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.structure import HarmonicForce, Jenkins, LinearStructure, WithSliders

STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))
K_T = 2.0


class Pressed(eqx.Module):
    """The bound of a slider that the second mass presses on, with parameters."""

    preload: Any
    slope: Any

    def __call__(self, t, q, args):
        return self.preload + self.slope * q[1]


def machine(preload, slope):
    """Two masses, the second one the load on the slider of the first."""

    def load(t, q, v, args):
        return jnp.stack([jnp.cos(1.3 * t), 0.8 * jnp.sin(2.1 * t)])

    structure = LinearStructure(np.eye(2), 0.1 * np.eye(2), np.diag([1.0, 3.0]), load)
    return WithSliders(structure, {"damper": Jenkins([1.0, 0.0], K_T, Pressed(preload, slope))})


def reference(preload, slope, until):
    """The same by SciPy from event to event."""

    def bound(y):
        return preload + slope * y[1]

    def rate(y):
        return slope * y[3]

    def springs(y, state):
        return K_T * (y[0] - y[4]) if state == 0 else (0.0 if state == 2 else state * bound(y))

    def field(t, y, state):
        f = springs(y, state)
        moves = 0.0 if state == 0 else y[2] - (0.0 if state == 2 else state * rate(y) / K_T)
        push = np.cos(1.3 * t) - y[0] - 0.1 * y[2] - f
        return [y[2], y[3], push, 0.8 * np.sin(2.1 * t) - 3.0 * y[1] - 0.1 * y[3], moves]

    def guards(state):
        if state == 0:
            return [lambda t, y, s: bound(y) - K_T * (y[0] - y[4]),
                    lambda t, y, s: bound(y) + K_T * (y[0] - y[4])]  # fmt: skip
        if state == 2:
            return [lambda t, y, s: -bound(y)]
        return [lambda t, y, s: K_T * s * y[2] - rate(y), lambda t, y, s: bound(y)]

    t, y, state, words = 0.0, np.zeros(5), 0 if preload > 0.0 else 2, []
    while True:
        events = guards(state)
        for event in events:
            event.terminal, event.direction = True, -1.0
        run = solve_ivp(field, (t, until), y, "DOP853", events=events, args=(state,), rtol=1e-13,
                        atol=1e-14, max_step=0.05)  # fmt: skip
        t, y = run.t[-1], run.y[:, -1].copy()
        if run.status == 0:
            return y, words
        which = next(i for i, found in enumerate(run.t_events) if len(found))
        if state == 0:
            state = 1 if which == 0 else -1
        elif state == 2:
            y[4] = y[0]
            state = int(np.sign(y[2])) if K_T * abs(y[2]) > rate(y) else 0
        else:
            y[4] = y[0] - (state * bound(y) / K_T if which == 0 else 0.0)
            state = 0 if which == 0 else 2
        words.append({0: "stick", 1: "slip forward", -1: "slip backward", 2: "open"}[state])


@pytest.mark.more
@pytest.mark.parametrize("preload", [0.15, -0.1], ids=["pressed", "gap"])
def test_a_load_that_varies_and_lifts_off_is_followed_from_event_to_event(preload):
    until = 30.0
    right, words = reference(preload, 0.5, until)
    assert {"open", "stick", "slip forward", "slip backward"} == set(words)
    system = machine(preload, 0.5)
    begin = system.start(system.system.state())
    ledger = WithIntegrals(system, WithSliders.powers)
    run = ss.simulate(ledger, 0.0, until, ledger.start(begin), integrator=STRICT)
    assert [system.mode_names[int(m)] for m in run.events.mode_after[: len(words)]] == words
    assert int(run.flags) == 0
    end = run.y1.y
    np.testing.assert_allclose([*end.y.q, *end.y.v, *end.z], right, atol=1e-9)
    gain = system.energy(end) - system.energy(begin)
    assert float(sum(run.y1.integrals.values())) == pytest.approx(float(gain), abs=1e-9)
    assert float(run.y1.integrals["friction of damper"]) < -0.1


@pytest.mark.more
def test_derivatives_by_the_load_of_a_slider():
    def end(p):
        system = machine(p[0], p[1])
        begin = system.start(system.system.state())
        run = ss.simulate(system, 0.0, 12.0, begin, integrator=STRICT)
        return jnp.concatenate([run.y1.y.q, run.y1.z]), run.flags

    at, h = jnp.array([0.15, 0.5]), 1e-5
    slope, flags = jax.jacfwd(end, has_aux=True)(at)
    ends = jax.vmap(lambda s: end(at + s)[0])(h * jnp.concatenate([jnp.eye(2), -jnp.eye(2)]))
    assert int(flags) == 0
    np.testing.assert_allclose(slope, (ends[:2] - ends[2:]).T / (2 * h), atol=2e-7)


class Block(AbstractMechanism):
    """A mass on a rough floor and one that swings; `held` is the friction of the floor."""

    held: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"floor": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": 0.2 * t, "y": 1.5 * jnp.cos(2.1 * t) - 3.0 * q.y}

    def contacts(self, t, q, v, args):
        return {"floor": Contact(Coulomb(self.held))}

    def potential_energy(self, q):
        return 1.5 * q.y**2

    def time_scale(self, args):
        return 1 / 2.1


@pytest.mark.more
def test_a_contact_bears_the_force_of_a_slider_and_gives_way_to_it():
    # Preloaded by 0.3 N in the sense of the ramp: 0.2 t + 0.3 = 0.5 at one second.
    system = WithSliders(Block(0.5), {"spring": Jenkins({"x": 1.0}, K_T, 0.4)})
    begin = system.start(system.system.state(), [0.15])
    run = ss.simulate(system, 0.0, 6.0, begin, integrator=STRICT)
    assert float(run.events.t[0]) == pytest.approx(1.0, abs=1e-12)
    names = [system.mode_names[int(m)] for m in run.events.mode_after[:2]]
    assert names == ["slip forward / stick", "slip forward / slip forward"]
    # x'' = 0.2 (t - 1) - 2 x until the spring is at 0.4 N the other way, x = 0.35.
    s = float(run.events.t[1]) - 1.0
    w = np.sqrt(K_T)
    assert 0.1 * (s - np.sin(w * s) / w) == pytest.approx(0.35, abs=1e-11)
    # Then x'' = 0.2 t - 0.5 - 0.4.
    v, t = 0.1 * (1 - np.cos(w * s)), 5.0 - s
    a = 0.2 * (1.0 + s) - 0.9
    assert float(run.y1.y.x) == pytest.approx(0.35 + v * t + a * t**2 / 2 + 0.2 * t**3 / 6, abs=1e-10)
    words = system.slider_states(run.events.mode_after)["spring"]
    assert words[1] == "slip forward"
    assert words[-1] == ""


@pytest.mark.more
def test_sliders_on_a_mechanism_keep_its_account_of_the_energy():
    elements = {
        "curved": Jenkins(lambda q: q.x + 0.3 * jnp.sin(q.y), 1.5, 0.15),
        "between": Jenkins({"x": 1.0, "y": -0.5}, [0.5, 0.7, 0.2], [0.05, 0.1, 0.08]),
    }
    system = WithSliders(Block(0.1), elements)
    begin = system.start(system.system.state(y=0.3))
    ledger = WithIntegrals(system, WithSliders.powers)
    run = ss.simulate(ledger, 0.0, 12.0, ledger.start(begin), integrator=STRICT)
    assert bool(run.successful)
    work, end = run.y1.integrals, run.y1.y
    assert set(work) == {"forces", "friction of floor", "friction of curved", "friction of between"}
    gain = float(system.energy(end) - system.energy(begin))
    assert float(sum(work.values())) == pytest.approx(gain, abs=1e-9)
    assert all(float(work[f"friction of {name}"]) < -1e-2 for name in ("floor", *elements))
    # Each slider is the play of its elongation, through all its turns.
    e = float(end.y.x - 0.5 * end.y.y)
    d = np.asarray(elements["between"].bound / elements["between"].stiffness)
    assert np.all(np.abs(e - np.asarray(end.z[1:])) <= d * (1 + 1e-9))


@pytest.mark.more
def test_a_mechanism_and_a_structure_of_the_same_numbers_move_alike():
    class Pair(AbstractMechanism):
        coordinates: ClassVar = {"x": "m", "y": "m"}
        contact_directions: ClassVar = {}

        def mass_matrix(self, q):
            return [[2.0, 0.3], [0.3, 1.0]]

        def forces(self, t, q, v, args):
            pull = 0.7 * jnp.cos(1.1 * t)
            return [pull - 2.0 * q.x + q.y - 0.1 * v.x, q.x - q.y - 0.1 * v.y]

        def time_scale(self, args):
            return 1 / 1.1

    element = {"damper": Jenkins([1.0, -1.0], 0.8, 0.1)}
    structure = LinearStructure(
        [[2.0, 0.3], [0.3, 1.0]], 0.1 * np.eye(2), [[2.0, -1.0], [-1.0, 1.0]],
        HarmonicForce([0.7, 0.0], 1.1),
    )  # fmt: skip
    one, other = WithSliders(Pair(), element), WithSliders(structure, element)
    runs = [
        ss.simulate(s, 0.0, 30.0, s.start(s.system.state()), integrator=STRICT) for s in (one, other)
    ]
    assert int(runs[0].num_events) == int(runs[1].num_events) > 4
    y = runs[0].y1.y
    np.testing.assert_allclose([y.x, y.y], runs[1].y1.y.q, atol=1e-11)
    np.testing.assert_allclose(runs[0].y1.z, runs[1].y1.z, atol=1e-11)
