"""The carriage under its controller as it is: sampled at 1 kHz, its command held for a millisecond."""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.control import WithController

from ._inverse import CUT_OFF, ORDER
from ._record import STEP, Record
from ._stage import LAG, LIMIT, Stage, law_of


class Rows(NamedTuple):
    """At every sample: position [m], speed [m/s], acceleration [m/s^2], command [V]."""

    q: Any
    v: Any
    a: Any
    u: Any


def sampled(values: dict[str, Any], record: Record) -> Rows:
    """The run over the reference of the record, from rest where that begins."""
    nothing = np.zeros(2)  # a table of the command, by which it is held
    stage = Stage(
        values["mass"], law_of(values), values.get("offset", 0.0), nothing, record.gain, record.k_p,
        record.k_v, LAG, closed=False,
    )  # fmt: skip

    def update(k, t, measured, state, reference):
        q, v = measured
        goal = reference[jnp.clip(k, 0, reference.shape[0] - 1)]
        return jnp.clip(record.k_v * (record.k_p * (goal - q) - v), -LIMIT, LIMIT), state

    def hold(stage, output, args):
        return eqx.tree_at(lambda s: s.table, stage, output + nothing), args

    loop = WithController(stage, update, STEP, measure=lambda t, y, args: (y.q, y.v_q), drive=hold)
    reference, times = jnp.asarray(record.reference), STEP * np.arange(record.q.size)
    found = ss.simulate(
        loop, 0.0, times[-1], loop.start(stage.state(q=record.q[0]), 0.0, reference), args=reference,
        integrator=ss.Integrator("rk4", ss.FixedStep(STEP), max_steps=10 * record.q.size),
        saveat=ss.SaveAt(ts=times, max_events=None), throw=False,
    ).outputs  # fmt: skip
    assert found is not None
    return Rows(found.y.y.q, found.y.y.v_q, found.dy.y.v_q, found.y.output)


def relative_errors(found: Rows, record: Record) -> dict[str, float]:
    """Norms of the errors over norms of what was measured [%], but for a tenth of a second at the ends.

    Speed and acceleration of the record are differences of its filtered position.
    """
    import scipy.signal  # every command imports this package, and few need it

    taps: Any = scipy.signal.butter(ORDER, 2.0 * CUT_OFF * STEP)
    speed = np.gradient(scipy.signal.filtfilt(taps[0], taps[1], record.q), STEP)
    measured = Rows(record.q, speed, np.gradient(speed, STEP), record.u)
    inside = slice(100, -100)

    def norm(row):
        return float(np.linalg.norm(np.asarray(row)[inside]))

    pairs = zip(("position", "velocity", "acceleration", "force"), found, measured, strict=True)
    return {name: 100.0 * norm(row - known) / norm(known) for name, row, known in pairs}
