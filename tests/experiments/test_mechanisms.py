"""Experiments on declared machines: what they call known is derived here another way."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from experiments._experiment import Context, load
from experiments.mechanisms import brake, chain, dahl_drive, drill_string, froude
from stickslip.friction import Coulomb

NAMES = ("brake", "chain", "dahl-drive", "drill-string", "froude")


def test_all_are_there():
    assert [n for n in load() if n.startswith("mechanism-")] == [f"mechanism-{n}" for n in NAMES]


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_statements_hold_at_quick_size(name, tmp_path):
    experiment = load()[f"mechanism-{name}"]
    data = experiment.compute({**experiment.parameters, **experiment.quick}, Context(tmp_path))
    plt.close(experiment.draw(data))
    found = experiment.judge(data)
    assert len(found) >= 3
    assert {s.id: s.measured for s in found if not s.holds} == {}
    assert data.attrs.get("failed", 0) == 0


def largest_rate(right, y, step=1e-6):
    """Largest real part of the eigenvalues of a field at `y`, by central differences."""
    y = np.asarray(y, float)
    columns = [(right(y + step * e) - right(y - step * e)) / (2.0 * step) for e in np.eye(len(y))]
    return np.linalg.eigvals(np.array(columns).T).real.max()


def test_critical_friction_of_the_brake():
    """Eigenvalues of equations of motion written anew, on both sides of the closed form."""

    def right(mu):
        def field(y):
            x, z, vx, vz = y
            load = brake.PRESSED + brake.PAD * z
            along = -brake.ALONG * x - brake.ACROSS * z + mu * load
            towards = brake.PRESSED - brake.ACROSS * x - (brake.TOWARDS - brake.PAD) * z - load
            return np.array([vx, vz, along, towards]) / np.array([1.0, 1.0, brake.MASS, brake.MASS])

        return field

    rate = lambda mu: largest_rate(right(mu), np.zeros(4))  # noqa: E731
    assert rate(0.98 * brake.critical()) < 1e-6
    for mu in (1.02, 1.5):
        assert rate(mu * brake.critical()) == pytest.approx(
            brake.growth_of(mu * brake.critical()), rel=1e-6
        )


def test_brake_at_rest_and_alone():
    """Without load it does not rub: the frequencies are those of the springs."""
    machine = brake.Brake(1.0, 0.0, 2.0, 0.0, 0.0, Coulomb(0.6), 0.8)
    y0 = machine.state(x=0.1, y=0.2)
    run = ss.simulate(machine, 0.0, 3.0, y0, saveat=ss.SaveAt(max_events=None))
    assert machine.mode_names[int(run.mode1)] == "open"
    assert float(run.y1.x) == pytest.approx(0.1 * np.cos(3.0), abs=1e-7)
    assert float(run.y1.y) == pytest.approx(0.2 * np.cos(3.0 * np.sqrt(2.0)), abs=1e-7)


def drill_field(aim):
    """The rig's equations, sliding, in twist and two speeds."""
    d = drill_string

    def field(y):
        twist, table, bit = y
        shaft = d.STIFFNESS * twist + d.DAMPING * (table - bit)
        return np.array(
            [
                table - bit,
                (d.DRIVE * (aim - table) - shaft) / d.INERTIA,
                (shaft - d.torque(bit)) / d.BIT,
            ]
        )

    return field


def test_critical_speed_of_the_drill_string():
    """The zero of the growth rate, found by bisection on differences of the field."""
    known, _ = drill_string.hopf()

    def rate(speed):
        twist = drill_string.torque(speed) / drill_string.STIFFNESS
        return largest_rate(drill_field(drill_string.aimed(speed)), [twist, speed, speed])

    assert brentq(rate, 0.8 * known, 1.2 * known) == pytest.approx(known, rel=1e-6)


@pytest.mark.slow
def test_stick_slip_of_the_drill_string_against_another_integration():
    """Period and greatest speed at 90 1/min, by SciPy with stick and slip told apart by hand."""
    d, aim = drill_string, 90.0 * drill_string.RPM
    field, y, t, releases, fastest = drill_field(aim), np.array([0.0, aim, 0.0]), 0.0, [], 0.0

    def stuck(t, y):
        shaft = d.STIFFNESS * y[0] + d.DAMPING * y[1]
        return np.array([y[1], (d.DRIVE * (aim - y[1]) - shaft) / d.INERTIA, 0.0])

    def gives_way(t, y):
        return d.STIFFNESS * y[0] + d.DAMPING * y[1] - d.STATIC

    def stops(t, y):
        return y[2] if t > released + 0.05 else 1.0

    gives_way.terminal = stops.terminal = True
    for _ in range(12):
        options = {"rtol": 1e-10, "atol": 1e-12}
        if gives_way(t, y) < 0.0:
            part = solve_ivp(stuck, (t, t + 100.0), y, events=gives_way, **options)
            t, y = part.t[-1], part.y[:, -1]
        released = t
        releases.append(t)
        y = y + np.array([0.0, 0.0, 1e-9])  # on the branch that slides
        part = solve_ivp(lambda t, y: field(y), (t, t + 100.0), y, events=stops, **options)
        fastest, t, y = part.y[2].max(), part.t[-1], part.y[:, -1] * np.array([1.0, 1.0, 0.0])
    (least, greatest), _, fine = drill_string.settled(aim, lambda m: m.state(v_table=aim), 300.0)
    assert fine
    assert abs(float(least)) < 1e-9
    assert float(greatest) == pytest.approx(fastest, rel=1e-3)
    machine = drill_string.rig(aim)
    run = ss.simulate(machine, 0.0, 150.0, machine.state(v_table=aim))
    events = run.events
    own = np.asarray(events.t)[np.asarray(events.mode_before) == 1]
    assert np.diff(own[np.isfinite(own)])[-1] == pytest.approx(np.diff(releases)[-1], rel=1e-4)


def test_averaged_swings_of_froude_pendulum():
    """Work of the torque over a swing by quadrature of the law itself."""
    machine = froude.pendulum(1.0)
    law, speed = machine.law, float(machine.shaft_speed)
    for size in (0.3, 0.7, 1.0):
        given = quad(
            lambda a, size=size: float(law.kinetic(speed * (1.0 - size * np.cos(a)), 1.0))
            * np.cos(a) / np.pi, 0.0, 2.0 * np.pi, epsabs=1e-11,
        )[0]  # fmt: skip
        ratio = given / (size * speed * float(machine.damping))
        assert froude.averaged_ratio(np.array(size)) == pytest.approx(ratio, rel=1e-8)
    assert froude.averaged_ratio(np.array(1e-3)) == pytest.approx(1.0, abs=1e-5)


def test_area_of_the_loop_of_bristles():
    """Dahl's law integrated to and fro until it repeats itself."""
    a, F, sigma = 1.3e-3, dahl_drive.FRICTION, dahl_drive.STIFFNESS
    force, lost = 0.0, 0.0
    for sense in (1, -1) * 12:
        way = solve_ivp(
            lambda x, y, sense=sense: [sigma * (1.0 - sense * y[0] / F) * sense, y[0] * sense],
            (0.0, 2.0 * a), [force, 0.0], rtol=1e-11, atol=1e-14,
        )  # fmt: skip
        force, last, lost = way.y[0, -1], lost, way.y[1, -1]
    assert dahl_drive.area(a) == pytest.approx(lost + last, rel=1e-8)


@pytest.mark.more
def test_blocks_that_slip_are_superposed_modes():
    """One block is its own mode, and a chain of three the exponential of its matrix."""
    for blocks in (1, 3):
        places, known = chain.slipping(blocks, 7.0)
        np.testing.assert_allclose(places, known, atol=1e-9)
    K = (chain.PULL + chain.COUPLING * np.array([1.0, 2.0, 1.0])) * np.eye(3)
    K -= chain.COUPLING * (np.eye(3, k=1) + np.eye(3, k=-1))
    squares, modes = np.linalg.eigh(K / chain.MASS)
    held = chain.KINETIC / chain.PULL
    swing = modes @ np.diag(np.cos(7.0 * np.sqrt(squares))) @ modes.T
    np.testing.assert_allclose(known, held + swing @ (chain.uneven(3) - held), atol=1e-10)


@pytest.mark.more
@pytest.mark.parametrize("size", [1e-9, 1.0, 1e9])
def test_a_block_keeps_its_period_at_every_scale(size):
    """Lengths in another unit: forces, places and speeds are `size` times as large."""
    machine = chain.chain(1, Coulomb(1.0 * size, 0.5 * size), 0.2 * size)
    y0 = machine.at([0.0], 0.2 * size)
    rule = ss.AdaptiveStep(1e-10, 1e-11 * size)
    run = ss.simulate(machine, 0.0, 40.0, y0, integrator=ss.Integrator("dop853", rule))
    before = np.asarray(run.events.mode_before)
    times = np.asarray(run.events.t)[before == 1]
    period = np.diff(times[np.isfinite(times)])
    known = 2.0 * 0.5 / 0.2 + np.pi + 2.0 * np.arctan(0.2 / 0.5)
    assert len(period) >= 3
    np.testing.assert_allclose(period, known, rtol=1e-9)


@pytest.mark.more
def test_a_chain_at_rest_stays():
    """On a belt that stands, loaded below its friction."""
    machine = chain.chain(3, Coulomb(1.0, 0.5), 0.0)
    run = ss.simulate(machine, 0.0, 50.0, machine.at([0.1, 0.1, 0.2], 0.0))
    assert int(run.num_events) == 0
    assert [float(x) for x in run.y1] == [0.1, 0.1, 0.2, 0.0, 0.0, 0.0]


def test_too_many_blocks_are_refused_by_name():
    with pytest.raises(ValueError, match=r"contact_directions.*32 contacts"):
        chain.chain(32, chain.weakening(), 0.1)
