"""A stop or surface that moves beside others on one velocity: what rests on one slides on the rest."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip._validation import DeclarationError
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from tests.attack._reference import March
from tests.attack._structure import Numbers, Parameter, Program, Structure, Touch, Wall

RANGES = {
    "m": (0.8, 2.5), "k": (0.5, 12.0), "drive": (0.3, 3.0), "w": (0.5, 6.0), "load": (-1.5, 1.5),
    "mu": (0.15, 1.2), "mk": (0.15, 1.2), "n": (0.3, 2.0), "g": (0.15, 0.5), "a": (0.02, 0.3),
    "w2": (0.5, 6.0), "e": (0.1, 0.9), "r": (0.01, 0.06), "b": (-1.0, 1.0), "lever": (-2.0, -0.5),
}  # fmt: skip
START, END, COUNT = {"x": 0.0, "v_x": 0.0}, 5.0, 16
# On rough ground and, about a lever, on a shaken belt; a shaken wall bumps into it and carries it.
SHAKEN = Structure(
    coordinates={"x": "m"},
    mass={("x", "x"): "m"},
    forces=(("x", "-k * x"), ("x", "drive * sin(w * t)"), ("x", "load")),
    contacts=(
        Touch("ground", {"x": "1.0"}, True, "Coulomb(mu, mk)", "n"),
        Touch("belt", {"x": "lever"}, False, "Coulomb(0.3)", None, "b * cos(3.0 * t)"),
    ),
    stops=(Wall("wall", "g - x + a * sin(w2 * t + 0.5)", "e", "r"),),
    parameters={name: Parameter((0, 0, 0), *limits) for name, limits in RANGES.items()},
)


@pytest.fixture(scope="module")
def shaken():
    """End states of many sets of numbers, as a function of them; and the numbers `[lane, number]`."""
    rng, program = np.random.default_rng(1), Program(SHAKEN)
    low, high = np.array(list(RANGES.values())).T
    numbers = jnp.asarray(rng.uniform(low, high, (COUNT, len(low))))

    def run(x):
        values = dict(zip(RANGES, x, strict=True))
        found = program.solution(Numbers(values, START, END), jnp.linspace(0.0, END, 5))
        return jnp.stack(found.outputs.y, -1), (found.flags, found.sequence, found.successful)

    return jax.jit(jax.vmap(run)), numbers


@pytest.mark.more
def test_a_shaken_wall_beside_ground_and_belt_as_event_by_event(shaken):
    run, numbers = shaken
    y, (flags, _, successful) = run(numbers)
    assert bool(successful.all())
    assert int((flags == 0).sum()) >= COUNT - 2
    for x, found in zip(np.asarray(numbers), np.asarray(y), strict=True):
        values = dict(zip(RANGES, x.tolist(), strict=True))
        march = March(SHAKEN, Numbers(values, START, END))
        truth, end = march.run(np.linspace(0.0, END, 5))
        assert end == END
        np.testing.assert_allclose(found, truth, atol=1e-8)


@pytest.mark.slow
def test_derivatives_beside_a_shaken_wall_as_central_differences(shaken):
    run, numbers = shaken
    h, away = 1e-6, jnp.asarray(np.random.default_rng(2).normal(size=numbers.shape)) * numbers
    slope = jax.jit(lambda x, d: jax.jvp(lambda x: run(x)[0][:, -1], (x,), (d,))[1])(numbers, away)
    (ahead, said), (behind, also) = run(numbers + h * away), run(numbers - h * away)
    same = (said[0] == 0) & (also[0] == 0) & (said[1] == also[1])
    assert int(same.sum()) >= COUNT - 4
    differences = (ahead - behind)[:, -1] / (2 * h)
    np.testing.assert_allclose(slope[same], differences[same], rtol=1e-5, atol=1e-6)


class Cam(AbstractMechanism):
    """1 kg in a rough guide on a cam that rises from 1 to 2 s and falls from 3 to 4 s."""

    weight: Any
    static: Any
    kinetic: Any
    pull: Any = 0.0  # force upwards that grows from 2 to 3 s
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"guide": {"x": 1}}
    stops: ClassVar = ("cam",)

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": -self.weight + self.pull * jnp.clip(t - 2.0, 0.0, 1.0)}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(Coulomb(self.static, self.kinetic))}

    def gaps(self, t, q, args):
        def part(s):
            s = jnp.clip(s, 0.0, 1.0)
            return s - jnp.sin(2.0 * jnp.pi * s) / (2.0 * jnp.pi)

        return {"cam": Stop(q.x - 0.05 * (part(t - 1.0) - part(t - 3.0)), 0.0, 0.01)}

    def time_scale(self, args):
        return 0.1


@pytest.mark.more
def test_a_cam_that_comes_to_a_stand_and_moves_on():
    """At a stand ground and cam share the load, and static friction decides again."""
    # Weight, static and kinetic friction [N], pull [N/s]; whether it goes down with the cam.
    held = (0.5, 0.8, 0.3)
    cases = np.array([(*held, 0.0), (*held, 1.2), (*held, 1.4), (1.0, 0.2, 0.1, 0.0)])

    def run(case):
        machine = Cam(*case)
        ts = jnp.array([0.5, 1.5, 2.5, 3.5, 5.0])
        found = ss.simulate(machine, 0.0, 5.0, machine.state(), saveat=ss.SaveAt(ts=ts), throw=False)
        return found.outputs.y.x, found.successful, found.num_events

    x, successful, events = jax.jit(jax.vmap(run))(jnp.asarray(cases))
    assert bool(successful.all())
    # Off with the cam and to a stand on it, and nothing else: no stop a little later, by rounding.
    np.testing.assert_array_equal(events, [2, 2, 3, 6])
    np.testing.assert_allclose(x[:, :3], np.tile([0.0, 0.025, 0.05], (4, 1)), atol=1e-10)
    np.testing.assert_allclose(x[:2, 3:], 0.05, atol=1e-10)  # friction holds it where the cam left it
    # Pulled off at 1.3 N; then the force left is 1.4 s - 0.8 N, and 0.6 N from 3 s.
    t = 1.3 / 1.4
    v3 = 0.7 * (1.0 - t**2) - 0.8 * (1.0 - t)
    x3 = 1.4 / 6.0 * (1.0 - t**3) - 0.4 * (1.0 - t**2) - (0.7 * t**2 - 0.8 * t) * (1.0 - t)
    truth = [0.05 + x3 + v3 * s + 0.3 * s**2 for s in (0.5, 2.0)]
    np.testing.assert_allclose(x[2, 3:], truth, atol=1e-8)
    np.testing.assert_allclose(x[3, 3:], [0.025, 0.0], atol=1e-10)  # the weight follows the cam


class Press(AbstractMechanism):
    """1 kg pressed on a bed; a die comes down from 1 m, or a lift comes up from 1 m below the bed."""

    speeds: Any  # of the die and of the lift
    coordinates: ClassVar = {"x": "m"}
    stops: ClassVar = ("bed", "die", "lift")

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": -1.0}

    def gaps(self, t, q, args):
        die, lift = 1.0 - self.speeds[0] * t, self.speeds[1] * t - 1.0
        return {"bed": Stop(q.x, 0.5), "die": Stop(die - q.x, 0.5), "lift": Stop(q.x - lift, 0.5)}


def test_an_impact_into_a_closed_stop_ends_a_run_and_one_off_it_does_not():
    @jax.jit
    @jax.vmap
    def run(speeds):
        machine = Press(speeds)
        found = ss.simulate(machine, 0.0, 1.5, machine.state(), throw=False)
        return found.t1, found.y1.x, found.result

    t1, x, result = run(jnp.eye(2))
    np.testing.assert_array_equal(result == ss.RESULTS.no_admissible_mode, [True, False])
    np.testing.assert_array_equal(result == ss.RESULTS.successful, [False, True])
    np.testing.assert_allclose(t1, [1.0, 1.5], rtol=1e-12)
    # The lift of 1 m/s throws the body up at 1.5 m/s.
    np.testing.assert_allclose(x, [0.0, 1.5 * 0.5 - 0.5**3], atol=1e-12)


def test_what_cannot_move_is_refused_with_what_it_depends_on():
    class Shelf(Cam):
        coordinates: ClassVar = {"x": "m", "y": "m"}
        contact_directions: ClassVar = {"guide": {"x": 1}, "rail": {"y": 1}}

        def mass_matrix(self, q):
            return (1.0, 1.0)

        def contacts(self, t, q, v, args):
            return {name: Contact(Coulomb(0.5)) for name in ("guide", "rail")}

        def gaps(self, t, q, args):
            return {"cam": Stop(q.x - q.y + jnp.sin(t), 0.5)}

    shelf = Shelf(1.0, 0.5, 0.5)
    with pytest.raises(DeclarationError, match=r"'cam': .* of constant speed beside guide, rail"):
        ss.simulate(shelf, 0.0, 1.0, shelf.state())
