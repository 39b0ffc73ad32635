"""The paper's fixed-step algorithm, as printed or with errata corrected."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from stickslip.contact import vector_dead_zone
from stickslip.fastmath import where
from stickslip.hybrid import Executor, piece, time_loop

from ._contacts import Line, contact_loads, sliding_speeds
from ._dynamics import (
    belt_torque,
    friction_rows,
    inertia,
    rolling_motors,
    slipping_motor,
    solve,
)
from ._errata import Errata
from ._friction_torques import SlipDirections, belt_friction, ground_friction
from ._kinematics import virtual_pulleys
from ._motors import motor_torque
from ._parameters import CoreXYParameters
from ._solution import Accelerations, Ledger
from ._system import CoreXYState
from ._transitions import available_coefficients, needed_friction, next_dmn, number_of
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


class Output(NamedTuple):
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


def _difference(v: Any, w: Any) -> Any:
    """`v - w`, zero where it is rounding.

    A contact that rests while the carriage moves has a speed that is a difference. The algorithm asks
    for the sign of it, and one unit in the last place would be friction in full, in a direction that
    the compiler decides: a motion that ends 0.4 m elsewhere after 2 s.
    """
    nothing = 8.0 * jnp.finfo(jnp.float64).eps * jnp.maximum(jnp.abs(v), jnp.abs(w))
    return where(jnp.abs(v - w) <= nothing, 0.0, v - w)


def _together(vx: Any, vy: Any) -> tuple[Any, Any]:
    """Speeds whose sum or difference is rounding, made equal: else they would drift apart."""
    against, along = _difference(vx, vy) == 0.0, _difference(vx, -vy) == 0.0
    half, other = 0.5 * (vx + vy), 0.5 * (vx - vy)
    return where(against, half, where(along, other, vx)), where(against, half, where(along, -other, vy))


def _speeds(y: CoreXYState) -> tuple[Any, ...]:
    """Speeds of the six contacts with the ground, up to factors."""
    along, against = _difference(y.vx, -y.vy), _difference(y.vx, y.vy)
    return y.vx, y.vy, along, against, y.omega_1, y.omega_2


class Rows(NamedTuple):
    """Friction with the ground in the rows of x and y but for the motor pulleys, and on these [N m].

    Rows of any dynamic model follow by adding the motor pulleys that roll.
    """

    x: Any
    y: Any
    one: Any
    two: Any

    def row_x(self, rolling):
        one, two = (where(r, f, 0.0) for r, f in zip(rolling, self[2:], strict=True))
        return self.x + (one + two)

    def row_y(self, rolling):
        one, two = (where(r, f, 0.0) for r, f in zip(rolling, self[2:], strict=True))
        return self.y + (one - two)


def _rows(p, mu, senses: SlipDirections, errata: Errata) -> Rows:
    f = ground_friction(p, mu, senses)
    rows = friction_rows(p, f._replace(tau_1_0=0.0, tau_2_0=0.0), errata, 0.0, 0.0)
    return Rows(*rows, f.tau_1_0, f.tau_2_0)


class Now(NamedTuple):
    """What the dynamic models have in common at one instant."""

    torques: tuple[Any, Any]  # of the motors [N m]
    relative: tuple[Any, Any]  # senses of the motor pulleys against their belts
    rest: SlipDirections  # 1 where a part has no speed
    kinetic: Rows
    static_x: Rows  # friction against a start along x, and along y
    static_y: Rows
    static: tuple[Any, Any]  # greatest static friction of the motor pulleys on the ground [N m]


@piece
def _senses(execute, y: CoreXYState, *, p):
    """Senses of all parts, which of them rest, and the senses of the pulleys against their belts."""
    speeds = _speeds(y)
    rest = tuple(where(v == 0.0, 1.0, 0.0) for v in speeds)
    turn = virtual_pulleys(y.vx, y.vy, p.r)
    relative = (
        jnp.sign(_difference(y.omega_1, turn[0])), jnp.sign(_difference(y.omega_2, turn[1])),
    )  # fmt: skip
    return tuple(jnp.sign(v) for v in speeds), rest, relative


@piece
def _torques(execute, volts, y: CoreXYState, *, p):
    return motor_torque(p, volts[0], y.omega_1), motor_torque(p, volts[1], y.omega_2)


@piece
def _kinetic(execute, senses, *, p, errata: Errata) -> Rows:
    return _rows(p, p.mu_k, SlipDirections(*senses), errata)


@piece
def _static(execute, rest, *, p, start, errata: Errata) -> Rows:
    """Friction of what rests against a `start`, the senses that all parts would have then."""
    senses = SlipDirections(*(r * d for r, d in zip(rest, start, strict=True)))
    return _rows(p, p.mu_s, senses, errata)


def _now(p, y: CoreXYState, volts, errata: Errata, execute: Executor) -> Now:
    senses, rest, relative = _senses(execute, y, p=p)
    torques = _torques(execute, volts, y, p=p)
    kinetic = _kinetic(execute, senses, p=p, errata=errata)
    starts = ((1.0, 0.0, 1.0, 1.0, 1.0, 1.0), (0.0, 1.0, 1.0, -1.0, 1.0, -1.0))
    static_x, static_y = (_static(execute, rest, p=p, start=d, errata=errata) for d in starts)
    static = tuple(p.mu_s * 2.0 * P * p.r_f for P in (p.P1, p.P2))
    return Now(torques, relative, SlipDirections(*rest), kinetic, static_x, static_y, static)


def _carriage(p, load, now: Now, rolling, errata: Errata, execute: Executor):
    """Accelerations of x and y under the rows `load` [N m] with the dead zone at zero velocity, Eqs.
    (28)-(30). One formula for all four models: a batch would compute all of them to choose one."""
    rest = now.rest
    if errata.A8:
        m = inertia(p, *(where(rolls, 1.0, 0.0) for rolls in rolling))
        loads = [n * p.r for n in contact_loads(p)]
        along = p.mu_s * (loads[2] + where(rolling[0], loads[4], 0.0)) * rest.along
        against = p.mu_s * (loads[3] + where(rolling[1], loads[5], 0.0)) * rest.against
        x = loads[0] if errata.A1 else p.m * p.g * p.r
        limits = jnp.stack([p.mu_s * x * rest.x, p.mu_s * loads[1] * rest.y, along, against])
        M = jnp.stack([jnp.stack([m.x, m.coupling]), jnp.stack([m.coupling, m.y])])
        a = vector_dead_zone(M, jnp.stack(load), _NORMALS, limits)
        return a[0], a[1]

    return _by_axis(execute, load, rest, now.static_x, now.static_y, rolling, p=p)


@piece
def _by_axis(execute, load, rest: SlipDirections, static_x: Rows, static_y: Rows, rolling, *, p):
    """The same with a dead zone for each axis, as the paper has it."""

    def one(load, at_rest, bound):
        return where(at_rest == 1.0, dead_zone_row(load, jnp.abs(bound)), load)

    m = inertia(p, *(where(rolls, 1.0, 0.0) for rolls in rolling))
    row_x = one(load[0], rest.x, static_x.row_x(rolling))
    row_y = one(load[1], rest.y, static_y.row_y(rolling))
    return solve(m, row_x, row_y)


@piece
def _loads(execute, kinetic: Rows, rolling, torques, belts, *, p, errata: Errata):
    """Rows of x and y under friction, torques and belt forces [N m]."""
    one, two = (
        where(rolls, torque, belt_torque(p, belt, errata))
        for rolls, torque, belt in zip(rolling, torques, belts, strict=True)
    )
    return kinetic.row_x(rolling) + one + two, kinetic.row_y(rolling) + one - two


@piece
def _turn(execute, rolls, with_belt, tau_0, torque, belt, static, standing, *, p):
    """Acceleration of a motor pulley, and the friction of the ground on it."""
    free = dead_zone_row(torque + belt * p.r, static) / p.J
    alone = where(standing == 1.0, free, slipping_motor(p, torque, tau_0, belt))
    alpha = where(rolls, with_belt, alone)
    holding = -jnp.clip(torque, -static, static)
    at_rest = where(alpha == 0.0, holding, -static * jnp.sign(alpha))
    return alpha, where(standing == 1.0, at_rest, tau_0)


def _motion(p, now: Now, number, belts, errata: Errata, execute: Executor) -> Motion:
    """Accelerations in the dynamic model `number` with the given belt forces."""
    rolling = ((number == 1) | (number == 3), (number == 1) | (number == 2))

    loads = _loads(execute, now.kinetic, rolling, now.torques, belts, p=p, errata=errata)
    ax, ay = _carriage(p, loads, now, rolling, errata, execute)
    turning = zip(
        rolling, rolling_motors(ax, ay, p.r), now.kinetic[2:], now.torques, belts, now.static,
        (now.rest.one, now.rest.two), strict=True,
    )  # fmt: skip

    one, two = (_turn(execute, *side, p=p) for side in turning)
    return Motion(Accelerations(ax, ay, one[0], two[0]), (one[1], two[1]), belts)


@piece
def _advance(execute, y: CoreXYState, number, a: Accelerations, *, p, dt, errata: Errata):
    """Explicit Euler step, and which motors roll after it, Eq. (73)."""
    vx, vy = y.vx + dt * a.x, y.vy + dt * a.y
    omegas = [y.omega_1 + dt * a.alpha_1, y.omega_2 + dt * a.alpha_2]
    if errata.A12:
        vx, vy = where(y.vx * vx < 0.0, 0.0, vx), where(y.vy * vy < 0.0, 0.0, vy)
        if errata.A8:
            along = _difference(y.vx, -y.vy) * (vx + vy) < 0.0
            vx, vy = where(along, 0.5 * (vx - vy), vx), where(along, 0.5 * (vy - vx), vy)
            against = _difference(y.vx, y.vy) * (vx - vy) < 0.0
            vx, vy = where(against, 0.5 * (vx + vy), vx), where(against, 0.5 * (vx + vy), vy)
        omegas = [
            where(old * new < 0.0, 0.0, new)
            for old, new in zip((y.omega_1, y.omega_2), omegas, strict=True)
        ]
    vx, vy = _together(vx, vy)
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


@piece
def _account(execute, y: CoreXYState, torques, belts, number, ledger: Ledger, *, p, dt, errata: Errata):
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
    for slipping, f, omega, virtual in zip(slips, belts, (y.omega_1, y.omega_2), turn, strict=True):
        friction.append(where(slipping, f * p.r * (omega + back * virtual), 0.0))
    distance = [where(s, jnp.abs(v), 0.0) for s, v in zip(slips, speeds[6:], strict=True)]
    return Ledger(
        ledger.motor_1 + dt * torques[0] * y.omega_1,
        ledger.motor_2 + dt * torques[1] * y.omega_2,
        tuple(e + dt * f for e, f in zip(ledger.friction, friction, strict=True)),
        tuple(d + dt * v for d, v in zip(ledger.slip, distance, strict=True)),
    )


@piece
def _voltages(execute, t, *, voltage: AbstractVoltage):
    return voltage(t)


@piece
def _belts(execute, number, senses, *, p):
    """Forces of the belts that slip in the dynamic model `number`."""
    slipping = ((number == 2) | (number == 4), (number == 3) | (number == 4))
    one, two = (where(s, f, 0.0) for s, f in zip(slipping, belt_friction(p, *senses), strict=True))
    return one, two


@piece
def _chosen(execute, before, alphas, torques, ground, relative, *, p, errata: Errata):
    """The dynamic model that rules the step, and the senses of the belts in it."""
    needed = needed_friction(p, alphas, torques, ground, errata)
    senses = relative
    if errata.A4:
        # A belt that starts to slip does so against the friction it lacked.
        senses = tuple(
            where(s == 0.0, -jnp.sign(f), s)
            for s, f in zip(relative, (needed.f_1s, needed.f_2s), strict=True)
        )
    return next_dmn(before, needed, available_coefficients(p, errata)), senses


def step(
    p: CoreXYParameters,
    voltage: AbstractVoltage,
    t: Any,
    dt: Any,
    carry: Carry,
    errata: Errata,
    execute: Executor,
) -> tuple[Carry, Output]:
    """One step of the algorithm from time `t` [s]; also the output at `t`."""
    y = carry.y
    now = _now(p, y, _voltages(execute, t, voltage=voltage), errata, execute)
    before = number_of(carry.slips_1, carry.slips_2)

    belts = _belts(execute, before, now.relative, p=p)
    ideal = _motion(p, now, before, belts, errata, execute)
    alphas = ideal.a.alpha_1, ideal.a.alpha_2
    number, senses = _chosen(
        execute, before, alphas, now.torques, ideal.ground, now.relative, p=p, errata=errata
    )
    belts = _belts(execute, number, senses, p=p)
    motion = _motion(p, now, number, belts, errata, execute)
    ledger = _account(execute, y, now.torques, belts, number, carry.ledger, p=p, dt=dt, errata=errata)
    new, slips = _advance(execute, y, number, motion.a, p=p, dt=dt, errata=errata)
    slipping = ((number == 2) | (number == 4), (number == 3) | (number == 4))
    own = [jnp.sign(v) for v in _speeds(y)]
    own += [where(s, sense, 0.0) for s, sense in zip(slipping, senses, strict=True)]
    row = Output(t, y, motion.a, number, tuple(own), carry.ledger)
    return Carry(new, slips[0], slips[1], ledger), row


def march(
    p: CoreXYParameters,
    voltage: AbstractVoltage,
    y0: CoreXYState,
    dt: Any,
    rows: int,
    stride: Any,
    errata: Errata,
    execute: Executor,
) -> Output:
    """`rows` outputs, `stride` (an array) steps apart, by `lax.scan`; the start is the first."""
    zero = jnp.zeros_like(y0.x)
    turn = virtual_pulleys(y0.vx, y0.vy, p.r)
    # Numbers and not arrays: a batch then lies lane by lane in memory.
    ledger = Ledger(zero, zero, (zero,) * 8, (zero,) * 2)
    start = Carry(y0, y0.omega_1 != turn[0], y0.omega_2 != turn[1], ledger)

    def many(carry, row):
        def one(i, carry):
            number = row * stride + i
            return step(p, voltage, number.astype(jnp.float64) * dt, dt, carry, errata, execute)[0]

        t = (row * stride).astype(jnp.float64) * dt
        shown = step(p, voltage, t, dt, carry, errata, execute)[1]
        # Nothing comes after the last row.
        steps = where(row < rows - 1, stride, 0)
        return jax.lax.fori_loop(0, steps, one, carry), shown

    @time_loop
    def whole(execute, start):
        return jax.lax.scan(many, start, jnp.arange(rows, dtype=jnp.int32))[1]

    shown = whole(execute, start)
    friction, slip = (jnp.stack(a, axis=-1) for a in (shown.ledger.friction, shown.ledger.slip))
    ledger = shown.ledger._replace(friction=friction, slip=slip)
    return shown._replace(ledger=ledger, senses=jnp.stack(shown.senses, axis=-1))
