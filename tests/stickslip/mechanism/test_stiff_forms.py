"""Stiff smooth forms from rest, in metres and seconds of any size, against SciPy's Radau method."""

from typing import Any, ClassVar

import diffrax as dfx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
from jax.flatten_util import ravel_pytree

import stickslip as ss
from stickslip.friction import (
    Asymmetric,
    Coulomb,
    Dahl,
    HyperbolicWeakening,
    LuGre,
    RateAndState,
    SmoothHyperbolicWeakening,
    Stribeck,
)
from stickslip.mechanism import AbstractMechanism, Contact

END = 5.0
TIMES = np.linspace(1.0, END, 9)  # the block holds until 2 s, then slips and is caught
# Micrometres, metres and kilometres; milliseconds, seconds and thousands of them.
LENGTHS = np.array([1e-6, 1.0, 1e3, 1.0, 1e-6, 1e3])
DURATIONS = np.array([1.0, 1.0, 1.0, 1e-3, 1e3, 1e-3])


class Drawn(AbstractMechanism):
    """A block on the ground, drawn by a spring whose far end begins to move at t = 0."""

    law: Any
    length: Any
    duration: Any

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        unit = self.length / self.duration**2
        return {"x": 20.0 * (0.1 * t / self.duration - q.x / self.length) * unit}

    def contacts(self, t, q, v, args):
        return [Contact(self.law, 10.0 * self.length / self.duration**2)]

    def time_scale(self, args):
        return self.duration


def laws(length, duration):
    speed = length / duration
    return {
        "Coulomb": Coulomb(0.3),
        "breakaway": Coulomb(0.4, 0.3),
        "Stribeck": Stribeck(0.4, 0.3, 0.01 * speed),
        "weakening": HyperbolicWeakening(0.4, 0.5 / speed, 0.3),
        "asymmetric": Asymmetric(Coulomb(0.3), Coulomb(0.2)),
        "ageing": RateAndState(0.3, 0.01, 0.015, 0.01 * length, 0.01 * speed, "ageing", 1e-4 * speed),
        "smooth": SmoothHyperbolicWeakening(0.3, 1e4 / speed, 0.5, 0.5 / speed),
    }


SET_VALUED = ("Coulomb", "breakaway", "Stribeck", "weakening", "asymmetric")
PAIRS = [(form, law) for form in ("tanh", "sqrt", "arctan", "LuGre") for law in SET_VALUED]
# Dahl's bristles have no peak at rest; laws that are smooth already are kept as they are.
PAIRS += [("Dahl", "Coulomb"), ("Dahl", "asymmetric"), ("LuGre", "ageing"), ("tanh", "smooth")]


def formed(form, law, length, duration):
    machine = Drawn(laws(length, duration)[law], length, duration)
    if form in ("tanh", "sqrt", "arctan"):
        smooth = machine.regularised(1e-4 * length / duration, form)
        return smooth, machine.state()
    stiff = {"sigma_0": 1e4 / length}
    if form == "LuGre":
        stiff |= {"sigma_1": 30.0 * duration / length, "sigma_2": 0.04 * duration / length}
        stiff |= {"v_s": 1e-3 * length / duration}
    smooth = machine.bristles({"LuGre": LuGre, "Dahl": Dahl}[form], **stiff)
    return smooth, smooth.start(machine.state())


def by_radau(form, law):
    """Places at `TIMES`, in units of the length, by the same field; fields have tests of their own."""
    smooth, start = formed(form, law, 1.0, 1.0)
    y0, back = ravel_pytree(start)
    field = jax.jit(lambda t, y: ravel_pytree(smooth.vector_field(t, back(y), 0, None))[0])
    slopes = jax.jit(jax.jacfwd(field, 1))
    t0, y = 0.0, np.asarray(y0)
    found = scipy.integrate.solve_ivp(
        lambda t, y: np.asarray(field(jnp.asarray(t), y)), (t0, END), y, "Radau", TIMES,
        rtol=1e-9, atol=1e-13, jac=lambda t, y: np.asarray(slopes(jnp.asarray(t), y)), max_step=0.1,
    )  # fmt: skip
    assert found.success
    return found.y[0]


def check(form, law, method, tolerance):
    integrator = ss.Integrator(method, ss.AdaptiveStep(tolerance), max_steps=300_000)

    @jax.jit
    @jax.vmap
    def places(length, duration):
        smooth, start = formed(form, law, length, duration)
        saved = ss.SaveAt(ts=jnp.asarray(TIMES) * duration)
        run = ss.simulate(
            smooth, 0.0, END * duration, start, integrator=integrator, saveat=saved, throw=False
        )
        y = run.outputs.y
        return (y.y.x if hasattr(y, "z") else y.x) / length, run.successful, run.stats.num_attempts

    x, fine, attempts = places(jnp.asarray(LENGTHS), jnp.asarray(DURATIONS))
    assert fine.all()
    true = by_radau(form, law)
    np.testing.assert_allclose(x, np.broadcast_to(true, x.shape), rtol=0, atol=1e-5 * true.max())
    return np.asarray(attempts)


@pytest.mark.more
def test_the_recommended_method_starts_from_rest_in_all_units():
    attempts = check("LuGre", "Stribeck", dfx.Kvaerno5(), 1e-7)
    assert np.ptp(attempts[DURATIONS == 1.0]) <= 0.02 * attempts[1]
    assert attempts.max() < 1_000


def test_a_rate_and_state_law_at_rest_is_too_stiff_for_explicit_steps():
    """Its slope at rest is N a exp(mu / a) / 2 v_0, 5e13 per second; the run says that it failed."""
    smooth, start = formed("LuGre", "ageing", 1.0, 1.0)
    explicit = ss.Integrator("dop853", ss.AdaptiveStep(1e-8), max_steps=500)
    run = ss.simulate(smooth, 0.0, END, start, integrator=explicit, throw=False)
    assert run.result == ss.RESULTS.max_steps_reached
    assert 0.0 < run.t1 < 1e-9


METHODS = [(dfx.Kvaerno5(), 1e-7), (dfx.Kvaerno3(), 1e-7), (dfx.KenCarp4(), 1e-7), ("dop853", 1e-8)]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("form", "law", "method", "tolerance"),
    [
        pytest.param(
            *pair,
            *how,
            id="-".join((*pair, how[0] if isinstance(how[0], str) else type(how[0]).__name__)),
        )
        for pair in PAIRS
        for how in METHODS
        if (pair[1], how[0]) != ("ageing", "dop853")
    ],
)
def test_every_law_form_and_method_starts_from_rest_in_all_units(form, law, method, tolerance):
    check(form, law, method, tolerance)
