"""What every kind of group of contacts must answer: one table of kinds, one row a kind."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import Coulomb, Stribeck
from stickslip.mechanism import (
    _dependent,
    _independent,
    _one_velocity,
    _planar,
    _rubbing_stop,
    _varying,
)
from tests.stickslip.mechanism import _machines, _stopped
from tests.stickslip.mechanism._planar import Puck as Sliding
from tests.stickslip.mechanism.test_rubbing_stop import Puck
from tests.stickslip.mechanism.test_varying_directions import Curved

LAW, COUNT, STEP = Coulomb(0.5, 0.4), 48, 1e-6


class BetweenWalls(_stopped.Pushed):
    contact_directions: ClassVar = {}

    def contacts(self, t, q, v, args):
        return {}


# A machine, the kind of its group, and coordinates at which stops are open or met, or contacts slide.
TABLE = {
    "separate": (
        _machines.chain(2), _independent.SeparateContacts, {"x_1": (-1.5, 0.2, 1.5), "x_2": (0.2, 1.2)},
    ),
    "coupled": (_machines.arm(), _independent.CoupledContacts, {}),
    "coupled stops": (
        _stopped.Row((1.0, 1.5, 0.7), (), 0.5, drive=-2.0), _independent.CoupledContacts,
        {"x_0": (0.0, 0.2), "x_1": (0.0,), "x_2": (0.0, -0.2)},
    ),
    "varying": (Curved(jnp.array([1.0, 1.5, 1.1, 0.8, 0.0])), _varying.VaryingContacts, {}),
    "dependent": (_machines.carriage(1.3), _dependent.DependentContacts, {}),
    "dependent with stops": (
        _stopped.Row((1.0, 1.5, 0.7), (Stribeck(0.6, 0.4, 0.5),) * 3, 0.5),
        _dependent.DependentWithStops, {},
    ),
    "stops on one velocity": (
        BetweenWalls(None, lambda t: -1.0, 0.5), _one_velocity.StopsOnOneVelocity, {"x": (0.0, 0.6)},
    ),
    "stops and contacts on one velocity": (
        _stopped.Pushed(LAW, lambda t: -1.0, 0.5), _one_velocity.ContactsOnOneVelocity,
        {"x": (0.0, 0.6)},
    ),
    "planar": (Sliding(LAW, 1.0, 0.5), _planar.PlanarContact, {}),
    "stop with friction": (Puck(push=2.0), _rubbing_stop.RubbingStop, {"y": (0.0, 0.3)}),
}  # fmt: skip


def states_of(machine, places, seed=0):
    """Random states, some of their velocities zero; coordinates as the stops have them."""
    rng, columns = np.random.default_rng(seed), []
    for name in type(machine.state())._fields:
        x = rng.normal(size=COUNT) * 0.1
        if name.startswith("v_"):
            x = rng.normal(size=COUNT) * (rng.random(COUNT) < 0.5) * (np.arange(COUNT) % 4 > 0)
        columns.append(rng.choice(places[name], COUNT) if name in places else x)
    return type(machine.state())(*map(jnp.asarray, columns))


def numbers(y):
    return jnp.stack(jax.tree.leaves(y))


@pytest.fixture(scope="module", params=TABLE)
def answers(request):
    """What a machine of each kind says in random states: one program a kind."""
    machine, kind, places = TABLE[request.param]
    (group,) = (g for g in machine.structure.contact_groups[:1])
    assert type(group) is kind

    def held(y, mode):
        return jnp.stack([*machine.constraints(0.3, y, mode, None), jnp.zeros(())])

    def after(y, mode, guard):
        y, mode = machine.transition(0.3, y, mode, guard, None)
        return held(y, mode), mode, jnp.stack(machine.guards(0.3, y, mode, None))

    @jax.jit
    @jax.vmap
    def ask(y):
        mode = machine.initial_mode(0.3, y, None)
        count = len(machine.guard_names)
        events = jax.vmap(lambda guard: after(y, mode, guard))(jnp.arange(count, dtype=jnp.int32))
        values = machine.guards(0.3, y, mode, None)

        def field(x):
            return numbers(machine.vector_field(0.3, type(y)(*x), mode, None))

        x = numbers(y)
        ways = jnp.eye(len(x))
        differences = jax.vmap(lambda d: (field(x + STEP * d) - field(x - STEP * d)) / (2 * STEP))(ways)
        return mode, jnp.stack(values), held(y, mode), events, jax.jacfwd(field)(x), differences.T

    return machine, jax.tree.map(np.asarray, ask(states_of(machine, places)))


@pytest.mark.more
def test_what_begins_is_allowed(answers):
    """No guard is beyond its zero in the mode of a state: the law of all contacts and guards agree."""
    machine, (mode, values, held, *_) = answers
    assert values.shape[1] == len(machine.guard_names) == machine.structure.guards.many
    assert np.mean(mode >= 0) > 0.5
    assert len(np.unique(mode)) > 1
    assert np.min(values[mode >= 0]) >= -1e-12
    assert np.max(np.abs(held[mode >= 0])) <= 1e-12


@pytest.mark.more
def test_what_rests_after_an_event_is_held(answers):
    """Whichever guard fires: contacts at rest have no speed, closed stops neither speed nor gap."""
    _, (mode, _, _, (held, after, values), *_) = answers
    allowed = (mode[:, None] >= 0) & (after >= 0)
    assert np.max(np.abs(held[allowed])) <= 1e-12
    assert np.all(np.isfinite(values[allowed]))
    assert np.any(after[allowed] != np.broadcast_to(mode[:, None], after.shape)[allowed])


@pytest.mark.more
def test_the_field_has_the_slopes_of_its_differences(answers):
    _, (mode, _, _, _, slopes, differences) = answers
    np.testing.assert_allclose(slopes[mode >= 0], differences[mode >= 0], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("name", TABLE)
def test_states_of_contacts_by_name_are_the_words_of_the_mode(name):
    machine, _, _ = TABLE[name]
    names = machine.names.contacts + machine.names.stops
    numbers = np.random.default_rng(0).integers(0, len(machine.mode_names), 40)
    found = machine.contact_states(np.append(numbers, -1))
    assert tuple(found) == names
    for row, mode in enumerate(numbers):
        one = machine.contact_states(int(mode))
        assert " / ".join(one.values()) == machine.mode_names[int(mode)]
        assert one == {key: words[row] for key, words in found.items()}
    assert {words[-1] for words in found.values()} == {""}


def test_states_of_contacts_in_no_mode_raise():
    machine = _machines.chain(2)
    with pytest.raises(ValueError, match="mode = 16: it must be an integer from 0 to 15"):
        machine.contact_states(16)
    with pytest.raises(TypeError, match=r"mode = 0\.5: it must be an integer"):
        machine.contact_states(0.5)
    with pytest.raises(ValueError, match=r"mode.*outside of jit and vmap"):
        jax.jit(lambda mode: len(machine.contact_states(mode)))(1)
