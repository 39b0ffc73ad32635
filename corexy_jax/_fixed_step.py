"""The paper's fixed-step algorithm, as printed or with errata corrected."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from stickslip._fastmath import where
from stickslip.contact import vector_dead_zone

from ._contacts import Line, contact_loads, sliding_speeds
from ._dynamics import (
    Frictions,
    belt_torque,
    friction_rows,
    inertia,
    rolling_motors,
    slipping_motor,
    solve,
)
from ._errata import Errata
from ._friction_torques import Senses, belt_friction, ground_friction
from ._kinematics import virtual_pulleys
from ._motors import motor_torque
from ._parameters import CoreXYParameters
from ._solution import Accelerations, Ledger
from ._system import CoreXYState
from ._transitions import Needed, available_coefficients, needed_friction, next_dmn, number_of
from ._voltage import AbstractVoltage

_NORMALS = jnp.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])


class Carry(NamedTuple):
    """What a step hands to the next."""

    y: CoreXYState
    slips_1: Any
    slips_2: Any
    ledger: Ledger


class Motion(NamedTuple):
    """Accelerations, and the friction they came with."""

    a: Accelerations
    ground: tuple[Any, Any]  # torque of the ground on each motor pulley [N m]
    belts: tuple[Any, Any]  # force of each belt on its slipping motor pulley [N]


class Row(NamedTuple):
    """One output."""

    t: Any
    y: CoreXYState
    a: Accelerations
    dmn: Any
    senses: Any
    ledger: Ledger


def dead_zone_row(load: Any, bound: Any) -> Any:
    """`DZ` of Eq. (30): what is left of the load beyond the bound."""
    return where(jnp.abs(load) < bound, 0.0, load - bound * jnp.sign(load))


def _static_bounds(p, rest: Senses, rolling, errata: Errata):
    """Greatest static friction of each row [N m], from the friction against a start along it."""
    bounds = []
    for axis, direction in enumerate(((1.0, 0.0, 1.0, 1.0), (0.0, 1.0, 1.0, -1.0))):
        one, two = direction[2], direction[3]
        senses = Senses(*(r * d for r, d in zip(rest, (*direction, one, two), strict=True)))
        f = ground_friction(p, p.mu_s, senses)
        rows = friction_rows(p, f, errata, *(where(rolls, 1.0, 0.0) for rolls in rolling))
        bounds.append(jnp.abs(rows[axis]))
    return bounds


def _carriage(p, load, rest: Senses, rolling, errata: Errata):
    """Accelerations of x and y under the rows `load` [N m] with the dead zone at zero velocity, Eqs.
    (28)-(30). One formula for all four models: a batch would compute all of them to choose one."""
    m = inertia(p, *(where(rolls, 1.0, 0.0) for rolls in rolling))
    if errata.A8:
        loads = [n * p.r for n in contact_loads(p)]
        along = p.mu_s * (loads[2] + where(rolling[0], loads[4], 0.0)) * rest.along
        against = p.mu_s * (loads[3] + where(rolling[1], loads[5], 0.0)) * rest.against
        x = loads[0] if errata.A1 else p.m * p.g * p.r
        limits = jnp.stack([p.mu_s * x * rest.x, p.mu_s * loads[1] * rest.y, along, against])
        M = jnp.stack([jnp.stack([m.x, m.coupling]), jnp.stack([m.coupling, m.y])])
        a = vector_dead_zone(M, jnp.stack(load), _NORMALS, limits)
        return a[0], a[1]
    bound_x, bound_y = _static_bounds(p, rest, rolling, errata)
    row_x = where(rest.x == 1.0, dead_zone_row(load[0], bound_x), load[0])
    row_y = where(rest.y == 1.0, dead_zone_row(load[1], bound_y), load[1])
    return solve(m, row_x, row_y)


def _motion(p, y: CoreXYState, number, torques, belts, errata: Errata) -> Motion:
    """Accelerations in the dynamic model `number` with the given belt forces."""
    speeds = (y.vx, y.vy, y.vx + y.vy, y.vx - y.vy, y.omega_1, y.omega_2)
    senses = Senses(*(jnp.sign(v) for v in speeds))
    rest = Senses(*(where(v == 0.0, 1.0, 0.0) for v in speeds))
    rolling = ((number == 1) | (number == 3), (number == 1) | (number == 2))
    kinetic = ground_friction(p, p.mu_k, senses)
    f: Frictions = kinetic._replace(f_1_b=belts[0], f_2_b=belts[1])
    b_x, b_y = friction_rows(p, f, errata, *(where(rolls, 1.0, 0.0) for rolls in rolling))
    one, two = (
        where(rolls, torque, belt_torque(p, belt, errata))
        for rolls, torque, belt in zip(rolling, torques, belts, strict=True)
    )
    ax, ay = _carriage(p, (b_x + one + two, b_y + one - two), rest, rolling, errata)
    alphas, grounds = [], []
    turning = zip(
        rolling, rolling_motors(ax, ay, p.r), (kinetic.tau_1_0, kinetic.tau_2_0), torques, belts,
        (p.P1, p.P2), (rest.one, rest.two), strict=True,
    )  # fmt: skip
    for rolls, with_belt, tau_0, torque, belt, P, standing in turning:
        static = p.mu_s * 2.0 * P * p.r_f
        free = dead_zone_row(torque + belt * p.r, static) / p.J
        alone = where(standing == 1.0, free, slipping_motor(p, torque, tau_0, belt))
        alpha = where(rolls, with_belt, alone)
        holding = -jnp.clip(torque, -static, static)
        at_rest = where(alpha == 0.0, holding, -static * jnp.sign(alpha))
        alphas.append(alpha)
        grounds.append(where(standing == 1.0, at_rest, tau_0))
    return Motion(Accelerations(ax, ay, *alphas), (grounds[0], grounds[1]), belts)


def _advance(p, carry: Carry, number, motion: Motion, needed: Needed, dt, errata: Errata):
    """Explicit Euler step, and which motors roll after it, Eq. (73)."""
    y, a = carry.y, motion.a
    vx, vy = y.vx + dt * a.x, y.vy + dt * a.y
    omegas = [y.omega_1 + dt * a.alpha_1, y.omega_2 + dt * a.alpha_2]
    if errata.A12:
        vx, vy = where(y.vx * vx < 0.0, 0.0, vx), where(y.vy * vy < 0.0, 0.0, vy)
        if errata.A8:
            along = (y.vx + y.vy) * (vx + vy) < 0.0
            vx, vy = where(along, 0.5 * (vx - vy), vx), where(along, 0.5 * (vy - vx), vy)
            against = (y.vx - y.vy) * (vx - vy) < 0.0
            vx, vy = where(against, 0.5 * (vx + vy), vx), where(against, 0.5 * (vx + vy), vy)
        omegas = [
            where(old * new < 0.0, 0.0, new)
            for old, new in zip((y.omega_1, y.omega_2), omegas, strict=True)
        ]
    turn, before = virtual_pulleys(vx, vy, p.r), virtual_pulleys(y.vx, y.vy, p.r)
    slips = []
    old_slips = ((number == 2) | (number == 4), (number == 3) | (number == 4))
    for i, slipping in enumerate(old_slips):
        relative = omegas[i] - turn[i]
        if errata.A4:
            earlier = (y.omega_1, y.omega_2)[i] - before[i]
            caught = (earlier * relative <= 0.0) & (earlier != 0.0)
        else:
            caught = relative == 0.0
        slips.append(slipping & ~caught)
        omegas[i] = where(slips[i], omegas[i], turn[i])
    new = CoreXYState(
        x=y.x + dt * y.vx,
        y=y.y + dt * y.vy,
        vx=vx,
        vy=vy,
        theta_1=y.theta_1 + dt * y.omega_1,
        theta_2=y.theta_2 + dt * y.omega_2,
        omega_1=omegas[0],
        omega_2=omegas[1],
        piece=y.piece,
    )
    return new, slips


def _account(p, y: CoreXYState, torques, motion: Motion, number, dt, ledger: Ledger, errata: Errata):
    """Energies of one step, with the forces as the equations have them."""
    turn = virtual_pulleys(y.vx, y.vy, p.r)
    q = Line(y.vx, y.vy, p.r * y.omega_1, p.r * y.omega_2)
    speeds = sliding_speeds(q)
    loads = list(contact_loads(p))
    if not errata.A1:
        loads[0] = p.m * p.g
    friction = [-p.mu_k * n * jnp.abs(v) for n, v in zip(loads[:6], speeds[:6], strict=True)]
    back = -1.0 if errata.A2 else 1.0
    slips = ((number == 2) | (number == 4), (number == 3) | (number == 4))
    for slipping, f, omega, virtual in zip(
        slips, motion.belts, (y.omega_1, y.omega_2), turn, strict=True
    ):
        friction.append(where(slipping, f * p.r * (omega + back * virtual), 0.0))
    distance = [where(s, jnp.abs(v), 0.0) for s, v in zip(slips, speeds[6:], strict=True)]
    return Ledger(
        ledger.motor_1 + dt * torques[0] * y.omega_1,
        ledger.motor_2 + dt * torques[1] * y.omega_2,
        tuple(e + dt * f for e, f in zip(ledger.friction, friction, strict=True)),
        tuple(d + dt * v for d, v in zip(ledger.slip, distance, strict=True)),
    )


def step(
    p: CoreXYParameters, voltage: AbstractVoltage, t: Any, dt: Any, carry: Carry, errata: Errata
) -> tuple[Carry, Row]:
    """One step of the algorithm from time `t` [s]; also the output at `t`."""
    y = carry.y
    v1, v2 = voltage(t)
    torques = motor_torque(p, v1, y.omega_1), motor_torque(p, v2, y.omega_2)
    turn = virtual_pulleys(y.vx, y.vy, p.r)
    relative = jnp.sign(y.omega_1 - turn[0]), jnp.sign(y.omega_2 - turn[1])
    before = number_of(carry.slips_1, carry.slips_2)

    def belts_of(number, senses):
        slipping = ((number == 2) | (number == 4), (number == 3) | (number == 4))
        forces = belt_friction(p, *senses)
        one, two = (where(s, f, 0.0) for s, f in zip(slipping, forces, strict=True))
        return one, two

    ideal = _motion(p, y, before, torques, belts_of(before, relative), errata)
    needed = needed_friction(p, (ideal.a.alpha_1, ideal.a.alpha_2), torques, ideal.ground, errata)
    number = next_dmn(before, needed, available_coefficients(p, errata))
    senses = relative
    if errata.A4:
        # What begins to slip goes the way that the needed force could not prevent.
        senses = tuple(
            where(s == 0.0, -jnp.sign(f), s)
            for s, f in zip(relative, (needed.f_1s, needed.f_2s), strict=True)
        )
    motion = _motion(p, y, number, torques, belts_of(number, senses), errata)
    ledger = _account(p, y, torques, motion, number, dt, carry.ledger, errata)
    new, slips = _advance(p, carry, number, motion, needed, dt, errata)
    slipping = ((number == 2) | (number == 4), (number == 3) | (number == 4))
    own = [jnp.sign(v) for v in (y.vx, y.vy, y.vx + y.vy, y.vx - y.vy, y.omega_1, y.omega_2)]
    own += [where(s, sense, 0.0) for s, sense in zip(slipping, senses, strict=True)]
    row = Row(t, y, motion.a, number, tuple(own), carry.ledger)
    return Carry(new, slips[0], slips[1], ledger), row


def march(
    p: CoreXYParameters,
    voltage: AbstractVoltage,
    y0: CoreXYState,
    dt: Any,
    rows: int,
    stride: Any,
    errata: Errata,
) -> Row:
    """`rows` outputs, `stride` (an array) steps apart, by `lax.scan`; the start is the first."""
    zero = jnp.zeros_like(y0.x)
    turn = virtual_pulleys(y0.vx, y0.vy, p.r)
    # Numbers and not arrays: a batch then lies lane by lane in memory.
    ledger = Ledger(zero, zero, (zero,) * 8, (zero,) * 2)
    start = Carry(y0, y0.omega_1 != turn[0], y0.omega_2 != turn[1], ledger)

    def many(carry, row):
        def one(i, carry):
            number = row * stride + i
            return step(p, voltage, number.astype(jnp.float64) * dt, dt, carry, errata)[0]

        t = (row * stride).astype(jnp.float64) * dt
        shown = step(p, voltage, t, dt, carry, errata)[1]
        # Nothing comes after the last row.
        steps = where(row < rows - 1, stride, 0)
        return jax.lax.fori_loop(0, steps, one, carry), shown

    # Not through the executor: this loop is slower as one fused call (4.9 s against 3.7 s, measured).
    shown = jax.lax.scan(many, start, jnp.arange(rows, dtype=jnp.int32))[1]
    friction, slip = (jnp.stack(a, axis=-1) for a in (shown.ledger.friction, shown.ledger.slip))
    ledger = shown.ledger._replace(friction=friction, slip=slip)
    return shown._replace(ledger=ledger, senses=jnp.stack(shown.senses, axis=-1))
