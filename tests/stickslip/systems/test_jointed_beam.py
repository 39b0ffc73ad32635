"""The jointed beam: closed forms, energy, conversions, errata, and SciPy for comparison."""

import functools
import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb, LuGre, Regularised
from stickslip.systems import BeamScales, JointedBeam, JointedBeamState

from . import _jointed_beam_reference as reference
from ._jointed_beam_reference import PARAMETERS

STEEL = BeamScales(EI=2.1e3, L=1.7, rhoA=3.2)
MODES = ("backward", "stick", "forward", "apart")  # the reference's words, in the system's order


def powers(system, t, y, mode, args):
    return system.powers(t, y, mode, args)


@eqx.filter_jit
def program(ledger, ts, y0, tolerance):
    """The one simulation of this file: outputs, events and the work of all powers."""
    step = ss.AdaptiveStep(tolerance, 1e-6 * tolerance)
    return ss.simulate(
        ledger, 0.0, ts[-1], y0, integrator=ss.Integrator(step=step, max_steps=1_000_000),
        saveat=ss.SaveAt(ts=ts, max_events=2048),
    )  # fmt: skip


def run(system, t_end, y0=None, tolerance=1e-12):
    ledger = WithIntegrals(system, powers)
    start = ledger.start(system.start() if y0 is None else y0)
    return program(ledger, jnp.linspace(0.0, t_end, 201), start, jnp.asarray(tolerance))


@functools.cache
def motion(v, t_end=20.0):
    return run(JointedBeam.constructed(v), t_end)


def some_state(seed=0, modes=5):
    r = np.random.default_rng(seed)
    numbers = [jnp.asarray(a) for a in 1e-3 * r.standard_normal(4)]
    q, p = jnp.asarray(1e-3 * r.standard_normal((2, modes)))
    return JointedBeamState(*numbers, q, p)._replace(x=jnp.asarray(8e-4))


@eqx.filter_jit
def _stiffness_over_mass(system):
    def accelerations(z):
        y = system.start(-1e-3)._replace(y=z[0], q=z[1:])
        dy = system.vector_field(0.0, y, system.mode_names.index("no contact"), None)
        return -jnp.concatenate([dy.vy[None], dy.p])

    return jax.jacfwd(accelerations)(jnp.zeros(1 + system.modes))


def stiffness_over_mass(system):
    """Matrix A of the motion without contact, in (y, q): the accelerations are -A (y, q)."""
    return np.asarray(_stiffness_over_mass(system))


# Closed forms


def test_frequencies_of_the_beam_alone():
    system = JointedBeam.constructed(1e-3, k1=1e-12, modes=7)
    free = np.sqrt(np.linalg.eigvalsh(stiffness_over_mass(system)[1:, 1:]))
    np.testing.assert_allclose(free, [(i * np.pi) ** 2 for i in range(1, 8)], rtol=1e-12)
    steel = JointedBeam(
        m=1.0, k1=1e-9, k2=1.0, k3=1.0, mu_s=0.1, gamma=0.0, v=1.0, z_A=0.5, scales=STEEL
    )
    exact = [(i * np.pi / 1.7) ** 2 * np.sqrt(2.1e3 / 3.2) for i in range(1, 6)]
    np.testing.assert_allclose(steel.frequencies(), exact, rtol=1e-14)


def test_frequencies_with_the_joint_are_the_zeros_of_the_secular_equation():
    """Receptances of beam, spring and mass in series: their sum is zero at an eigenfrequency."""
    system = JointedBeam.constructed(1e-3, k1=40.0)
    squares = np.linalg.eigvals(stiffness_over_mass(system))
    assert np.allclose(squares.imag, 0.0)
    found = np.sort(np.sqrt(squares.real))
    phi2 = 2 * np.sin(np.arange(1, 6) * np.pi * 0.4) ** 2
    omega2 = (np.arange(1, 6) * np.pi) ** 4

    def secular(w):
        return 1 / 40.0 - 1 / (0.1 * w * w) + np.sum(phi2 / (omega2 - w * w))

    # The joint does not touch the fifth mode, which has a node at 0.4.
    poles = np.sqrt(omega2[:4])
    edges = [1e-2, *poles, 1e4]
    zeros = [
        brentq(secular, a * (1 + 1e-12), b * (1 - 1e-12), xtol=1e-14)
        for a, b in itertools.pairwise(edges)
    ]
    np.testing.assert_allclose(found, np.sort([*zeros, np.sqrt(omega2[4])]), rtol=1e-10)


@pytest.mark.more
def test_free_response_of_the_beam():
    """Let go from two modes: each swings by itself, the energy stays."""
    system = JointedBeam.constructed(1e-3, k1=1e-14, mu_s=0.0)
    y0 = system.start()._replace(vy=jnp.asarray(0.0), q=jnp.array([1e-3, 0.0, -2e-4, 0.0, 1e-5]))
    solution = run(system, 10.0, y0)
    t = np.linspace(0, 10.0, 201)[:, None]
    exact = np.asarray(y0.q) * np.cos((np.arange(1, 6) * np.pi) ** 2 * t)
    np.testing.assert_allclose(solution.outputs.y.y.q, exact, rtol=0, atol=1e-13)


def test_static_deflection_converges_to_that_of_the_beam():
    """The mass held at y = 1: w_A = k1 c/(1 + k1 c), c = a^2 (1 - a)^2/3; the error falls as n^-3."""
    k1, a = 30.0, 0.37
    c = a**2 * (1 - a) ** 2 / 3
    exact = k1 * c / (1 + k1 * c)

    def deflection(n, **words):
        system = JointedBeam.constructed(1e-3, k1=k1, z_A=a, modes=n, **words)
        A = stiffness_over_mass(system)
        q = np.linalg.solve(A[1:, 1:], -A[1:, 0])
        return np.sqrt(2) * np.sin(np.arange(1, n + 1) * np.pi * a) @ q

    numbers = np.array([8, 16, 64])
    errors = np.array([abs(deflection(int(n)) - exact) for n in numbers])
    order = -np.polyfit(np.log(numbers), np.log(errors), 1)[0]
    assert 2.7 < order < 3.3
    assert errors[-1] < 1e-5 * exact
    # The planted error: as printed the projection does not converge to the beam.
    assert abs(deflection(64, coupling="printed") - exact) > 0.03 * exact


@pytest.mark.more
def test_period_of_the_contact_oscillator():
    """x: half a swing on both springs, half a swing on one; no depth dependence, no effect of y."""
    period = np.pi * np.sqrt(0.1 / 30.4) + np.pi * np.sqrt(0.1 / 7.6)
    events = motion(5e-3).events
    times = np.asarray(events.t[: int(events.count)])
    touches = times[np.asarray(events.mode_before[: times.size]) == 3]
    assert touches.size == 37
    np.testing.assert_allclose(np.diff(touches), period, rtol=1e-11)


# Energy


@pytest.mark.more
def test_energy_stays_without_friction():
    """Over 100 periods of the first mode, contact opening and closing all the time."""
    system = JointedBeam.constructed(5e-3, mu_s=0.0)
    y0 = system.start()._replace(q=jnp.array([2e-3, 1e-4, 0.0, 1e-5, 0.0]))
    solution = run(system, 100 * 2 / np.pi, y0, tolerance=1e-11)
    energy = np.asarray(jax.vmap(system.energy)(solution.outputs.y.y))
    assert int(solution.num_events) > 200
    assert np.ptp(energy) < 1e-9 * energy[0]


@pytest.mark.more
@pytest.mark.parametrize("v", [5e-4, 5e-3])
def test_energy_is_the_work_of_the_powers(v):
    system, solution = JointedBeam.constructed(v), motion(v)
    y, work = solution.outputs.y
    gain = np.asarray(jax.vmap(system.energy)(y)) - float(system.energy(system.start()))
    total = sum(np.asarray(w) for w in work.values())
    assert set(work) == {"belt", "friction", "damping"}
    assert np.max(np.abs(gain - total)) < 1e-9 * np.max(np.abs(work["belt"]))
    assert np.all(np.diff(work["friction"]) <= 0.0)
    assert float(work["friction"][-1]) < -1e-9


@pytest.mark.more
def test_powers_of_the_printed_equations_add_up():
    """Rate of the energy along the field, in every mode, damped and as printed."""
    for words in ({}, {"joint": "printed"}, {"coupling": "printed"}, {"shape": "printed"}):
        system = JointedBeam.constructed(2e-3, damping=0.02, **words)
        for mode in range(4):
            y = some_state(mode)
            y = y._replace(x=-y.x) if mode == 3 else y
            y = y._replace(vy=system.v) if mode == 1 else y
            dy = system.vector_field(0.0, y, mode, None)
            rate = jax.jvp(system.energy, (y,), (dy,))[1]
            given = system.powers(0.0, y, mode, None)
            np.testing.assert_allclose(sum(given.values()), rate, rtol=1e-12, atol=1e-18)
            assert ("inconsistency" in given) == (words not in ({}, {"shape": "printed"}))


def test_power_through_the_joint_is_what_the_beam_gains_and_loses():
    """Beside the rate of the energy of the modes, of unit modal mass, along the field."""
    system = JointedBeam.constructed(2e-3, damping=0.02)

    def of_the_beam(y):
        modes = jnp.sum(y.p**2 + (system.frequencies() * y.q) ** 2)
        return 0.5 * system.scales.mass * modes

    for mode in range(4):
        y = some_state(mode)
        rate = jax.jvp(of_the_beam, (y,), (system.vector_field(0.0, y, mode, None),))[1]
        powers = system.powers(0.0, y, mode, None)
        given = system.beam_power(0.0, y, mode)
        assert abs(given) > 1e-6 * abs(powers["damping"])
        np.testing.assert_allclose(given + powers["damping"], rate, rtol=1e-12)
        np.testing.assert_allclose(system.friction_power(0.0, y, mode), powers["friction"], rtol=1e-12)


# An independent integrator


def compare(solution, v, **options):
    """Largest difference to SciPy by component, relative to the component's size; events too."""
    t = np.linspace(0.0, 20.0, 201)
    expected = reference.simulate(v, t, **options)
    y = solution.outputs.y.y
    states = np.concatenate([np.stack([y.x, y.vx, y.y, y.vy], axis=1), y.q, y.p], axis=1)
    # The fifth mode has a node at the joint and never moves: coordinates are compared as a group.
    groups = [slice(0, 1), slice(1, 2), slice(2, 3), slice(3, 4), slice(4, 9), slice(9, 14)]
    for g in groups:
        size = np.abs(expected.y[:, g]).max()
        assert np.max(np.abs(states[:, g] - expected.y[:, g])) < 1e-8 * size
    events = solution.events
    count = int(events.count)
    assert [MODES[m] for m in events.mode_after[:count]] == [name for _, name in expected.phases[1:]]
    times = [time for time, _ in expected.phases[1:]]
    np.testing.assert_allclose(events.t[:count], times, rtol=0, atol=1e-8)


@pytest.mark.more
@pytest.mark.parametrize("v", [5e-4, 5e-3])
def test_motion_and_events_against_scipy(v):
    """Stick-slip, and the range where the diagram bifurcates, over 20 units of time."""
    compare(motion(v), v)


@pytest.mark.slow
@pytest.mark.parametrize("v", [2e-3, 2e-2])
def test_more_motion_against_scipy(v):
    compare(motion(v), v)


@pytest.mark.slow
@pytest.mark.parametrize("v", [5e-4, 5e-3])
def test_motion_as_printed_against_scipy(v):
    compare(run(JointedBeam.printed(v), 20.0), v, printed=True)


@pytest.mark.slow
def test_derivative_by_the_belt_speed_through_all_events():
    # Fixed steps: a step length that answers to v makes the difference of two runs noisy.
    steps = ss.Integrator("dop853", ss.FixedStep(0.005), max_steps=100_000)

    def end(v):
        system = JointedBeam.constructed(v)
        run = ss.simulate(
            system, 0.0, 3.0, system.start(), saveat=ss.SaveAt(max_events=None), integrator=steps
        )
        return run.y1.y

    slope, step = jax.jit(jax.jacfwd(end))(5e-4), 1e-9
    program = jax.jit(end)
    difference = (program(5e-4 + step) - program(5e-4 - step)) / (2 * step)
    np.testing.assert_allclose(slope, difference, rtol=1e-7)


# Other laws


@pytest.mark.more
def test_coulomb_friction_against_scipy():
    """The paper's law without weakening, given as a law of its own; the numbers of the paper's play no
    part then."""
    law = Coulomb(PARAMETERS["mu_s"])
    system = JointedBeam.constructed(5e-4, law=law, mu_s=0.9, gamma=77.0)
    compare(run(system, 20.0), 5e-4, gamma=0.0)


def test_a_law_that_the_beam_does_not_take():
    for law in (Regularised(Coulomb(0.3), 1e-3), LuGre(Coulomb(0.3), 1e4), 0.3):
        with pytest.raises((TypeError, ValueError), match=r"^law = .*: it must be a .*law"):
            JointedBeam.constructed(5e-4, law=law)
    with pytest.raises(ValueError, match=r"^law = Coulomb: it must be None"):
        JointedBeam.constructed(5e-4, law=Coulomb(0.3)).dimensional(STEEL)


# Conversion (2.9)


def test_conversion_both_ways():
    plain = JointedBeam.constructed(5e-3, damping=0.01)
    steel = plain.dimensional(STEEL)
    assert steel.units == {"x": "m", "vx": "m/s", "y": "m", "vy": "m/s", "q": "m", "p": "m/s"}
    assert set(plain.units.values()) == {"1"}
    # Written out from (2.9), not by the class that is tested.
    EI, L, rhoA = 2.1e3, 1.7, 3.2
    factors = {
        "m": rhoA * L, "k1": EI / L**3, "k2": EI / L**3, "k3": EI / L**3, "mu_s": 1.0, "z_A": L,
        "gamma": np.sqrt(rhoA / EI) * L, "v": np.sqrt(EI / rhoA) / L, "damping": 1.0,
    }  # fmt: skip
    for name, factor in factors.items():
        np.testing.assert_allclose(getattr(steel, name), factor * getattr(plain, name), rtol=1e-14)
    back = steel.dimensionless()
    assert back.is_dimensionless
    for name in factors:
        np.testing.assert_allclose(getattr(back, name), getattr(plain, name), rtol=1e-14)
    time = L**2 * np.sqrt(rhoA / EI)
    for mode in range(4):
        y = some_state(mode)
        y_steel = steel.state_in_units(y)
        slope = steel.vector_field(0.0, y_steel, mode, None)
        expected = plain.vector_field(0.0, y, mode, None)
        for a, b in zip(slope, steel.state_in_units(expected), strict=True):
            np.testing.assert_allclose(a, b / time, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(steel.energy(y_steel), plain.energy(y) * EI / L, rtol=1e-13)
        for a, b in zip(steel.state_dimensionless(y_steel), y, strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-14)
    units = STEEL
    np.testing.assert_allclose(
        [units.force, units.power, units.time], [EI / L**2, EI / L * time**-1, time], rtol=1e-14
    )


# Errata


@pytest.mark.parametrize("word", ["joint", "friction", "shape", "coupling"])
def test_each_erratum_changes_its_term_alone(word):
    y, mode = some_state(3), 0
    y = y._replace(vy=jnp.asarray(-2e-2))
    system = JointedBeam.constructed(5e-3, **{word: "printed"})
    base = JointedBeam.constructed(5e-3)
    slope, plain = (s.vector_field(0.0, y, mode, None) for s in (system, base))
    i = np.arange(1, 6)
    phi = (1.0 if word == "shape" else np.sqrt(2)) * np.sin(i * np.pi * 0.4)
    k = 7.6 if word == "joint" else 0.25
    q = np.asarray(y.q)
    pull = k * phi * (float(y.y) - (phi * q if word == "coupling" else phi @ q))
    np.testing.assert_allclose(slope.p, pull - (i * np.pi) ** 4 * q, rtol=1e-12)
    factor = 1 - 10 * 2.5e-2 if word == "friction" else 1 + 10 * 2.5e-2
    friction = 0.3 * 22.8 * 8e-4 / factor
    np.testing.assert_allclose(slope.vy, (friction - 0.25 * (float(y.y) - phi @ q)) / 0.1, rtol=1e-12)
    assert float(slope.vx) == float(plain.vx)


# Modes


def test_initial_modes():
    system = JointedBeam.constructed(5e-3)
    rest = system.start()
    cases = {
        "stick": rest,
        "slip forward": rest._replace(vy=6e-3),
        "slip backward": rest._replace(y=1.0),
        "no contact": rest._replace(x=-1e-4),
    }
    cases2 = {
        "slip forward": rest._replace(y=-1.0),
        "slip backward": rest._replace(vy=4e-3),
        "no contact": rest._replace(x=0.0, vx=-1e-3),
    }
    for table in (cases, cases2):
        for name, y in table.items():
            assert system.mode_names[int(system.initial_mode(0.0, y, None))] == name


# Bad input

GOOD = dict(m=0.1, k1=0.25, k2=7.6, k3=22.8, mu_s=0.3, gamma=10.0, v=5e-4, z_A=0.4)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, -1.0) for name in GOOD if name != "v"),
        *((name, float("nan")) for name in GOOD),
        ("m", 0.0), ("k1", 0.0), ("k2", 0.0), ("z_A", 0.0), ("z_A", 1.0),
        ("damping", -0.1), ("modes", 0), ("modes", 2.5), ("modes", True),
        ("joint", "wrong"), ("friction", "as printed"), ("shape", None), ("coupling", 1),
    ],
)  # fmt: skip
def test_wrong_parameter(name, value):
    JointedBeam(**GOOD)
    with pytest.raises(ValueError, match=rf"^{name}.* = .*: it must be "):
        JointedBeam(**{**GOOD, name: value})


def test_other_bad_input():
    with pytest.raises(TypeError, match=r"scales = \(1.0, 1.0, 1.0\): it must be a BeamScales"):
        JointedBeam(**GOOD, scales=(1.0, 1.0, 1.0))
    for name in ("EI", "L", "rhoA"):
        with pytest.raises(ValueError, match=rf"^{name} = 0.0: it must be finite and positive"):
            BeamScales(**{name: 0.0})
    with pytest.raises(ValueError, match="must be a dimensionless one"):
        JointedBeam(**GOOD, scales=STEEL).dimensional(STEEL)
    with pytest.raises(ValueError, match=r"^z_A = .*: it must be inside the beam"):
        JointedBeam(**{**GOOD, "z_A": 1.8}, scales=STEEL)
    with pytest.raises(ValueError, match="x = inf: it must be finite"):
        JointedBeam(**GOOD).start(float("inf"))


def test_parameters_are_batched():
    speeds = jnp.array([1e-3, 2e-3])
    batch = jax.vmap(lambda v: JointedBeam.constructed(v).vector_field(0.0, some_state(), 0, None).vy)
    single = [JointedBeam.constructed(v).vector_field(0.0, some_state(), 0, None).vy for v in speeds]
    np.testing.assert_allclose(batch(speeds), jnp.stack(single), rtol=1e-14)
