"""A run goes on from its end, or from any of its outputs, without being told its mode."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop

LOOSE = ss.Integrator(step=ss.AdaptiveStep(1e-4))


class Ridden(AbstractMechanism):
    """Two blocks and a spring, on a table that shakes: static is far above kinetic friction."""

    frequency: Any = 3.0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"table": {"x": 0.5, "y": 1.0}, "ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -2.9 * (q.x - q.y), "y": 1.0 - 10.1 * q.y}

    def contacts(self, t, q, v, args):
        speed = -0.213 * jnp.cos(self.frequency * t)
        table = Contact(Coulomb(1.0, 0.2), surface_speed=speed)
        return {"table": table, "ground": Contact(Coulomb(0.64), 1.34)}

    def time_scale(self, args):
        return 1.0 / self.frequency


class Carried(AbstractMechanism):
    """A mass that lies on a lift."""

    frequency: Any = 3.0
    coordinates: ClassVar = {"x": "m"}
    stops: ClassVar = ("lift",)

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -9.81}

    def gaps(self, t, q, args):
        return {"lift": Stop(q.x - 0.3 * jnp.sin(self.frequency * t), 0.5)}

    def time_scale(self, args):
        return 1.0 / self.frequency


class Turning(AbstractMechanism):
    """A puck on a table that turns to and fro, in the plane."""

    frequency: Any = 3.0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"along": {"x": 1}, "across": {"y": 1}}
    planar: ClassVar = {"along": "across"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        turn = 0.4 * jnp.cos(self.frequency * t)
        law = Coulomb(1.0, 0.02)
        return {
            "along": Contact(law, 9.81, surface_speed=-turn * q.y),
            "across": Contact(law, surface_speed=turn * q.x),
        }

    def time_scale(self, args):
        return 1.0 / self.frequency


class WithRotor(Carried):
    """The same with an eccentric rotor, whose angle nothing depends on."""

    coordinates: ClassVar = {"x": "m", "a": "rad"}
    cyclic: ClassVar = ("a",)

    def mass_matrix(self, q):
        return [[1.0, 0.2], [0.2, 0.5]]


CASES = {
    "two blocks": (Ridden(), {"y": 0.116}),
    "a lift": (Carried(), {"v_x": 0.9}),
    "a turning table": (Turning(), {"x": 0.3, "y": 0.1, "v_x": -0.04, "v_y": 0.12}),
}


@pytest.mark.more
@pytest.mark.parametrize("name", CASES)
def test_what_rests_on_a_surface_that_moves_still_does(name):
    """The steps err by their tolerance, 1e-4 here: as a speed of the contact it would be a slip."""
    system, start = CASES[name]
    times = np.linspace(0.5, 3.0, 11)
    saved = ss.SaveAt(ts=times, max_events=16)
    whole = ss.simulate(system, 0.0, 3.15, system.state(**start), integrator=LOOSE, saveat=saved)
    rests = [system.mode_names[mode] for mode in np.asarray(whole.outputs.mode)]
    assert any("stick" in word or "closed" in word for word in rests)
    found = jax.jit(jax.vmap(lambda t, y: system.initial_mode(t, y, None)))(
        jnp.asarray(times), whole.outputs.y
    )
    np.testing.assert_array_equal(found, whole.outputs.mode)
    held = jax.vmap(lambda t, y, mode: jnp.stack(system.constraints(t, y, mode, None)))(
        jnp.asarray(times), whole.outputs.y, whole.outputs.mode
    )
    np.testing.assert_allclose(held, 0.0, atol=1e-15)
    for i in (3, 8):
        begin = jax.tree.map(lambda a, i=i: a[i], whole.outputs.y)
        rest = ss.simulate(system, times[i], 3.15, begin, integrator=LOOSE)
        for a, b in zip(rest.y1, whole.y1, strict=True):
            assert float(a) == pytest.approx(float(b), abs=1e-4)
        assert int(rest.mode1) == int(whole.mode1)


def test_what_turns_with_it_has_no_place():
    """The rotor keeps its momentum, 0.5 v_a + 0.2 v_x, as the lift moves the mass."""
    run = ss.simulate(WithRotor(), 0.0, 1.3, WithRotor().state(v_x=0.9), integrator=LOOSE)
    assert float(run.y1.x) == pytest.approx(0.3 * np.sin(3.9), abs=1e-15)
    speed = 0.9 * np.cos(3.9)
    assert float(run.y1.v_x) == pytest.approx(speed, abs=1e-15)
    assert float(run.y1.v_a) == pytest.approx(0.4 * (0.9 - speed), abs=1e-3)


@pytest.mark.more
def test_so_does_a_run_that_took_all_its_attempts():
    system, start = CASES["two blocks"]
    few = ss.Integrator(step=ss.AdaptiveStep(1e-4), max_steps=20)
    cut = ss.simulate(system, 0.0, 3.15, system.state(**start), integrator=few, throw=False)
    assert not cut.successful
    assert system.mode_names[int(cut.mode1)].startswith("stick")
    assert int(system.initial_mode(cut.t1, cut.y1, None)) == int(cut.mode1)


@pytest.mark.more
def test_derivatives_of_what_rests_are_those_of_its_surface():
    def ends(frequency):
        run = ss.simulate(Carried(frequency), 0.0, 1.3, Carried().state(v_x=0.3 * frequency))
        return jnp.stack([run.y1.x, run.y1.v_x])

    w = 3.0
    expected = [0.3 * 1.3 * np.cos(1.3 * w), 0.3 * np.cos(1.3 * w) - 0.3 * w * 1.3 * np.sin(1.3 * w)]
    np.testing.assert_allclose(jax.jacfwd(ends)(w), expected, rtol=1e-9)
    np.testing.assert_allclose(jax.jacrev(ends)(w), expected, rtol=1e-9)
