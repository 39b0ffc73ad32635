"""What a declaration says of the start is read without a program: counted from JAX's own events."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.mechanism._known import numbers_known
from stickslip.systems import (
    BouncingBall,
    CoulombOscillator,
    Motion,
    OscillatorBetweenStops,
    PairMotion,
    TwoBlocksOnBelt,
)
from tests.stickslip.mechanism._stopped import Guided
from tests.stickslip.systems._systems import PAIR


class Pressed(AbstractMechanism):
    """A block with a load that depends on everything, and an inertia that is computed."""

    mass: Any
    gravity: Any
    lift: Any
    curved: bool = False

    coordinates: ClassVar = {"x": "m", "phi": "rad"}
    contact_directions: ClassVar = {"floor": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": self.mass, "phi": self.mass * (2.0 + jnp.cos(q.phi)) ** 2}

    def forces(self, t, q, v, args):
        return {"x": -q.x}

    def contacts(self, t, q, v, args):
        load = self.mass * self.gravity - self.lift * jnp.where(q.x > 0.0, q.x**3, -v.phi) + t
        if self.curved:
            load = load + 0.0 * jnp.sum(jnp.stack([q.x, q.phi]))
        return {"floor": Contact(Coulomb(0.4, 0.3), load)}


def loads(machine, y):
    return [c.normal_force for c in machine.instant(0.5, y, None).contacts]


@pytest.mark.parametrize("x", [2.0, -1.0])
def test_arithmetic_is_done_without_a_program(x, compiled):
    machine = Pressed(1.5, 9.81, 0.7)
    y = machine.state(x=x, v_phi=0.3)
    compiled.clear()
    (found,) = numbers_known(loads, machine, y)
    assert not compiled
    expected = 1.5 * 9.81 - 0.7 * (8.0 if x > 0 else -0.3) + 0.5
    np.testing.assert_allclose(found, expected, rtol=1e-15)


def test_more_than_arithmetic_is_left_alone():
    machine = Pressed(1.5, 9.81, 0.7, curved=True)
    assert numbers_known(loads, machine, machine.state()) is None


@pytest.mark.parametrize("curved", [False, True])
def test_a_load_that_pulls_is_refused_by_name(curved, compiled):
    machine = Pressed(1.5, 9.81, 10.0, curved)
    y = machine.state(x=2.0)
    compiled.clear()
    with pytest.raises(ValueError, match=r"normal force of contact 'floor' at the start = -65\.285"):
        ss.simulate(machine, 0.0, 1.0, y)
    assert len(compiled) <= curved


MADE = {
    "load": lambda m: Pressed(m, 9.81, 0.7),
    "ball": lambda m: BouncingBall(m, 9.81, 0.5),
    "stops": lambda m: OscillatorBetweenStops(m, 1.0, lower=-1.0, upper=1.0, restitution=0.5),
    "friction and stops": lambda m: Guided((2.0, m), 0.3, Coulomb(100.0, 50.0)),
}


QUICK = {"friction and stops"}


@pytest.mark.more
@pytest.mark.parametrize(
    "name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in MADE]
)
def test_the_first_call_of_a_declared_machine_compiles_one_program(name, compiled):
    make = MADE[name]
    ss.simulate(make(1.0), 0.0, 0.1, make(1.0).state())  # shares arrays
    jax.clear_caches()
    machine = make(1.5)
    y = machine.state(**{machine.names.coordinates[-1]: 0.1})
    compiled.clear()
    jax.block_until_ready(ss.simulate(machine, 0.0, 0.1, y, saveat=ss.SaveAt(max_events=9)).y1)
    assert len(compiled) == 1
    jax.block_until_ready(ss.simulate(make(1.6), 0.0, 0.12, y, saveat=ss.SaveAt(max_events=9)).y1)
    assert len(compiled) == 1


def test_masses_of_lanes_by_name_are_no_rows_of_a_matrix():
    masses = np.array([1.0, 2.0])  # as many as there are coordinates
    lanes = TwoBlocksOnBelt(**{**PAIR, "mass_1": masses, "mass_2": 3.0 * masses})
    y = PairMotion(0.1, 0.2, 0.3, 0.4)
    expected = [
        TwoBlocksOnBelt(**{**PAIR, "mass_1": m, "mass_2": 3.0 * m}).energy(y) for m in masses.tolist()
    ]
    np.testing.assert_allclose(lanes.energy(y), expected, rtol=1e-15)


@pytest.mark.more
def test_random_keys_are_no_numbers():
    """Arguments may hold a key: what depends on it is left to a program."""
    assert numbers_known(jax.random.key_data, jax.random.key(0)) is None
    key = jax.random.key(0)
    run = ss.simulate(TwoBlocksOnBelt(**PAIR), 0.0, 0.1, PairMotion(0.1, 0.0, 0.0, 0.0), args=key)
    assert bool(run.successful)


def coefficients(law, speed):
    return [law.coefficient(speed), law.coefficient(-speed)]


@pytest.mark.parametrize("exponent", [2.0, 1.5])
def test_exponentials_of_a_law_are_arithmetic(exponent):
    found = numbers_known(coefficients, Stribeck(0.4, 0.2, 0.05, exponent), 0.06)
    expected = 0.2 + 0.2 * np.exp(-((0.06 / 0.05) ** exponent))
    np.testing.assert_allclose(found, [expected, -expected], rtol=1e-14)


def test_an_inertia_may_close_over_a_number_of_a_program():
    """The trial of the inertia met the tracer: an error of JAX from the constructor."""

    def end(mass):
        class Block(Pressed):
            def mass_matrix(self, q):
                return {"x": mass, "phi": 1.0}

        machine = Block(1.5, 9.81, 0.7)
        return ss.simulate(machine, 0.0, 0.1, machine.state(x=0.3)).y1.x

    assert jax.eval_shape(end, 2.0).shape == ()
    with pytest.raises(RuntimeError, match="closes over a number that is differentiated"):
        jax.grad(end)(2.0)


def test_a_batch_of_states_in_a_named_mode_is_an_error_of_the_run():
    block, lanes = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), np.full(3, 0.2)
    with pytest.raises(ValueError, match=r"guards.* has shape .*\(3,\).*scalars"):
        ss.simulate(block, 0.0, 1.0, Motion(0.0 * lanes, lanes), "stick")
