"""The carriage as a declared mechanism, under the command of the record or under its controller."""

from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.friction import AbstractFrictionLaw, Asymmetric, Coulomb, Stribeck, Sum, ViscousFriction
from stickslip.mechanism import AbstractMechanism, Contact

from ._record import STEP, Record

LIMIT = 10.0  # of the command [V]
LAG = 5e-4  # of the controller, which holds its command for a millisecond [s]
FIRST = 20  # samples that may be used to find the initial state, by the rules of the benchmark


class Stage(AbstractMechanism):
    """Carriage of the effective `mass` [kg] under friction and a constant `offset` [N].

    `table`: a value for each millisecond, straight between them: the command [V], or if `closed` the
    reference [m] that the controller follows, whose command acts after a `lag` [s].
    """

    mass: Any
    law: AbstractFrictionLaw
    offset: Any
    table: Any
    gain: float
    k_p: float
    k_v: float
    lag: Any
    closed: bool = eqx.field(static=True)

    coordinates: ClassVar = {"q": "m"}
    contact_directions: ClassVar = {"guide": {"q": 1.0}}

    @property
    def first_order(self):
        return {"u": "V"} if self.closed else {}

    def command(self, t, q, v):
        """Volts at the motor; `q`, `v` of the carriage."""
        place = t / STEP
        row = jnp.clip(jnp.floor(place), 0, self.table.shape[0] - 2)
        at = row.astype(jnp.int32)
        value = self.table[at] + (place - row) * (self.table[at + 1] - self.table[at])
        if not self.closed:
            return value
        return jnp.clip(self.k_v * (self.k_p * (value - q) - v), -LIMIT, LIMIT)

    def mass_matrix(self, q):
        return {"q": self.mass}

    def forces(self, t, q, v, args):
        u = q.u if self.closed else self.command(t, q.q, v.q)
        return {"q": self.gain * u - self.offset}

    def rates(self, t, q, v, args):
        return {"u": (self.command(t, q.q, v.q) - q.u) / self.lag}

    def contacts(self, t, q, v, args):
        return {"guide": Contact(self.law)}

    def time_scale(self, args):
        return STEP


def law_of(values: dict[str, Any]) -> AbstractFrictionLaw:
    """Dry and viscous friction, one for both directions or one for each; with a `rise` towards rest
    over the speed `v_s` if there is one."""

    def one(dry, viscous):
        if "rise" in values:
            return Sum(Stribeck(dry + values["rise"], dry, values["v_s"]), ViscousFriction(viscous))
        return Sum(Coulomb(dry), ViscousFriction(viscous))

    if "dry" in values:
        return one(values["dry"], values["viscous"])
    return Asymmetric(
        one(values["dry_forward"], values["viscous_forward"]),
        one(values["dry_backward"], values["viscous_backward"]),
    )


def motion(
    values: dict[str, Any], record: Record, *, closed: bool, every: int, throw: bool = False,
    moving: Any = 1.0,
) -> tuple[ss.Solution, Stage]:  # fmt: skip
    """The run over the record from the state given by its first samples, shown at every `every`-th
    sample, and the stage. `moving`: 1, or 0 for a start from rest."""
    table = jnp.asarray(record.reference if closed else record.u)
    stage = Stage(
        values["mass"], law_of(values), values.get("offset", 0.0), table, record.gain, record.k_p,
        record.k_v, values.get("lag", LAG), closed,
    )  # fmt: skip
    curve = np.polyfit(np.arange(FIRST) * STEP, record.q[:FIRST], 2)
    times = STEP * np.arange(record.q.size)
    start = {"q": curve[2], "v_q": moving * curve[1]} | ({"u": record.u[0]} if closed else {})
    found = ss.simulate(
        stage, 0.0, times[-1], stage.state(**start),
        integrator=ss.Integrator("rk4", ss.FixedStep(STEP), max_steps=10 * record.q.size),
        saveat=ss.SaveAt(ts=times[::every], max_events=None), throw=throw,
    )  # fmt: skip
    return found, stage


def position(values: dict[str, Any], record: Record, every: int, moving: Any = 1.0) -> Any:
    """Position [m] open loop from the command of the record: what the benchmark scores."""
    outputs = motion(values, record, closed=False, every=every, moving=moving)[0].outputs
    assert outputs is not None
    return outputs.y.q


def command(values: dict[str, Any], record: Record, every: int) -> Any:
    """Command [V] of the controller while the stage follows the reference."""
    found, stage = motion(values, record, closed=True, every=every)
    assert found.outputs is not None
    return stage.command(found.outputs.t, found.outputs.y.q, found.outputs.y.v_q)
