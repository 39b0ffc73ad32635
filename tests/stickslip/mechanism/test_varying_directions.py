"""Contacts whose directions depend on the coordinates: rest that gives way, in random runs."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact


class Curved(AbstractMechanism):
    """A point mass that rubs on parallel curves and on a straight guide, both moving if asked."""

    p: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"curve": None, "guide": {"y": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.5}

    def forces(self, t, q, v, args):
        push = self.p[1] * jnp.sin(self.p[2] * t)
        return {"x": push - self.p[0] * q.x, "y": 0.7 * jnp.cos(1.3 * t) - 2.0 * q.y}

    def time_scale(self, args):
        return 1.0 / jnp.maximum(self.p[2], 1.3)

    def contacts(self, t, q, v, args):
        slope = self.p[3] * q.x
        n = 1.0 / jnp.sqrt(1.0 + slope * slope)
        surface = self.p[4] * jnp.sin(0.9 * t)
        return {
            "curve": Contact(Coulomb(0.5, 0.4), 1.0, direction={"x": n, "y": slope * n}),
            "guide": Contact(Coulomb(0.3, 0.2), 1.0, surface),
        }


@pytest.mark.slow
@pytest.mark.parametrize("number", [40, 1000])
def test_random_runs_are_those_of_fine_steps_without_flags(number):
    """What gave way used to be stopped again at once by the drift of its rest, one run in six."""
    p = np.random.default_rng(0).uniform(
        [0.5, 0.5, 0.6, 0.3, 0.0], [2.0, 2.5, 2.0, 1.2, 0.3], (number, 5)
    )
    p[::2, 4] = 0.0

    def run(p, rtol, longest):
        machine = Curved(p)
        begin = machine.state(x=0.3, y=-0.2)
        found = ss.simulate(
            machine, 0.0, 20.0, begin, throw=False, saveat=ss.SaveAt(max_events=400),
            integrator=ss.Integrator(step=ss.AdaptiveStep(rtol, dtmax=longest), max_steps=200_000),
        )  # fmt: skip
        return jnp.stack([found.y1.x, found.y1.y]), found.num_events, found.flags, found.successful

    lanes = jax.jit(jax.vmap(run))
    plain = lanes(p, np.full(number, 1e-10), np.full(number, 0.2))
    fine = lanes(p, np.full(number, 1e-12), np.full(number, 2e-3))
    assert np.all(plain[3])
    assert np.all(fine[3])
    told = (np.asarray(plain[2]) != 0) | (np.asarray(fine[2]) != 0)
    off = np.max(np.abs(plain[0] - fine[0]), axis=1) > 1e-7
    off |= np.asarray(plain[1] != fine[1])
    assert not np.any(off & ~told)
    assert np.mean(told) <= 0.005
    assert np.min(fine[1]) >= 4


@pytest.mark.more
def test_a_contact_that_gives_way_as_another_passes_its_zero():
    """The drift of its rest was against the sense in which it gave way, and stopped it: chattering."""
    machine = Curved(np.array([1.10682776, 0.89702609, 0.72705426, 0.82229915, 0.0]))
    found = ss.simulate(
        machine, 0.0, 2.0, machine.state(x=0.3, y=-0.2), throw=False,
        integrator=ss.Integrator(step=ss.AdaptiveStep(1e-10, dtmax=0.2)),
    )  # fmt: skip
    assert found.successful


class Tilting(AbstractMechanism):
    """Two masses under a force that friction holds along a curve, which is level at the start."""

    force: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"curve": None}

    def mass_matrix(self, q):
        return (2.215, 0.886)

    def forces(self, t, q, v, args):
        return (self.force * jnp.cos(t) - 0.473 * v.x, -0.275 * v.y)

    def contacts(self, t, q, v, args):
        return {"curve": Contact(Coulomb(1.0), direction={"x": 1.0, "y": jnp.tanh(q.x)})}


@pytest.mark.more
@pytest.mark.parametrize("force", [1.0, 0.77])
def test_what_friction_holds_does_not_move_by_rounding(force):
    """Accelerations of the rounding of the forces were the whole motion, and steps of 1e-11 s their
    error."""
    machine = Tilting(force)
    run = ss.simulate(machine, 0.0, 1.0, machine.state())
    assert run.successful
    assert not any(run.y1)


class Wedge(AbstractMechanism):
    """A body between a fixed guide and a wedge whose direction turns with a third coordinate."""

    coordinates: ClassVar = {"x": "m", "y": "m", "z": "m"}
    contact_directions: ClassVar = {"wedge": None, "guide": {"z": 1.0}}

    def mass_matrix(self, q):
        return [[1.0, 0.209, 0.209], [0.209, 1.0, 0.0], [0.209, 0.0, 1.991]]

    def forces(self, t, q, v, args):
        x = -6.827 * q.x - 0.2 * v.x - 1.359 * (q.x - q.y)
        return {"x": x, "y": -1.359 * (q.y - q.x) - 0.05 * v.y, "z": -5.09 * q.z - 0.321 * v.z}

    def contacts(self, t, q, v, args):
        wedge = {"x": jnp.cos(q.y), "z": 1.0}
        law = Stribeck(1.476, 0.861, 0.056)
        return {
            "wedge": Contact(law, 1.883, surface_speed=args * jnp.sin(t), direction=wedge),
            "guide": Contact(Coulomb(1.0, 0.308)),
        }


@pytest.mark.parametrize("drift", [1e-11, -1e-11])
def test_a_contact_that_passes_its_zero_beside_one_at_rest(drift):
    """As the one at rest, which had drifted, was landed, the other was sent back: chattering."""
    machine, passed, args = Wedge(), -1e-13, jnp.zeros(())
    v_x = (drift - passed) / np.cos(0.3)
    y = machine.state(x=0.1, y=0.3, z=0.6, v_x=v_x, v_y=0.5, v_z=passed)
    mode = machine.mode_names.index("stick / slip forward")
    after, mode = machine.transition(0.5, y, jnp.int32(mode), 1, args)
    assert machine.mode_names[int(mode)] == "stick / slip backward"
    assert min(machine.guards(0.5, after, mode, args)) > 0.0


class Slope(AbstractMechanism):
    """A body on a pad whose direction has two entries of equal size where `y` is zero."""

    pull: Any
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"pad": None}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x, "y": self.pull - q.y}

    def contacts(self, t, q, v, args):
        return {"pad": Contact(Coulomb(0.3), direction={"x": 1.0, "y": jnp.cos(q.y)})}


@pytest.mark.more
def test_a_start_where_two_entries_of_a_direction_are_equal():
    """Which of them is the larger was taken for a bend of the force, met anew at every step."""
    starts = np.array([[-0.525, 0.0, 0.0], [0.5, 0.0, 0.5], [-0.2, 0.0, 2.0], [0.0, 0.5, 0.0]])

    def run(v_x, v_y, pull):
        machine = Slope(pull)
        few = ss.Integrator(max_steps=2000)
        begin = machine.state(v_x=v_x, v_y=v_y)
        end = ss.simulate(machine, 0.0, 0.3, begin, integrator=few, throw=False)
        return jnp.stack([end.y1.x, end.y1.y]), end.flags, end.successful

    def truth(v_x, v_y, pull):
        def rates(t, y):
            lever = np.cos(y[1])
            friction = -0.3 * np.sign(y[2] + lever * y[3])
            return [y[2], y[3], friction - y[0], pull - y[1] + lever * friction]

        begin = [0.0, 0.0, v_x, v_y]
        return solve_ivp(rates, (0.0, 0.3), begin, "DOP853", rtol=1e-11, atol=1e-12).y[:2, -1]

    ends, flags, successful = jax.jit(jax.vmap(run))(*starts.T)
    assert bool(np.all(successful))
    assert not np.any(flags)
    np.testing.assert_allclose(ends, [truth(*start) for start in starts], atol=1e-10)
