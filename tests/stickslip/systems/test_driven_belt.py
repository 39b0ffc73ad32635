"""The drive alone, and the block on the belt that it moves, against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.systems import (
    BlockOnDrivenBelt,
    BlockOnDrivenBeltSetValued,
    DCDrive,
    DrivenBlockState,
    DriveState,
    mean_belt_speed,
    voltage_for_belt_speed,
)

from ._block_reference import Reference, drive_parameters, poincare, solve

AT_REST = DrivenBlockState(x=0.0, vx=0.0, y=0.0, vy=0.0, omega=0.0, i_w=0.0)
RUNNING = DrivenBlockState(x=0.03, vx=0.0, y=-0.01, vy=0.0, omega=80.0, i_w=0.15)
STANDING = DriveState(omega=0.0, i_w=0.0)


def run(system, t_end, y0, **options):
    return ss.simulate(
        system,
        0.0,
        t_end,
        y0,
        saveat=ss.SaveAt(sections=system.zero_acceleration_section(), max_crossings=64),
        **options,
    )


@pytest.mark.more
def test_too_small_a_voltage_never_turns_the_drive():
    """k_m U/R_w = T_st is the border: 0.2 V for the constructed drive."""
    end = ss.simulate(DCDrive.constructed(U_in=0.199), 0.0, 5.0, STANDING)
    assert int(end.num_events) == 0
    assert float(end.y1.omega) == 0.0
    np.testing.assert_allclose(float(end.y1.i_w), 0.199 / 2.0, rtol=1e-9)


def test_drive_starts_when_its_current_suffices():
    """While the rotor rests, i = U/R (1 - exp(-R t/L))."""
    end = ss.simulate(DCDrive.constructed(U_in=4.0, T_st=8e-3), 0.0, 1.0, STANDING)
    assert int(end.num_events) == 1
    start = -1e-3 * np.log(1 - 8e-3 / 0.05 / 2.0)
    np.testing.assert_allclose(float(end.events.t[0]), start, rtol=1e-10)
    # Steady: U - k_e w - R i = 0 and k_m i = b w + T_k.
    w = (4.0 - 2.0 * 5e-3 / 0.05) / (0.05 + 2.0 * 2e-5 / 0.05)
    np.testing.assert_allclose(float(end.y1.omega), w, rtol=1e-8)


def test_reversed_voltage_brakes_to_rest_and_turns_back():
    drive = DCDrive.constructed(U_in=-4.0, T_st=6e-3)
    end = ss.simulate(drive, 0.0, 1.0, DriveState(omega=80.0, i_w=0.1))
    assert [drive.mode_names[m] for m in end.events.mode_after[: int(end.num_events)]] == [
        "turning backward"
    ]
    # Without supply and with the winding open in effect, friction alone stops the rotor for good.
    coasting = DCDrive.constructed(U_in=0.0, k_e=0.0, k_m=0.0, b=0.0)
    stopped = ss.simulate(coasting, 0.0, 1.0, DriveState(omega=80.0, i_w=0.0))
    inertia = 5e-5 + 1e-4 / (0.6 * 400)
    np.testing.assert_allclose(float(stopped.events.t[0]), 80.0 * inertia / 5e-3, rtol=1e-10)
    assert coasting.mode_names[int(stopped.mode1)] == "resting"
    assert float(stopped.y1.omega) == 0.0


def test_printed_motor_friction_accelerates():
    """B-E1: as printed, a rotor without supply speeds up by its own friction."""
    options = {"U_in": 0.0, "k_e": 0.0, "k_m": 0.0, "b": 0.0, "motor_friction": "printed"}
    end = ss.simulate(DCDrive.constructed(**options), 0.0, 0.1, DriveState(omega=1.0, i_w=0.0))
    inertia = 5e-5 + 1e-4 / (0.6 * 400)
    np.testing.assert_allclose(float(end.y1.omega), 1.0 + 0.1 * 5e-3 / inertia, rtol=1e-10)


@pytest.fixture(scope="module")
def signs():
    """The coupled model with both signs of the belt's reaction, with the work of every power."""
    out = {}
    for sign in ("consistent", "printed"):
        system = BlockOnDrivenBelt.constructed(k3=85.0, drive=DCDrive.constructed(belt_reaction=sign))
        names = ("supply", "motor", "gear", "contact", "dampers")
        ledger = WithIntegrals(system, BlockOnDrivenBelt.powers, units=dict.fromkeys(names, "J"))
        out[sign] = system, ss.simulate(ledger, 0.0, 3.0, ledger.start(RUNNING))
    return out


@pytest.mark.more
@pytest.mark.parametrize("sign", ["consistent", "printed"])
def test_every_joule_of_the_full_model_is_accounted_for(signs, sign):
    system, end = signs[sign]
    work = {name: float(value) for name, value in end.y1.integrals.items()}
    before = system.energy(DrivenBlockState(*map(jnp.asarray, RUNNING)))
    gain = float(system.energy(end.y1.y) - before)
    assert abs(sum(work.values()) - gain) < 1e-9 * work["supply"]
    assert work["supply"] > 0 > max(work["motor"], work["dampers"])


@pytest.mark.more
def test_printed_sign_of_the_belt_force_creates_energy(signs):
    """B-E2: friction must take energy out of block and belt together."""
    work = {sign: float(end.y1.integrals["contact"]) for sign, (_, end) in signs.items()}
    assert work["consistent"] < -0.01
    assert work["printed"] > 0.1


@pytest.mark.more
@pytest.mark.parametrize(("sign", "factor"), [("consistent", 1.0), ("printed", -1.0)])
def test_full_motion_is_scipys(signs, sign, factor):
    system, end = signs[sign]
    model = Reference(85.0, drive=drive_parameters(float(system.drive.U_in), reaction=factor))
    expected = solve(model.full, list(RUNNING), 3.0, tol=1e-11).y[:, -1]
    np.testing.assert_allclose(np.array(end.y1.y)[:4], expected[:4], rtol=0, atol=1e-8)
    np.testing.assert_allclose(np.array(end.y1.y)[4:], expected[4:], rtol=1e-8)


@pytest.mark.more
def test_poincare_points_of_the_full_model_are_scipys():
    system = BlockOnDrivenBelt.constructed(k3=80.0)
    # One acceleration passes zero so slowly that an error of 1e-12 moves the point by 1e-11 m.
    precise = ss.Integrator(step=ss.AdaptiveStep(1e-12, 1e-12))
    solution = run(system, 3.0, RUNNING, integrator=precise)
    model = Reference(80.0, drive=drive_parameters(float(system.drive.U_in)))
    times, states, _ = poincare(model, model.full, list(RUNNING), 3.0)
    (crossings,) = solution.crossings
    count = int(crossings.count)
    assert count == len(times) > 2
    np.testing.assert_allclose(crossings.y.x[:count], states[:, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(crossings.t[:count], times, rtol=0, atol=1e-8)


@pytest.fixture(scope="module")
def dry():
    system = BlockOnDrivenBeltSetValued.constructed(k3=85.0)
    names = ("supply", "motor", "gear", "contact", "dampers")
    ledger = WithIntegrals(system, BlockOnDrivenBeltSetValued.powers, units=dict.fromkeys(names, "J"))
    return system, ss.simulate(ledger, 0.0, 3.0, ledger.start(AT_REST))


@pytest.mark.more
def test_set_valued_full_model_starts_from_rest(dry):
    """Block and rotor rest; the rotor breaks loose and takes the block along until it slips."""
    system, end = dry
    names = [system.mode_names[m] for m in end.events.mode_after[: int(end.num_events)]]
    assert names[0].startswith("turning forward")
    assert {"turning forward, stick", "turning forward, slip backward"} <= set(names)
    assert all(name.startswith("turning forward") for name in names)
    work = {name: float(value) for name, value in end.y1.integrals.items()}
    before = system.energy(DrivenBlockState(*map(jnp.asarray, AT_REST)))
    gain = float(system.energy(end.y1.y) - before)
    assert abs(sum(work.values()) - gain) < 1e-9 * work["supply"]
    assert work["contact"] < 0


class ByHand(BlockOnDrivenBeltSetValued):
    """The same system with the modes tried one after the other, as for signs as printed."""

    @property
    def _printed(self):
        return True


@pytest.mark.more
@pytest.mark.parametrize(
    ("changes", "y0"),
    [
        pytest.param({}, AT_REST, marks=pytest.mark.slow),
        pytest.param({}, RUNNING, marks=pytest.mark.slow),
        ({"U_in": 0.7, "T_st": 8e-3}, RUNNING),
        ({"U_in": 0.199}, AT_REST._replace(x=0.05)),
    ],
    ids=["from rest", "running", "drive comes to rest", "drive never starts"],
)
def test_declared_modes_are_those_tried_by_hand(changes, y0):
    drive = DCDrive.constructed(**changes)
    tight = ss.Integrator(step=ss.AdaptiveStep(1e-12))
    declared, tried = (
        ss.simulate(kind.constructed(k3=85.0, drive=drive), 0.0, 3.0, y0, integrator=tight)
        for kind in (BlockOnDrivenBeltSetValued, ByHand)
    )
    count = int(tried.num_events)
    assert count == int(declared.num_events) >= 1
    np.testing.assert_array_equal(declared.events.mode_after, tried.events.mode_after)
    np.testing.assert_allclose(declared.events.t[:count], tried.events.t[:count], rtol=0, atol=1e-10)
    np.testing.assert_allclose(declared.y1[:4], tried.y1[:4], rtol=0, atol=1e-10)
    np.testing.assert_allclose(declared.y1.omega, tried.y1.omega, rtol=1e-10, atol=1e-9)
    np.testing.assert_allclose(declared.y1.i_w, tried.y1.i_w, rtol=0, atol=1e-9)


@pytest.mark.more
@pytest.mark.parametrize(
    "signs",
    [
        {"belt_reaction": "printed"},
        pytest.param({"motor_friction": "printed"}, marks=pytest.mark.slow),
    ],
)
def test_printed_signs_of_the_set_valued_model_create_energy(signs):
    drive = DCDrive.constructed(U_in=2.0, **signs)
    system = BlockOnDrivenBeltSetValued.constructed(k3=85.0, drive=drive)
    names = ("supply", "motor", "gear", "contact", "dampers")
    ledger = WithIntegrals(system, BlockOnDrivenBeltSetValued.powers, units=dict.fromkeys(names, "J"))
    end = ss.simulate(ledger, 0.0, 2.0, ledger.start(RUNNING)).y1
    start = DrivenBlockState(*map(jnp.asarray, RUNNING))
    gain = float(system.energy(end.y) - system.energy(start))
    work = {name: float(value) for name, value in end.integrals.items()}
    assert abs(sum(work.values()) - gain) < 1e-9 * max(map(abs, work.values()))
    assert (work["contact"] > 0.0) == ("belt_reaction" in signs)
    with pytest.raises(ValueError, match=r"belt_reaction, motor_friction = .*printed"):
        ss.simulate(system.regularised(1e-2), 0.0, 1.0, RUNNING)


@pytest.mark.more
@pytest.mark.parametrize("form", ["regularised", pytest.param("bristles", marks=pytest.mark.slow)])
def test_every_joule_of_a_smooth_form_is_accounted_for(form):
    """From slip and from belt at rest: friction of block and bearing, gear, winding and dampers."""
    machine = BlockOnDrivenBeltSetValued.constructed(k3=85.0)
    if form == "regularised":
        system = machine.regularised(1e-2)
        start = DrivenBlockState(*map(jnp.asarray, AT_REST))
    else:
        system = machine.bristles(sigma_0=1e3, sigma_1=1.0, v_s=1e-2)
        start = system.start(DrivenBlockState(*map(jnp.asarray, AT_REST)))
    names = ("supply", "motor", "gear", "contact", "dampers")
    ledger = WithIntegrals(system, type(system).powers, units=dict.fromkeys(names, "J"))
    end = ss.simulate(ledger, 0.0, 0.4, ledger.start(start)).y1
    work = {name: float(value) for name, value in end.integrals.items()}
    assert set(work) == set(names)
    gain = float(system.energy(end.y) - system.energy(start))
    assert work["supply"] > 0.1 > 1e-3 > max(work["motor"], work["contact"], work["dampers"])
    assert abs(sum(work.values()) - gain) < 1e-9 * work["supply"]


@pytest.mark.slow
def test_set_valued_full_model_is_the_limit_of_the_smooth_one(dry):
    _, end = dry

    @jax.vmap
    def smooth(alpha):
        law = BlockOnDrivenBelt.constructed(k3=85.0).law
        law = type(law)(law.mu_0, alpha, law.beta, law.gamma)
        system = BlockOnDrivenBelt.constructed(k3=85.0, law=law)
        return ss.simulate(system, 0.0, 3.0, AT_REST).y1

    ends = smooth(jnp.array([2e3, 8e3]))
    far, near = np.abs(np.array(ends).T - np.array(end.y1.y))
    assert np.all(near[:4] < 0.6 * far[:4])
    assert np.all(near[:4] < 5e-3)


@pytest.mark.slow
def test_forward_derivative_of_the_full_model_is_that_of_differences():
    def end(U_in):
        drive = DCDrive.constructed(U_in=U_in)
        system = BlockOnDrivenBeltSetValued.constructed(k3=85.0, drive=drive)
        steps = ss.Integrator(method="rk4", step=ss.FixedStep(5e-4))
        y1 = ss.simulate(system, 0.0, 1.5, AT_REST, integrator=steps).y1
        return jnp.stack([y1.x, y1.vx, y1.omega])

    _, forward = jax.jit(lambda U: jax.jvp(end, (U,), (jnp.ones(()),)))(jnp.asarray(4.3))
    high, low = jax.jit(jax.vmap(end))(jnp.array([4.3 + 1e-4, 4.3 - 1e-4]))
    np.testing.assert_allclose(forward, (high - low) / 2e-4, rtol=1e-4, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("sign", ["consistent", "printed"])
def test_constructed_voltage_gives_the_constructed_belt_speed(sign):
    system = BlockOnDrivenBelt.constructed(k3=85.0, drive=DCDrive.constructed(belt_reaction=sign))
    assert float(jax.jit(mean_belt_speed)(system)) == pytest.approx(0.12, abs=1e-6)


@pytest.mark.more
def test_voltage_is_found_on_a_short_run():
    """Without friction on the belt the mean speed follows from the steady motor."""
    system = BlockOnDrivenBelt.constructed(k3=85.0)
    free = type(system.law)(0.0, 1.0, 0.0, 0.0)
    system = BlockOnDrivenBelt.constructed(k3=85.0, law=free)
    voltage = voltage_for_belt_speed(system, 0.12, transient=2.0, duration=1.0)
    w = 0.12 * 20 / 0.03
    assert voltage == pytest.approx(0.05 * w + 2.0 * (2e-5 * w + 5e-3) / 0.05, rel=1e-6)


def test_unreachable_speed_is_an_error():
    system = BlockOnDrivenBelt.constructed(k3=85.0)
    with pytest.raises(ValueError, match=r"speed = -0.12: it must be finite and positive"):
        voltage_for_belt_speed(system, -0.12)
    with pytest.raises(TypeError, match="system"):
        voltage_for_belt_speed(system.drive, 0.12)
