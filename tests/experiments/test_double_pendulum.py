"""The double pendulum: motions stepped from its Lagrangian, and the measured ones where they are."""

import os
import pathlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from experiments import _data, _output
from experiments.__main__ import main
from experiments.double_pendulum import identify
from experiments.double_pendulum._arm import State, errors, problem, shot, torque
from experiments.double_pendulum._arm import arm as declared
from experiments.double_pendulum._inverse import inverse_dynamics
from experiments.double_pendulum._record import COLUMNS, NAME, STEP, Motion, load

MODEL = identify.MODELS["published, 3.0"]
TRUTH = identify.base_of(MODEL) | {"viscous_1": 0.01, "viscous_2": 0.005}
ZEROS, GAIN = np.array([0.02, -0.015]), 0.9
LINK, GEAR, G = 0.2, 6.0, 9.81


def energy_of_motion(q, v):
    """From masses, centres and inertias about the joints; the rotor of the second motor sits on the
    first link."""
    p = MODEL
    second = v[0] + v[1]
    moved = (
        0.5 * p["m2"] * LINK**2 * v[0] ** 2 + p["m2"] * LINK * p["r2"] * jnp.cos(q[1]) * v[0] * second
    )
    turned = 0.5 * p["I1"] * v[0] ** 2 + 0.5 * p["I2"] * second**2
    rotors = 0.5 * p["Ir"] * ((GEAR * v[0]) ** 2 + (v[0] - GEAR * v[1]) ** 2)
    return moved + turned + rotors


def energy_of_height(q):
    p = MODEL
    upper = p["m1"] * p["r1"] + p["m2"] * LINK
    return -G * (upper * jnp.cos(q[0]) + p["m2"] * p["r2"] * jnp.cos(q[0] + q[1]))


def inertia_and_force(q, v):
    """Lagrange's equations by differentiation."""
    mass = jax.hessian(energy_of_motion, 1)(q, v)
    moved = jax.jacfwd(jax.grad(energy_of_motion, 1), 0)(q, v) @ v
    return mass, jax.grad(energy_of_motion)(q, v) - jax.grad(energy_of_height)(q) - moved


def drive(t, phase=0.0):
    return jnp.stack([0.6 * jnp.sin(7.0 * t + phase), 0.6 * jnp.sin(4.9 * t + 2.0 * phase)])


def made(seconds: float, phase: float, fine: int = 60) -> Motion:
    """Implicit steps: the friction of a step brings a joint to rest or does not."""
    h = STEP / fine
    dry = h * jnp.array([TRUTH["dry_1"], TRUTH["dry_2"]])
    viscous = jnp.array([TRUTH["viscous_1"], TRUTH["viscous_2"]])

    def step(state, t):
        q, v = state
        mass, force = inertia_and_force(q, v)
        free = jnp.linalg.solve(mass, h * (force + drive(t, phase) - viscous * v)) + v
        inverse = jnp.linalg.inv(mass)
        push = jnp.zeros(2)
        for _ in range(20):
            for i in (0, 1):
                speed = free[i] + inverse[i] @ push
                push = push.at[i].set(jnp.clip(push[i] - speed / inverse[i, i], -dry[i], dry[i]))
        v = free + inverse @ push
        return (q + h * v, v), q

    times = jnp.asarray(h * np.arange(round(seconds / STEP) * fine))
    begin = (-jnp.asarray(ZEROS), jnp.zeros(2))
    _, rows = jax.jit(lambda: jax.lax.scan(step, begin, times))()
    q = np.asarray(rows)[::fine].T + ZEROS[:, None]
    return Motion(q, np.asarray(jax.vmap(lambda t: drive(t, phase))(times[::fine])).T)


@pytest.fixture(scope="module")
def motion():
    return made(6.0, 0.4)


def test_equations_are_those_of_lagrange():
    rng = np.random.default_rng(0)
    still = Motion(np.zeros((2, 100)), np.zeros((2, 100)))
    inputs = {"tau_1": torque(still, 0), "tau_2": torque(still, 1)}
    values = TRUTH | dict.fromkeys(("dry_1", "dry_2", "viscous_1", "viscous_2"), 0.0)
    system = declared(values | {"zero_1": 0.0, "zero_2": 0.0, "gain": 1.0}, inputs)
    field = jax.jit(lambda y: system.vector_field(0.0, y, system.initial_mode(0.0, y, None), None))
    both = jax.jit(inertia_and_force)
    for q, v in rng.normal(size=(5, 2, 2)):
        y = State(*q, *v)
        rate = field(y)
        mass, force = both(jnp.asarray(q), jnp.asarray(v))
        np.testing.assert_allclose([rate.v_q1, rate.v_q2], np.linalg.solve(mass, force), rtol=1e-10)
        height = float(energy_of_height(q))
        assert float(system.energy(y)) == pytest.approx(float(energy_of_motion(q, v)) + height)


def told_by(motion):
    """The same with a second motor that gives less than its current tells."""
    return motion._replace(tau=motion.tau / np.array([[1.0], [GAIN]]))


@pytest.mark.more
def test_motion_is_that_of_implicit_steps(motion):
    known = TRUTH | {"gain": GAIN}
    task = problem([told_by(motion)], known, 10, known=known)
    zeros = {f"zero_{i}[1]": ZEROS[i - 1] for i in (1, 2)}
    assert np.abs(errors(task, zeros, [motion])[0]).max() < 2e-3
    assert np.abs(errors(task, dict.fromkeys(zeros, 0.0), [motion])[0]).max() > 0.02
    looser = problem([motion], known, 10, known=known | {"dry_2": 0.9 * TRUTH["dry_2"]})
    assert np.abs(errors(looser, zeros, [motion])[0]).max() > 0.02


@pytest.mark.more
def test_inverse_dynamics_of_a_known_pendulum(motion):
    values, deviations, left = inverse_dynamics([motion])
    assert left < 0.05
    for name in ("moment_1", "moment_2", "inertia_1", "inertia_2"):
        assert values[name] == pytest.approx(TRUTH[name], rel=0.03), name
    for name in ("dry_1", "dry_2"):
        assert values[name] == pytest.approx(TRUTH[name], rel=0.2), name
    assert all(value > 0.0 for value in deviations.values())


@pytest.mark.slow
def test_parameters_of_a_known_pendulum(motion):
    told = told_by(motion)
    task = problem([told], inverse_dynamics([told])[0], 10, gain=True)
    fit = task.fit()
    assert bool(fit.successful)
    for name, value in (TRUTH | {"gain": GAIN}).items():
        assert float(fit.values[name]) == pytest.approx(value, rel=0.02), name
    found = [float(fit.values[f"zero_{i}[1]"]) for i in (1, 2)]
    assert found == pytest.approx(ZEROS, abs=2e-3)
    assert np.abs(errors(task, fit.values, [told])[0]).max() < 5e-3


def test_published_parameters():
    """Sums as in the notes on the record."""
    base = identify.PUBLISHED[identify.REFERENCE]
    told = {"moment_1": 0.2411, "inertia_1": 0.0529, "moment_2": 0.1812}
    assert {name: round(base[name], 4) for name in told} == told
    assert base["dry_1"] == pytest.approx(0.093 * np.pi / 2)


def test_state_of_a_knot_is_in_order():
    assert shot(0.0, {"q1": 1.0, "q2": 2.0}, {"q1": 3.0, "q2": 4.0}) == State(1.0, 2.0, 3.0, 4.0)


def test_records_of_another_format(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv(_data.VARIABLE, raising=False)
    assert main(["identify-double-pendulum", "--out", str(tmp_path / "out")]) == 1
    name = NAME.format(2)
    assert f"{name} is needed: name its folder by --data FOLDER" in capsys.readouterr().err
    heads = ",".join(COLUMNS)
    for text, message in (
        ("time,pos_meas1\n0,1\n", "it must have the columns pos_meas2, tau_meas1, tau_meas2"),
        (f"{heads}\n0,0,0,0,0\n0.002,0,x,0,0\n", "every line must be 5 numbers"),
        (f"{heads}\n0,0,0,0,0\n0,0,0,0,0\n", "the times must increase"),
        (f"{heads}\n0,0,0,0,0\n0.01,0,0,0,0\n0.02,0,0,0,0\n", r"in steps of 0\.002 s"),
    ):
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=message):
            load(tmp_path, 2)


def measured() -> list[Motion]:
    try:
        return [load(None, number) for number in (2, 3, 4)]
    except _data.MissingDataError as error:
        pytest.skip(str(error))


def test_inverse_dynamics_of_the_measured_records():
    values, _, left = inverse_dynamics(measured())
    base = identify.PUBLISHED[identify.REFERENCE]
    off = {name: abs(values[name] / base[name] - 1.0) for name in (*identify.INERTIAL, *identify.DRY)}
    assert max(off[name] for name in identify.INERTIAL) < 0.08
    assert max(off[name] for name in identify.DRY) < 0.3
    assert left < 0.1


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The fit converged")  # the models leave more than the noise
def test_statements_on_the_measured_records(tmp_path):
    measured()
    folder = pathlib.Path(os.environ[_data.VARIABLE])
    _output.run(identify.EXPERIMENT, tmp_path, changes=["afar=false"], data=folder)
    with xr.open_dataset(tmp_path / "identify-double-pendulum.nc", engine="h5netcdf") as data:
        holds = {s.id: s.holds for s in identify.judge(data.load())}
    assert [k for k in range(1, 9) if not holds[f"R4.{k}"]] == [3, 8]
    assert holds["R4.9"] is None
    assert holds["R4.10"] is False
