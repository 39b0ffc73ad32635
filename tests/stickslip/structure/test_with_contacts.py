"""Rigid contacts and stops on a structure: beside the mechanism declared node by node."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from stickslip.structure import (
    HarmonicForce,
    Jenkins,
    LinearStructure,
    NodeContact,
    NodeStop,
    StructureState,
    WithContacts,
    WithSliders,
)

M = np.array([[1.4, 0.2, 0.1, 0.0], [0.2, 0.9, 0.0, 0.0], [0.1, 0.0, 0.6, 0.15], [0.0, 0.0, 0.15, 1.7]])
K = np.diag(np.full(4, 3.0)) - np.eye(4, k=1) - np.eye(4, k=-1)
C = 0.02 * K
FORCE = HarmonicForce([0.0, 0.0, 0.0, 1.0], 1.3)
PAD, SHOE, UNIT = Coulomb(0.5, 0.3), Coulomb(0.3, 0.2), np.eye(4)
STRICT = ss.Integrator(step=ss.AdaptiveStep(rtol=1e-12))
RELATIVE = np.array([0.0, 0.0, 1.0, -1.0])


class ByNode(AbstractMechanism):
    """The same with a coordinate for each node, whose inertia couples all of them."""

    coordinates: ClassVar = dict.fromkeys("abcd", "m")
    contact_directions: ClassVar = {"pad": {"b": 1.0}, "shoe": {"c": 1.0, "d": -1.0}}
    opening: ClassVar = ("pad",)
    stops: ClassVar = ("wall",)

    def mass_matrix(self, q):
        return [list(row) for row in M]

    def forces(self, t, q, v, args):
        return list(FORCE(t, q, v, args) - K @ jnp.stack(q) - C @ jnp.stack(v))

    def contacts(self, t, q, v, args):
        pad = Contact(PAD, 0.2 - q.a, 0.1, normal_direction={"a": 1.0})
        return {"pad": pad, "shoe": Contact(SHOE)}

    def gaps(self, t, q, args):
        return {"wall": Stop(0.1 + q.d, 0.5)}


def structure(mass=M, stiffness=K):
    return LinearStructure(mass, C, stiffness, FORCE)


def contacts():
    pad = NodeContact(UNIT[1], PAD, lambda t, q, v, args: 0.2 - q[0], 0.1, normal_direction=UNIT[0])
    return {"pad": pad, "shoe": NodeContact(RELATIVE, SHOE), "wall": NodeStop(UNIT[3], 0.1, 0.5)}


def few(stiffness=K, friction=0.3):
    """A machine with coordinates that no contact touches."""
    pad = NodeContact(UNIT[1], Coulomb(0.5, friction), surface_speed=0.1)
    return WithContacts(
        structure(stiffness=stiffness), {"wall": NodeStop(UNIT[3], 0.1, 0.5), "pad": pad}
    )


@pytest.mark.more
def test_what_goes_in_is_kept_or_lost():
    machine = few()
    system = WithIntegrals(machine, WithContacts.powers)
    start = machine.start(structure().state(q=[0.1, 0.2, 0.3, 0.4]))
    run = ss.simulate(system, 0.0, 20.0, system.start(start))
    logged, n = run.events, int(run.events.count)
    energies = jax.vmap(lambda y: machine.energy(y.y))
    at_impacts = float(jnp.sum((energies(logged.y_after) - energies(logged.y_before))[:n]))
    found = {name: float(x) for name, x in run.y1.integrals.items()}
    assert n > 10
    assert min(found["drive of pad"], -found["friction of pad"], -at_impacts) > 0.01
    lost = sum(found.values()) + at_impacts
    assert float(machine.energy(run.y1.y) - machine.energy(start)) == pytest.approx(lost, abs=1e-9)


def test_states_of_nodes_and_back():
    machine = few()
    given = structure().state(q=[0.1, 0.2, 0.3, 0.4], v=[1.0, 0.1, 3.0, 4.0])
    y = machine.start(given)
    assert (float(y.pad), float(y.v_pad), float(y.wall)) == (0.2, 0.1, 0.4)
    assert machine.mode_names[int(machine.initial_mode(0.0, y, None))] == "stick / open"
    for found, row in zip(machine.nodes(y), given, strict=True):
        np.testing.assert_allclose(found, row, rtol=0, atol=1e-14)
    kinetic = 0.5 * np.asarray(given.v) @ M @ np.asarray(given.v)
    elastic = 0.5 * np.asarray(given.q) @ K @ np.asarray(given.q)
    assert float(machine.energy(y)) == pytest.approx(kinetic + elastic, rel=1e-14)
    assert float(machine.along([1.0, 0.0, 2.0, 0.0])(machine.to_coordinates(y)[0])) == pytest.approx(
        0.7
    )


@pytest.mark.more
def test_the_same_events_as_of_a_mechanism_declared_node_by_node():
    machine, direct = WithContacts(structure(), contacts()), ByNode()
    start = machine.start(structure().state(v=[0.0, 0.1, 0.0, 0.0]))
    run = ss.simulate(machine, 0.0, 30.0, start, integrator=STRICT)
    same = ss.simulate(direct, 0.0, 30.0, direct.state(v_b=0.1), integrator=STRICT)
    n = int(same.events.count)
    assert int(run.events.count) == n
    words = [machine.mode_names[m].split(" / ") for m in run.events.mode_after[:n]]
    assert {word[0] for word in words} == {"slip backward", "slip forward", "open"}
    assert any("wall" in machine.guard_names[g] for g in run.events.guard[:n])
    np.testing.assert_array_equal(run.events.mode_after[:n], same.events.mode_after[:n])
    np.testing.assert_allclose(run.events.t[:n], same.events.t[:n], rtol=0, atol=1e-9)
    np.testing.assert_allclose(machine.nodes(run.y1).q, jnp.stack(same.y1[:4]), rtol=0, atol=1e-9)


@pytest.mark.more
def test_sliders_go_on_it_and_slopes_are_those_of_differences():
    row = [1.0, 0.0, -1.0, 0.0]

    def end(scale, friction):
        machine = few(scale * K, friction)
        damped = WithSliders(machine, {"damper": Jenkins(machine.along(row), 2.0, 0.1)})
        start = damped.start(machine.start(structure().state(q=[0.1, 0.2, 0.3, 0.4])))
        run = ss.simulate(damped, 0.0, 12.0, start, integrator=STRICT, throw=False)
        return machine.nodes(run.y1.y).q, run.num_events

    slopes = jax.jit(jax.jacfwd(lambda *given: end(*given)[0], (0, 1)))(1.0, 0.3)
    run, h = jax.jit(end), 1e-6
    assert int(run(1.0, 0.3)[1]) > 20
    for slope, step in zip(slopes, ((h, 0.0), (0.0, h)), strict=True):
        up, down = (run(1.0 + sign * step[0], 0.3 + sign * step[1])[0] for sign in (1, -1))
        np.testing.assert_allclose(slope, (up - down) / (2 * h), rtol=2e-6, atol=1e-7)


def test_a_force_of_another_length_is_named():
    pushed = LinearStructure(M, C, K, lambda t, q, v, args: 1.0)
    machine = WithContacts(pushed, {"pad": NodeContact(UNIT[1], PAD)})
    with pytest.raises(ValueError, match=r"force\(t, q, v, args\).*a row of 4"):
        ss.simulate(machine, 0.0, 1.0, machine.start(structure().state()))


def test_an_energy_by_numbers_of_an_array_is_refused():
    machine = few()
    with pytest.raises(ValueError, match="override `energy`"):
        AbstractMechanism.energy(machine, machine.state()._replace(v_rest=jnp.ones(2)))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: WithContacts(structure(), {}), "contacts"),
        (lambda: WithContacts(structure(), {"pad": 1.0}), r"contacts\['pad'\]"),
        (lambda: WithContacts(structure(), {"rest": NodeContact(RELATIVE, PAD)}), "'rest'"),
        (lambda: WithContacts(structure(), {"pad": NodeContact([1.0], PAD)}), "a row of 4"),
        (
            lambda: WithContacts(structure(), dict.fromkeys("ab", NodeContact(UNIT[0], PAD))),
            "independent",
        ),
        (lambda: NodeContact([0.0, 0.0], PAD), "direction"),
        (lambda: NodeContact([1.0], 0.3), "law"),
        (lambda: NodeContact([1.0], PAD, lambda: 1.0), "normal_force"),
        (lambda: NodeStop([1.0], 0.1, -0.5), "restitution"),
        (lambda: few().start(few().state()), "StructureState"),
        (lambda: few().start(StructureState(np.zeros(4), np.zeros(3))), r"y\.v.*a row of 4"),
        (
            lambda: WithContacts(structure(), {**contacts(), "pad_normal": NodeContact(UNIT[2], PAD)}),
            "'pad_normal'",
        ),
    ],
)
def test_what_is_wrong_is_named(call, words):
    with pytest.raises((TypeError, ValueError), match=words):
        call()
