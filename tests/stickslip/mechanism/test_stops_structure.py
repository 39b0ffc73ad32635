"""Stops beside contacts: bits of the mode, the order of guards, groups that inertia parts."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from stickslip.mechanism._independent import SeparateContacts
from stickslip.mechanism._modes import ModeNames, mode_of, states_of
from tests.stickslip.mechanism._stopped import Guided

FINE = ss.Integrator("dop853", ss.AdaptiveStep(1e-11, 1e-12))


@pytest.mark.more
@pytest.mark.parametrize(
    ("contacts", "stops"), [(0, 1), (0, 30), (0, 31), (14, 2), (14, 3), (15, 1), (30, 2), (0, 62)]
)
def test_modes_of_contacts_and_stops(contacts, stops):
    """States to and fro, and the names of the modes."""
    random = np.random.default_rng(contacts + stops)
    states = np.hstack(
        [random.integers(-1, 3, (50, contacts)), 2 * random.integers(0, 2, (50, stops))]
    ).astype(float)
    states[0, contacts:] = 0.0
    modes = jax.vmap(lambda row: mode_of(list(row), stops))(jnp.asarray(states))
    assert modes.dtype == (jnp.int32 if 2 * contacts + stops <= 30 else jnp.int64)
    assert (modes >= 0).all()
    back = jax.vmap(lambda mode: jnp.stack(states_of(mode, contacts, stops)))(modes)
    np.testing.assert_array_equal(back, states)
    names, words = ModeNames(contacts, stops), ("slip backward", "stick", "slip forward", "open")
    for mode, row in zip(modes, states, strict=True):
        expected = [words[int(s) + 1] for s in row[:contacts]]
        expected += ["closed" if s == 0.0 else "open" for s in row[contacts:]]
        assert names[int(mode)] == " / ".join(expected)
        assert names.index(" / ".join(expected)) == int(mode)


class Yard(AbstractMechanism):
    """Wagons of 1 kg with brakes, and a buffer for the last one."""

    law: Any
    e: Any
    blocks: int = eqx.field(static=True)
    buffers: int = eqx.field(static=True, default=1)

    @property
    def coordinates(self):
        return {f"x_{i}": "m" for i in range(self.blocks)}

    @property
    def contact_directions(self):
        return {f"brake {i}": {f"x_{i}": 1} for i in range(self.blocks)}

    @property
    def stops(self):
        return tuple(f"buffer {i}" for i in range(self.buffers))

    def mass_matrix(self, q):
        return (1.0,) * self.blocks

    def forces(self, t, q, v, args):
        return (0.0,) * self.blocks

    def contacts(self, t, q, v, args):
        return [Contact(self.law)] * self.blocks

    def gaps(self, t, q, args):
        return [Stop(1.0 + i - q[-1], self.e) for i in range(self.buffers)]


@pytest.mark.slow
def test_a_stop_beyond_32_bits():
    """The wagon brakes at 0.5 m/s2, meets the buffer at sqrt(3) m/s and comes to rest behind it."""
    yard = Yard(Coulomb(0.5), 0.5, 16)
    run = ss.simulate(yard, 0.0, 6.0, yard.state(v_x_15=2.0), saveat=ss.SaveAt(max_events=8))
    brakes = " / ".join(["stick"] * 15)
    after = [yard.mode_names[int(m)] for m in run.events.mode_after[: int(run.num_events)]]
    assert after == [f"{brakes} / slip backward / open", f"{brakes} / stick / open"]
    assert yard.mode_names[int(run.events.mode_before[0])] == f"{brakes} / slip forward / open"
    met = (2.0 - np.sqrt(3.0)) / 0.5
    np.testing.assert_allclose(run.events.t[:2], [met, met + np.sqrt(3.0)], rtol=1e-12)
    np.testing.assert_allclose(run.y1.x_15, 1.0 - 0.75, rtol=1e-12)


def test_more_bits_than_64_are_refused():
    with pytest.raises(ValueError, match=r"5 stops.*at most 62 less two"):
        Yard(Coulomb(0.5), 0.5, 29, 5)


def test_stops_have_the_last_guards():
    names = Guided((2.0, 1.0), 0.3, Coulomb(100.0, 50.0)).guard_names
    assert names == ("guide stops or gives way", "guide gives way forward", "top is met or left")


@pytest.mark.more
@pytest.mark.parametrize(("push", "guard"), [(-1.0, 0), (1.0, 1)])
def test_a_contact_beside_a_stop_gives_way_to_either_side(push, guard):
    """What is left to the guide on either side falls with time, as a mass rests on its block."""

    class Pushed(Guided):
        def forces(self, t, q, v, args):
            return push * t, -10.0

    machine = Pushed((2.0, 1.0), 0.3, Coulomb(30.0, 25.0))
    assert machine.two_sided_contacts == (0,)
    run = ss.simulate(machine, 0.0, 45.0, machine.state(), saveat=ss.SaveAt(max_events=1), throw=False)
    assert machine.mode_names[int(run.events.mode_before[0])] == "stick / closed"
    assert int(run.events.guard[0]) == guard
    np.testing.assert_allclose(run.events.t[0], 30.0 + 10.0 * push, rtol=1e-12)
    after = machine.mode_names[int(run.events.mode_after[0])]
    assert after == f"slip {'forward' if push > 0 else 'backward'} / closed"


class Wagons(AbstractMechanism):
    """Two wagons on springs and under loads of the time; a wall for the first, and for the second a
    wall or a brake. `relative`: the second is told by its distance from the first."""

    masses: Any
    e: Any
    law: Any
    relative: bool = eqx.field(static=True)
    coordinates: ClassVar = {"x": "m", "y": "m"}

    @property
    def contact_directions(self):
        return {} if self.law is None else {"brake": {"x": float(self.relative), "y": 1.0}}

    @property
    def stops(self):
        return ("wall",) if self.law is not None else ("wall", "other wall")

    def places(self, q):
        return q.x, (q.x + q.y if self.relative else q.y)

    def mass_matrix(self, q):
        first, second = self.masses
        return ((first + second, second), (second, second)) if self.relative else self.masses

    def forces(self, t, q, v, args):
        x, y = self.places(q)
        on_first = 0.5 * (y - x) - x + 2.0 * jnp.sin(0.5 * t)
        on_second = 0.5 * (x - y) + 1.5 * jnp.cos(0.4 * t)
        return (on_first + on_second, on_second) if self.relative else (on_first, on_second)

    def contacts(self, t, q, v, args):
        return [] if self.law is None else [Contact(self.law)]

    def gaps(self, t, q, args):
        x, y = self.places(q)
        walls = [Stop(x + 0.4, self.e, 0.05), Stop(0.8 - y, self.e, 0.05)]
        return walls[: len(self.stops)]

    def time_scale(self, args):
        return 0.5


@pytest.mark.more
@pytest.mark.parametrize("law", [None, Coulomb(0.7, 0.5)])
def test_stops_that_inertia_parts_move_as_in_places(law):
    """Relative coordinates join the wagons into one group, whose contacts and stops do not feel each
    other; in places each wagon is a group."""
    places, relative = (Wagons((1.0, 2.0), 0.2, law, kind) for kind in (False, True))
    assert len(places.structure.groups) == 2
    (of,) = relative.structure.groups
    assert type(of) is SeparateContacts
    assert of.stops == len(relative.stops)
    found = []
    for machine in (places, relative):
        run = ss.simulate(
            machine, 0.0, 20.0, machine.state(), integrator=FINE, saveat=ss.SaveAt(max_events=128)
        )
        count = int(run.num_events)
        modes = [machine.mode_names[int(m)] for m in run.events.mode_after[:count]]
        found.append((machine.places(run.y1), np.asarray(run.events.t[:count]), modes))
    (ends, times, modes), (others, same, again) = found
    assert modes == again
    assert sum("closed" in m for m in modes) >= 2
    np.testing.assert_allclose(same, times, atol=1e-8)
    np.testing.assert_allclose(others, ends, atol=1e-8)
