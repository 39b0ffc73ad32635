"""Data of a closed loop: the controller, a known part of the system, makes the fit right that is wrong
without it."""

import contextlib
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.identification import Observed, Problem, Record
from stickslip.mechanism import AbstractMechanism, Contact

TRUTH = {"mass": 1.0, "dry": 0.3}
GAIN = 5.0  # of the controller [N s/m]
STEP, END, FINE = 0.05, 30.0, 50
SD = 0.02
TIMES = STEP * np.arange(round(END / STEP) + 1)
INTEGRATOR = ss.Integrator("tsit5", ss.AdaptiveStep(1e-7, 1e-7))


def reference(t: Any) -> Any:
    return 0.4 * jnp.sin(1.3 * t) + 0.2 * jnp.sin(2.9 * t)


class Loop(AbstractMechanism):
    """A mass on a dry floor that a speed controller drives, or a table of its measured command."""

    mass: Any
    dry: Any
    command: Any

    coordinates: ClassVar = {"q": "m"}
    contact_directions: ClassVar = {"floor": {"q": 1}}

    def mass_matrix(self, q):
        return {"q": self.mass}

    def forces(self, t, q, v, args):
        if self.command is not None:
            return {"q": self.command(t)}
        return {"q": GAIN * (reference(t) - v.q)}

    def contacts(self, t, q, v, args):
        return {"floor": Contact(Coulomb(self.dry), 1.0)}

    def time_scale(self, args):
        return 0.1


def logged(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Speed and command of a loop that is pushed at random, by implicit steps that share nothing with
    the package."""
    rng = np.random.default_rng(seed)
    h, v, push = STEP / FINE, 0.0, 0.0
    goal = np.asarray(reference(h * np.arange(TIMES.size * FINE)))
    rows = []
    for k in range(TIMES.size):
        # Pushes that last half a second.
        push = np.exp(-STEP / 0.5) * push + 0.15 * np.sqrt(1 - np.exp(-2 * STEP / 0.5)) * rng.normal()
        rows.append((v, GAIN * (goal[k * FINE] - v)))
        for i in range(FINE):
            whole = TRUTH["mass"] + h * GAIN
            free = TRUTH["mass"] * v + h * (GAIN * goal[k * FINE + i] + push)
            v = np.sign(free) * max(abs(free) - h * TRUTH["dry"], 0.0) / whole
    speed, command = np.array(rows).T
    return speed, command


def problem(closed: bool, seed: int) -> Problem:
    speed, command = logged(seed)
    inputs = {"command": command}
    record = Record(TIMES, {"v": speed}, inputs=inputs, begin=0.0, interpolation="linear")
    return Problem(
        _closed if closed else _open, _at_rest, TRUTH,
        {"v": Observed(lambda t, y, system: y.v_q, SD, "m/s")}, record, integrator=INTEGRATOR,
    )  # fmt: skip


def _closed(p, inputs):
    return Loop(p["mass"], p["dry"], None)


def _open(p, inputs):
    return Loop(p["mass"], p["dry"], inputs["command"])


def _at_rest(p, inputs):
    return Loop(1.0, 1.0, None).state()


@pytest.mark.slow
def test_the_controller_in_the_system_takes_the_bias_away():
    """The command answers the pushes, so it is no independent input: open loop the pushes are taken for
    the machine. The reference knows nothing of them."""
    off = {}
    for closed in (True, False):
        rows = []
        first = problem(closed, 0)
        for seed in range(32):
            made = first.with_records(problem(closed, seed).records)
            misfit = pytest.warns(UserWarning, match="reduced chi squared")
            with contextlib.nullcontext() if closed else misfit:
                fit = made.fit()
            rows.append([float(fit.values[n]) / TRUTH[n] - 1.0 for n in TRUTH])
        rows = np.array(rows)
        off[closed] = np.mean(rows, axis=0), np.std(rows, axis=0, ddof=1) / np.sqrt(len(rows))
    mean, error = off[True]
    assert np.all(np.abs(mean) < 3.0 * error + 0.01), off
    assert np.all(error < 0.05), off
    mean, error = off[False]
    assert np.max(np.abs(mean) / error) > 5.0, off
    assert np.max(np.abs(mean)) > 0.1, off
