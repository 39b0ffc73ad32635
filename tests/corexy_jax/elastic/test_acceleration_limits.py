"""Limits of acceleration: runs at them, slack at both sides of them, torques by hand, maps."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
import stickslip as ss
from corexy_jax.elastic import Belts, ElasticCoreXY, Frame, acceleration_limits, resonances
from stickslip.control import InputShaper
from tests.corexy_jax.elastic._run import FRICTIONLESS, belts

R, K, M_X, M_Y, ROTOR = 0.05, 1e5, 2.1, 2.3, 0.4
P = cx.CoreXYParameters(**FRICTIONLESS, P1=20.0, P2=26.0)
ALONG = {"x": (1.0, 0.0), "y": (0.0, 1.0)}


class Bare(ElasticCoreXY):
    """One that touches nothing."""

    contact_directions: ClassVar = {}

    def contacts(self, t, q, v, args):
        return {}


class Push(eqx.Module):
    """Linear motors behind steps of acceleration, and torques that turn rotors with them."""

    acceleration: Any
    begin: Any
    sizes: Any
    times: Any
    holding: Any
    inertia: Any

    def __call__(self, t, angles, speeds, args):
        since = jnp.maximum(t - self.times, 0.0)
        way = 0.5 * jnp.sum(self.sizes * since**2) / R
        now = jnp.sum(jnp.where(t >= self.times, self.sizes, 0.0)) / R
        (ax, ay), (x, y) = self.acceleration, self.begin
        one, two = (
            self.holding * (begin / R + a * way - angle) + self.inertia * a * now
            for a, begin, angle in zip((ax + ay, ax - ay), (x + y, x - y), angles, strict=True)
        )
        return one, two


@jax.jit
def _run(machine, breaks, y0, ts):
    system = ss.WithBreaks(machine, breaks)
    rule = ss.AdaptiveStep(1e-10, 1e-14)
    return ss.simulate(
        system, 0.0, ts[-1], system.start(y0), throw=False,
        integrator=ss.Integrator("dop853", rule, max_steps=200_000),
        saveat=ss.SaveAt(ts=ts, max_events=None),
    )  # fmt: skip


def pushed(a, springs, t1, *, p=P, shaper=None, holding=np.inf, at=(0.0, 0.0)):
    """Times of a run behind a step of acceleration (a row [m/s²]), how far behind their command the
    coordinates are, and tensions; motors that are held are so heavy that nothing turns them."""
    held = np.isinf(holding)
    p = cx.with_values(p, {"J": 1e6}) if held else p
    sizes, times = ((1.0,), (0.0,)) if shaper is None else (shaper.amplitudes, shaper.times)
    sizes = np.pad(np.asarray(sizes), (0, 4 - len(sizes)))
    times = np.pad(np.asarray(times), (0, 4 - len(times)), mode="edge")
    drive = Push(
        np.asarray(a), np.asarray(at), sizes, times, 0.0 if held else holding, 1e6 if held else 0.0
    )
    machine = (ElasticCoreXY if p.mu_k > 0.0 else Bare)(p, springs, drive)
    ts = np.linspace(0.0, t1, 4001)
    given = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), (machine, times, machine.at(*at), ts))
    found = _run(*given)
    assert found.successful, found
    y = found.outputs.y.y
    way = 0.5 * np.sum(sizes * np.maximum(ts[:, None] - times, 0.0) ** 2, axis=1)
    lines = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
    command = (np.asarray(at) + way[:, None] * np.asarray(a)) @ lines.T
    behind = command - np.stack([y.x, y.y, y.one, y.two], axis=1)
    return ts, behind, np.stack(jax.vmap(machine.tensions)(y))


def swing(rows):
    return 0.5 * np.ptp(rows)


@pytest.mark.more
@pytest.mark.parametrize(("name", "mass"), [("x", M_X), ("y", M_Y)])
def test_the_head_rings_by_the_tolerance(name, mass):
    """In the middle of the frame one mode rings; a shaper at another frequency leaves what is known."""
    springs, omega, along = belts(K, side=8.0), np.sqrt(2.0 * K / mass), np.array(ALONG[name])
    detuned = InputShaper(0.0, "ZV", 1.1 * omega)
    for shaper, left in ((None, 1.0), (detuned, np.cos(0.5 * np.pi / 1.1))):
        limit = acceleration_limits(P, springs, direction=along, tolerance=1e-6, shaper=shaper).ringing
        assert float(limit) == pytest.approx(1e-6 * omega**2 / left, rel=1e-9)
        begin = 0.0 if shaper is None else float(shaper.times[-1])
        ts, behind, _ = pushed(limit * along, springs, begin + 4 * np.pi / omega, shaper=shaper)
        head = behind[ts >= begin]
        assert swing(head[:, "xy".index(name)]) == pytest.approx(1e-6, rel=1e-3)
        assert swing(head[:, 1 - "xy".index(name)]) < 1e-9


ODD = Belts(Frame(0.3, 0.5, 0.1, 0.2), 2e4, 5e4, 3e-4)
PLACE = (0.05, 0.1)


@pytest.mark.more
@pytest.mark.parametrize("kind", [None, "ZV", "EI"])
def test_several_modes_ring_by_no_more(kind):
    """Off the middle, along a diagonal, with damping and motors that give way."""
    holding, along, tolerance, has = 200.0, np.array([0.6, -0.8]), 1e-9, 1e-4
    slowest = 2.0 * np.pi * float(resonances(P, ODD, *PLACE, holding=holding).frequencies[0])
    shaper = None if kind is None else InputShaper(0.0, kind, 1.15 * slowest, 0.03)
    given = {"holding": holding, "shaper": shaper}
    limits = acceleration_limits(
        P, ODD, *PLACE, direction=along, tolerance=tolerance, torque=has, **given
    )
    begin = 0.0 if shaper is None else float(shaper.times[-1])
    ts, behind, _ = pushed(limits.ringing * along, ODD, begin + 0.3, at=PLACE, **given)
    k, mass = ODD.stiffness(*PLACE), np.array([M_X, M_Y, ROTOR, ROTOR])
    grips = np.array([[-1.0, -1.0, 1.0, 0.0], [-1.0, 1.0, 0.0, 1.0]])
    stiffness = grips.T @ np.diag(k) @ grips + np.diag([0.0, 0.0, 1.0, 1.0]) * holding / R**2
    mean = np.linalg.solve(stiffness, mass * np.array([0.6, -0.8, -0.2, 1.4]))
    swings = (behind - float(limits.ringing) * mean)[ts >= begin, :2]
    assert 0.85 * tolerance < np.max(np.hypot(*swings.T)) < tolerance
    _, behind, tensions = pushed(limits.torque * along, ODD, begin + 0.3, at=PLACE, **given)
    let_go = np.max(np.abs(tensions / np.array([20.0, 20.0, 26.0, 26.0])[:, None] - 1.0))
    assert 0.93 < float(limits.slack / limits.torque) * let_go < 1.0
    assert 0.95 * has < holding / R * np.max(np.abs(behind[:, 2:])) < has


@pytest.mark.more
@pytest.mark.parametrize(("name", "mass"), [("x", M_X), ("y", M_Y)])
def test_spans_become_slack_beyond_the_limit(name, mass):
    """The shorter span of the looser belt, three times as short as the other: one way only."""
    springs, omega, along = belts(K, side=8.0), np.sqrt(2.0 * K / mass), np.array(ALONG[name])
    detuned = InputShaper(0.0, "ZV", 1.1 * omega)
    for shaper, left in ((None, 1.0), (detuned, np.cos(0.5 * np.pi / 1.1))):
        limit = acceleration_limits(P, springs, direction=along, tolerance=1.0, shaper=shaper).slack
        assert float(limit) == pytest.approx(
            20.0 * (1.0 + 1.0 / 3.0) / (0.5 * mass * (1.0 + left)), rel=1e-9
        )
        least = {}
        for share in (0.98, -0.98, 1.02, -1.02):
            t1 = 3.0 * np.pi / omega
            _, _, tensions = pushed(share * limit * along, springs, t1, shaper=shaper)
            least[share] = tensions.min()
        assert 0.0 < min(least[0.98], least[-0.98]) < 0.05 * 20.0
        assert min(least[1.02], least[-1.02]) == 0.0


def test_torque_is_that_of_the_masses_by_hand():
    """A shaper of the very frequency leaves motors that are held the masses, pulleys and rotors."""
    springs, has = belts(K), 1.5
    for along, own, turned in (
        ((1.0, 0.0), 0.5 * M_X, 1.0),
        ((0.0, -3.0), 0.5 * M_Y, 1.0),
        ((2.0, 2.0), 0.5 * (M_X + M_Y) / np.sqrt(2.0), np.sqrt(2.0)),
    ):
        given = {"direction": along, "tolerance": 1.0, "torque": has}
        shaper = InputShaper(0.0, "ZVD", np.sqrt(2.0 * K / (M_Y if along[0] == 0.0 else M_X)))
        if along[0] == 0.0 or along[1] == 0.0:
            smooth = acceleration_limits(P, springs, shaper=shaper, **given).torque
            assert float(smooth) == pytest.approx(has / R / (own + ROTOR * turned), rel=1e-9)
        sudden = acceleration_limits(P, springs, **given).torque
        assert float(sudden) == pytest.approx(has / R / (2.0 * own + ROTOR * turned), rel=1e-9)
    # Kinetic friction twice: along x of a guide with four pulleys, passive pulleys, the motor itself.
    rough = cx.CoreXYParameters(mu_s=0.02, mu_k=0.01, P1=20.0, P2=26.0)
    guide = 0.5 * (0.5 * 9.81 + 2.0 * np.sqrt(2.0) * (20.0 + 26.0))
    friction = 0.01 * (guide + 26.0 * (2.0 * np.sqrt(2.0) + 2.0))
    given = {"direction": (1.0, 0.0), "tolerance": 1.0, "torque": has}
    found = acceleration_limits(rough, springs, **given).torque
    assert float(found) == pytest.approx((has / R - 2.0 * friction) / (M_X + ROTOR), rel=1e-9)


@pytest.mark.more
def test_friction_is_met_suddenly():
    """Motors that are held start a machine along x; a shaper would leave the tension half as much."""
    rough, springs = cx.CoreXYParameters(mu_s=0.015, mu_k=0.01, P1=20.0, P2=20.0), belts(K, side=8.0)
    shaper = InputShaper(0.0, "ZV", np.sqrt(2.0 * K / M_X))
    given = {"direction": (1.0, 0.0), "tolerance": 1.0, "torque": 1.5, "shaper": shaper}
    limits = acceleration_limits(rough, springs, **given)
    _, _, (one_a, one_b, *_) = pushed((limits.torque, 0.0), springs, 0.04, p=rough, shaper=shaper)
    own = 0.01 * 2.0 * 20.0 + ROTOR * limits.torque
    assert 0.9 * 1.5 < R * np.max(one_a - one_b + own) < 1.5


def test_a_map_is_mirrored_and_differentiated():
    x, y = np.array([[-0.1], [0.0], [0.1]]), np.array([[-0.05, 0.08]])
    odd, even = Belts(Frame(0.4, 0.5), 2e4, 2e4, 1e-4), cx.CoreXYParameters(mu_k=0.1)
    given = {"tolerance": 1e-5, "torque": 2.0, "shaper": InputShaper(0.0, "MZV", 150.0, 0.02)}
    for holding in (np.inf, 150.0):
        here = acceleration_limits(even, odd, x, y, direction=(0.6, 0.8), holding=holding, **given)
        there = acceleration_limits(even, odd, -x, y, direction=(-0.6, 0.8), holding=holding, **given)
        other = acceleration_limits(even, odd, x, y, direction=(0.6, -0.8), holding=holding, **given)
        for a, b, c in zip(here, there, other, strict=True):
            assert a.shape == (3, 2)
            np.testing.assert_allclose(a, b, rtol=1e-9)
            assert np.max(np.abs(a / c - 1.0)) > 1e-2

        def limits(x, EA, holding=holding):
            return acceleration_limits(
                even, eqx.tree_at(lambda springs: springs.EA_1, odd, EA), x, 0.08, direction=(0.6, 0.8),
                holding=holding, **given,
            )  # fmt: skip

        np.testing.assert_allclose(jax.vmap(lambda x: limits(x, 2e4))(x[:, 0]), np.stack(here)[:, :, 1])
        for k in range(3):
            slopes = jax.grad(lambda x, EA, k=k: limits(x, EA)[k], (0, 1))(0.03, 2e4)
            for slope, step in zip(slopes, ((1e-5, 0.0), (0.0, 1.0)), strict=True):
                ends = [
                    float(limits(0.03 + sign * step[0], 2e4 + sign * step[1])[k]) for sign in (1, -1)
                ]
                assert float(slope) == pytest.approx((ends[0] - ends[1]) / (2.0 * sum(step)), rel=1e-5)
    twice = acceleration_limits(even, odd, x, y, direction=(3.0, 4.0), **(given | {"tolerance": 2e-5}))
    once = acceleration_limits(even, odd, x, y, direction=(3.0, 4.0), **given)
    np.testing.assert_allclose(twice.ringing, 2.0 * once.ringing, rtol=1e-12)
    np.testing.assert_allclose(twice.slack, once.slack, rtol=1e-12)


def test_limits_that_there_are_not():
    given = {"direction": (1.0, 0.0), "tolerance": 1e-5}
    p = cx.CoreXYParameters()
    assert np.isinf(acceleration_limits(p, ODD, **given).torque)
    assert np.all(np.isnan(acceleration_limits(p, ODD, holding=0.0, torque=1.0, **given)))
    # Friction alone takes the torque; the same machine without it has an acceleration left.
    assert float(acceleration_limits(p, ODD, torque=0.1, **given).torque) == 0.0
    assert float(acceleration_limits(P, ODD, torque=0.1, **given).torque) > 0.0
    ζ_above_one = Belts(Frame(0.3, 0.5), 2e4, 5e4, 0.1)
    shaper = InputShaper(0.0, "ZV", 100.0)
    assert np.isnan(acceleration_limits(p, ζ_above_one, shaper=shaper, **given).slack)
    for wrong, words in (
        ({"direction": (0.0, 0.0)}, r"direction = \(0.0, 0.0\)"),
        ({"tolerance": 0.0}, r"tolerance = 0.0"),
        ({"torque": -1.0}, r"torque = -1.0"),
        ({"shaper": 3.0}, r"shaper = 3.0"),
        ({"shaper": InputShaper(0.0, "ZV", np.array([1.0, 2.0]))}, r"shaper.omega = .* one number"),
    ):
        with pytest.raises((TypeError, ValueError), match=words):
            acceleration_limits(p, ODD, **(given | wrong))
