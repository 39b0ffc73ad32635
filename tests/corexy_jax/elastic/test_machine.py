"""The elastic machine: vibrations, energy, the rigid limit, slack, steppers."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.linalg

import corexy_jax as cx
from corexy_jax.elastic import Belts, ElasticCoreXY, Frame, Stepper, lost_motion, resonances
from tests.corexy_jax.elastic._run import FRICTIONLESS, ROWS, Still, belts, mixed, run


def matrices(p, k):
    """Mass and stiffness in x, y and the angles of the motors."""
    mass = np.diag([0.5 + 8 * 0.2, 1.5 + 4 * 0.2, 1e-3, 1e-3])
    g = np.array([[-1.0, -1.0, 0.05, 0.0], [-1.0, 1.0, 0.0, 0.05]])
    return mass, sum(s * np.outer(row, row) for s, row in zip(k, g, strict=True))


def test_frequencies_are_those_of_the_determinant():
    p = cx.CoreXYParameters()
    found = resonances(p, belts(1e5)).frequencies
    np.testing.assert_allclose(found, [0.0, 0.0, 92.3861916, 93.5146144], atol=5e-8)
    odd = Belts(Frame(0.3, 0.5, 0.1, 0.2), 2e4, 5e4, 1e-4)
    x, y = np.array([[-0.05], [0.1]]), np.array([[0.0, 0.2]])
    found = resonances(p, odd, x, y, holding=20.0)
    for i in np.ndindex(2, 2):
        px, py = 0.1 + x[i[0], 0], 0.2 + y[0, i[1]]
        lengths = [(0.8 - px - py, 0.8 + px + py), (1.1 - px + py, 0.5 + px - py)]
        k = [EA * (1 / a + 1 / b) for EA, (a, b) in zip((2e4, 5e4), lengths, strict=True)]
        mass, elastic = matrices(p, k)
        squares, shapes = scipy.linalg.eigh(elastic + np.diag([0.0, 0.0, 20.0, 20.0]), mass)
        np.testing.assert_allclose(found.frequencies[i], np.sqrt(squares) / (2 * np.pi), rtol=1e-10)
        damping = 0.5 * 1e-4 * np.einsum("ij,ik,kj->j", shapes, elastic, shapes) / np.sqrt(squares)
        np.testing.assert_allclose(found.damping[i], damping, rtol=1e-9)
        kinetic = found.shapes[i] @ np.diag([2.1, 2.3, 0.4, 0.4]) @ np.asarray(found.shapes[i]).T
        np.testing.assert_allclose(kinetic, np.eye(4), atol=1e-9)
    held = resonances(p, belts(1e5), holding=np.inf).frequencies
    rates = 1e5 * 2.0 / np.array([2.3, 2.1])  # both belts, one coordinate
    np.testing.assert_allclose(held, [0.0, 0.0, *(np.sqrt(rates) / (2 * np.pi))], rtol=1e-12)


@pytest.mark.more
def test_small_motions_of_the_declaration_have_these_frequencies():
    p, odd = cx.CoreXYParameters(**FRICTIONLESS), Belts(Frame(0.3, 0.5, 0.1, 0.2), 2e4, 5e4)
    machine = ElasticCoreXY(p, odd)
    y = machine.at(0.05, 0.1)._replace(v_x=0.3, v_y=0.2, v_one=0.1, v_two=-0.05)
    y = jax.tree.map(lambda a: jnp.asarray(a, jnp.float64), y)
    mode = machine.initial_mode(0.0, y, None)

    def field(row):
        return jnp.stack(machine.vector_field(jnp.asarray(0.0), type(y)(*row), mode, None))

    rates = np.linalg.eigvals(np.asarray(jax.jacfwd(field)(jnp.stack(y))))
    found = np.sort(np.abs(rates.imag))[4::2] / (2.0 * np.pi)
    np.testing.assert_allclose(found, resonances(p, odd, 0.05, 0.1).frequencies[2:], rtol=1e-10)


@pytest.mark.more
@pytest.mark.parametrize("speed", [0.02, 0.4])
def test_energy_stays_without_friction_and_through_slack(speed):
    p, k = cx.CoreXYParameters(**FRICTIONLESS), belts(1e5)
    rng = np.random.default_rng(0)
    vx, vy, one, two = rng.uniform(-speed, speed, 4)
    start = ElasticCoreXY(p, k).at(0.03, -0.02)._replace(v_x=vx, v_y=vy, v_one=one, v_two=two)
    machine, found = run(p, k, mixed(), start, 0.2)
    energy = jax.vmap(machine.energy)(found.outputs.y)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-10)
    least = np.min(np.stack(jax.vmap(machine.tensions)(found.outputs.y)))
    assert (least == 0.0) == (speed > 0.1)


def sines(t, args):
    """Those of `Mixed`."""
    one = 10.0 * jnp.sin(jnp.pi * t)
    return one, 0.5 * one


@pytest.mark.more
def test_stiff_belts_are_the_machine_that_rolls():
    """All friction included; the difference is of first order in 1/EA."""
    p = cx.CoreXYParameters(mu_s=0.1, mu_1s_b=1e3, mu_2s_b=1e3)
    rigid = cx.simulate(p, cx.UserVoltage(sines, shortest=0.3), 0.4, rows=ROWS)
    assert np.all(np.asarray(rigid.dmn) == 1)
    off = []
    for k in (2e6, 2e7):
        _, found = run(p, belts(k, 2e-5, 8.0), mixed(volts=1.0), ElasticCoreXY(p, belts(k)).at(), 0.4)
        off.append([np.max(np.abs(getattr(found.outputs.y, n) - getattr(rigid.y, n))) for n in "xy"])
    assert np.max(off[1]) < 1e-6 * float(rigid.y.x[-1])
    assert np.all(np.array(off[0]) > 8.0 * np.array(off[1]))


@pytest.mark.more
def test_a_stepper_lags_by_its_load_and_falls_out_of_step_beyond():
    """At rest under a torque, running under its damping, and faster than it can."""
    p, k, r = cx.CoreXYParameters(**FRICTIONLESS), belts(1e5, 1e-3, 8.0), 0.05
    still = ElasticCoreXY(p, k).at()
    rows = ((0.0, 2.5, 2.5), (40.0, 0.0, 2.0), (40.0, 1.0, 3.0), (90.0, 0.0, None))
    for speed, load, total in rows:
        v = speed * r
        drive = mixed(Still(vx=v), torque=4.0, damping=0.05, share=1.0, load=-load)
        _, found = run(p, k, drive, still._replace(v_x=v, v_one=v, v_two=v), 2.0)
        angles = found.y1.one / r, found.y1.two / r
        lag, lost = (f(2.0, angles)[0] for f in (drive.stepper.lags, drive.stepper.lost_steps))
        if total is None:
            assert float(lost) >= 8.0
            assert float(lost) % 4.0 == 0.0
        else:
            assert float(lag) == pytest.approx(np.arcsin(total / 4.0) / 50.0, abs=1e-8)
            assert float(lost) == 0.0
    assert float(drive.stepper.stiffness) == pytest.approx(200.0)


@pytest.mark.parametrize(("axis", "P2", "EA_2"), [("x", 20.5, 2.1e4), ("y", 26.0, 3e4)])
def test_a_slow_motion_that_turns_back_loses_what_the_closed_form_says(axis, P2, EA_2):
    """The head lags behind its command by friction; turned round, it lags the other way."""
    p = cx.CoreXYParameters(mu_s=0.1, mu_k=0.1, P1=20.0, P2=P2)
    odd = Belts(Frame(0.5, 0.4, 0.2, 0.2), 2e4, EA_2, 3e-3)
    at, speed = (0.04, 0.03), 0.002
    y = ElasticCoreXY(p, odd).at(*at)
    lag, place = [], list(at)
    for way in (speed, -speed):
        drive = mixed(Still(*place, **{f"v{axis}": way}), torque=40.0, share=1.0)
        _, found = run(p, odd, drive, y, 0.5)
        y, place["xy".index(axis)] = found.y1, place["xy".index(axis)] + 0.5 * way
        lag.append(place["xy".index(axis)] - float(getattr(y, axis)))
    there = at if way > 0 else place
    expected = lost_motion(p, odd, *there, holding=50 * 40.0)["xy".index(axis)]
    assert lag[0] - lag[1] == pytest.approx(float(expected), rel=1e-3)
    rigid = lost_motion(p, odd, *there)["xy".index(axis)]
    assert 1.05 * float(rigid) < float(expected)
    # Belts so different that a motion along x drags y along have no answer for it.
    assert np.isnan(lost_motion(p, odd, *there)[0]) == (axis == "y")


def test_wrong_arguments_are_named():
    p = cx.CoreXYParameters()
    for call, words in (
        (lambda: Frame(-0.4, 0.4), r"width = -0.4"),
        (lambda: Belts(Frame(0.4, 0.4), 0.0, 1e4), r"EA_1 = 0.0"),
        (lambda: ElasticCoreXY(p, None), r"belts = None"),
        (lambda: ElasticCoreXY(p, belts(1e5), drive=3.0), r"drive = 3.0"),
        (lambda: resonances(p, belts(1e5), holding=-1.0), r"holding = -1.0"),
        (lambda: Stepper(Still(), 1.0, 0.05, steps=202), r"steps = 202"),
    ):
        with pytest.raises((TypeError, ValueError), match=words):
            call()
