"""Every set-valued law in all forms of a declared machine: the smooth ones tend to the event-driven."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import (
    Asymmetric,
    Coulomb,
    Dahl,
    HyperbolicWeakening,
    LuGre,
    Stribeck,
    Sum,
    ViscousFriction,
)
from stickslip.mechanism import AbstractMechanism, Contact
from tests.stickslip.mechanism._machines import Arm, Chain, Oscillator, flat

LAWS = {
    "coulomb": Coulomb(1.0, 0.5),
    "coulomb, one coefficient": Coulomb(0.7),
    "stribeck": Stribeck(1.0, 0.5, v_s=0.3),
    "hyperbolic": HyperbolicWeakening(1.0, gamma=2.0),
    "hyperbolic, breakaway": HyperbolicWeakening(1.0, gamma=1.0, mu_k=0.7),
    "asymmetric": Asymmetric(Coulomb(0.6, 0.4), Stribeck(1.0, 0.5, v_s=0.2)),
    "sum": Sum(Stribeck(0.6, 0.3, v_s=0.3), Coulomb(0.4, 0.2), ViscousFriction(0.1)),
}
SMOOTH_AT_REST = ("coulomb, one coefficient", "stribeck", "hyperbolic")  # no drop as slip begins
WIDTHS = jnp.array([1e-3, 2.5e-4])


def oscillator(law):
    machine = Oscillator(1.0, 1.0, law, 0.2)
    return machine, machine.state(x=0.3, v_x=0.2)


def two_blocks(law):
    machine = Chain(1.0, 1.0, 0.6, (law, Coulomb(0.8, 0.5)), 0.3, 2)
    return machine, machine.state(x_1=0.5, x_2=-0.3)


MACHINES = {"oscillator": oscillator, "two blocks": two_blocks}
QUICK = ("coulomb", "stribeck", "sum")
CASES = [
    (machine, law)
    if machine == "oscillator" and law in QUICK
    else pytest.param(machine, law, marks=pytest.mark.slow)
    for machine in MACHINES
    for law in LAWS
]


def differences(smooth, exact):
    """Largest difference of the state at the end, for each width."""
    return np.abs(np.asarray(smooth) - np.asarray(exact)).max(-1)


@pytest.mark.more
@pytest.mark.parametrize(("machine", "law"), CASES)
def test_regularised_over_stick_and_slip(machine, law):
    """Rest is creep at a speed of the order of the width: first order.

    Where friction drops as slip begins, release is a slow passage over the peak of the smooth curve,
    a fold, which delays it by the width to the power 2/3.
    """
    hybrid, y0 = MACHINES[machine](LAWS[law])
    t1 = 9.0
    run = ss.simulate(hybrid, 0.0, t1, y0, saveat=ss.SaveAt(max_events=64))
    assert int(run.num_events) >= 1

    def smooth(v_reg):
        return flat(ss.simulate(hybrid.regularised(v_reg), 0.0, t1, y0).y1)

    errors = differences(jax.jit(jax.vmap(smooth))(WIDTHS), flat(run.y1))
    drops = law not in SMOOTH_AT_REST or machine == "two blocks"
    assert errors[1] < (0.06 if drops else 0.006)
    assert np.log(errors[0] / errors[1]) / np.log(4.0) > (0.5 if drops else 0.8)


@pytest.mark.more
@pytest.mark.parametrize(("kind", "order"), [("sqrt", 2.0), ("arctan", 1.0)])
@pytest.mark.parametrize("law", ["coulomb", pytest.param("sum", marks=pytest.mark.slow)])
def test_order_of_the_rounding_in_pure_slip(law, kind, order):
    """What the table of `Regularised` says of one minus the rounded sign."""
    machine, _ = oscillator(LAWS[law])
    y0 = machine.state(v_x=-1.0)
    run = ss.simulate(machine, 0.0, 0.5, y0)
    assert int(run.num_events) == 0

    def smooth(v_reg):
        return flat(ss.simulate(machine.regularised(v_reg, kind), 0.0, 0.5, y0).y1)

    errors = differences(jax.jit(jax.vmap(smooth))(WIDTHS), flat(run.y1))
    np.testing.assert_allclose(np.log(errors[0] / errors[1]) / np.log(4.0), order, atol=0.05)


@pytest.mark.more
@pytest.mark.parametrize("law", SMOOTH_AT_REST)
def test_bristles_over_stick_and_slip(law):
    """Deflections fall like one over `sigma_0`, what the damping does like one over its root."""
    machine, y0 = oscillator(LAWS[law])
    t1 = 9.0
    run = ss.simulate(machine, 0.0, t1, y0, saveat=ss.SaveAt(max_events=64))
    assert int(run.num_events) >= 1

    def elastic(sigma_0):
        form = machine.bristles(LuGre, sigma_0=sigma_0, sigma_1=2.0 * jnp.sqrt(sigma_0))
        return flat(ss.simulate(form, 0.0, t1, form.start(y0)).y1.y)

    errors = differences(jax.jit(jax.vmap(elastic))(jnp.array([5e2, 8e3])), flat(run.y1))
    assert errors[1] < 0.02
    assert errors[0] / errors[1] > 3.0  # 16 times the stiffness


def arm(law):
    """Mass matrix of the angles, two contacts."""
    machine = Arm(1.0, 1.0, (law, Coulomb(0.8)))
    return machine, machine.state(a=0.3, b=-0.4, v_a=1.0)


@pytest.mark.more
@pytest.mark.parametrize(
    ("machine", "law"),
    [
        ("oscillator", "stribeck"),
        pytest.param("oscillator", "hyperbolic", marks=pytest.mark.slow),
        pytest.param("two blocks", "coulomb, one coefficient", marks=pytest.mark.slow),
        pytest.param("arm", "coulomb, one coefficient", marks=pytest.mark.slow),
    ],
)
def test_order_of_stiff_bristles(machine, law):
    """From 1e4 to 1e6: the damping, twice the root of the stiffness, decides, so the order is 1/2."""
    if machine == "two blocks":
        hybrid = Chain(1.0, 1.0, 0.6, (LAWS[law], Coulomb(0.6)), 0.3, 2)
        y0 = hybrid.state(x_1=0.5, x_2=-0.3)
    else:
        hybrid, y0 = {**MACHINES, "arm": arm}[machine](LAWS[law])
    run = ss.simulate(hybrid, 0.0, 6.0, y0, saveat=ss.SaveAt(max_events=64))
    assert int(run.num_events) >= 1
    integrator = ss.Integrator("tsit5", ss.AdaptiveStep(1e-7, 1e-9), max_steps=10**8)

    @jax.jit
    def elastic(sigma_0):
        form = hybrid.bristles(LuGre, sigma_0=sigma_0, sigma_1=2.0 * jnp.sqrt(sigma_0))
        end = ss.simulate(form, 0.0, 6.0, form.start(y0), integrator=integrator)
        return flat(end.y1.y)

    stiff = jnp.array([1e4, 1e5, 1e6])
    errors = differences(np.stack([elastic(s) for s in stiff]), flat(run.y1))
    orders = np.log10(errors[:-1] / errors[1:])
    assert np.all((orders > 0.45) & (orders < 0.75))


def test_laws_that_need_no_wrapping_stay_as_they_are():
    """Bristles of one's own in `bristles()`, and viscous friction in both smooth forms."""
    machine, y0 = oscillator(LuGre(Coulomb(0.7), 1e3, sigma_1=60.0))
    other, _ = oscillator(Coulomb(0.7))
    forms = machine.bristles(Dahl, sigma_0=5.0), other.bristles(LuGre, sigma_0=1e3, sigma_1=60.0)
    ends = [ss.simulate(form, 0.0, 3.0, form.start(y0)).y1 for form in forms]
    np.testing.assert_array_equal(flat(ends[0].y), flat(ends[1].y))

    viscous, y0 = oscillator(ViscousFriction(0.4))
    ends = [ss.simulate(form, 0.0, 3.0, y0).y1 for form in map(viscous.regularised, (1e-3, 1.0))]
    np.testing.assert_array_equal(flat(ends[0]), flat(ends[1]))
    # x'' + 0.4 (x' - 0.2) + x = 0 from x = 0.3, x' = 0.2.
    w = np.sqrt(1.0 - 0.04)
    a, b = 0.3 - 0.08, (0.2 + 0.2 * (0.3 - 0.08)) / w
    x = 0.08 + np.exp(-0.6) * (a * np.cos(3 * w) + b * np.sin(3 * w))
    assert float(ends[0].x) == pytest.approx(x, abs=1e-9)


class Ratchet(AbstractMechanism):
    """A block under the load `place - t` that rubs forwards only."""

    place: Any
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1.0}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": self.place - t}

    def contacts(self, t, q, v, args):
        press = 3.0 + jnp.cos(3.0 * t)
        return {"ground": Contact(Asymmetric(Coulomb(2.0), Coulomb(0.0)), normal_force=press)}


def test_friction_of_one_sense_lets_go_where_the_load_passes_zero():
    """Some of these chattered there, others had no mode: a force of rounding had the say."""

    @jax.jit
    @jax.vmap
    def end(place):
        machine = Ratchet(place)
        return ss.simulate(machine, 0.0, place + 1.0, machine.state()).y1.x

    # At rest to `place`, then v = -(t - place)^2 / 2.
    places = np.random.default_rng(0).uniform(0.5, 3.0, 64)
    np.testing.assert_allclose(end(places), -1.0 / 6.0, rtol=1e-9)
