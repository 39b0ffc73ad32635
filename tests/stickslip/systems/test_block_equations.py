"""Equations, energies and errata of the block on a belt, state by state, without simulation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.friction import Coulomb, Dahl, HyperbolicWeakening, Regularised
from stickslip.systems import (
    BlockOnBelt,
    BlockOnBeltSetValued,
    BlockOnDrivenBelt,
    BlockOnDrivenBeltSetValued,
    BlockState,
    DCDrive,
    DrivenBlockState,
    DriveState,
)

from ._block_reference import Reference, drive_parameters

K3 = 85.0
MODELS = [BlockOnBelt, BlockOnBeltSetValued, BlockOnDrivenBelt, BlockOnDrivenBeltSetValued]


def states(n, seed=0):
    """Random states of the driven block within the range of its motion."""
    size = [0.05, 0.3, 0.02, 0.1, 80.0, 0.3]
    return np.random.default_rng(seed).uniform(-1, 1, (n, 6)) * size


def make(model, **changes):
    return model.constructed(k3=K3, **changes)


def state_of(model, row):
    driven = "Driven" in model.__name__
    return (
        DrivenBlockState(*map(jnp.asarray, row)) if driven else BlockState(*map(jnp.asarray, row[:4]))
    )


def slip_mode(system, y):
    """Mode that belongs to a state in motion."""
    return int(system.initial_mode(0.0, y, None))


@pytest.fixture(scope="module")
def drive():
    return drive_parameters(float(DCDrive.constructed().U_in))


def test_smooth_simplified_model_is_the_reference():
    system, field = make(BlockOnBelt), eqx.filter_jit(BlockOnBelt.vector_field)
    for row in states(20):
        ours = field(system, 0.0, BlockState(*map(jnp.asarray, row[:4])), 0, None)
        np.testing.assert_allclose(ours, Reference(K3).simplified(0.0, row[:4]), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("belt_reaction", ["consistent", "printed"])
@pytest.mark.parametrize("motor_friction", ["consistent", "printed"])
def test_smooth_full_model_is_the_reference_with_every_sign(drive, belt_reaction, motor_friction):
    signs = {"belt_reaction": belt_reaction, "motor_friction": motor_friction}
    system = make(BlockOnDrivenBelt, drive=DCDrive.constructed(U_in=drive["U_in"], **signs))
    field = eqx.filter_jit(BlockOnDrivenBelt.vector_field)
    drive["reaction"] = 1.0 if belt_reaction == "consistent" else -1.0
    drive["friction"] = 1.0 if motor_friction == "consistent" else -1.0
    reference = Reference(K3, drive=drive)
    for row in states(10):
        y = DrivenBlockState(*map(jnp.asarray, row))
        ours = field(system, 0.0, y, slip_mode(system, y), None)
        np.testing.assert_allclose(ours, reference.full(0.0, row, np.sign(row[4])), rtol=1e-11)


def test_set_valued_slip_is_the_reference():
    system, field = make(BlockOnBeltSetValued), eqx.filter_jit(BlockOnBeltSetValued.vector_field)
    model = Reference(K3)
    for row in states(10):
        x, xd, y, yd = row[:4]
        state = BlockState(*map(jnp.asarray, row[:4]))
        sense = np.sign(xd - model.V_b)
        T_s = model.mu_slip(xd - model.V_b, sense) * model.normal(x, y, yd)
        ours = field(system, 0.0, state, slip_mode(system, state), None)
        expected = model.accelerations(x, xd, y, yd, T_s)
        np.testing.assert_allclose([ours.vx, ours.vy], expected, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(system.law.static_coefficient(), model.mu_static(), rtol=1e-10)


def test_sticking_block_and_rotor_share_one_acceleration():
    system = make(BlockOnDrivenBeltSetValued)
    for row in states(10):
        row = row.copy()
        row[1] = 0.03 / 20 * row[4]
        y = DrivenBlockState(*map(jnp.asarray, row))
        mode = system.mode_names.index(f"turning {'forward' if row[4] > 0 else 'backward'}, stick")
        dy = system.vector_field(0.0, y, jnp.asarray(mode), None)
        T_s = float(system.friction_force(0.0, y, jnp.asarray(mode)))
        d = drive_parameters(float(system.drive.U_in))
        block = (-T_s - Reference(K3).load_on_block(*row[:4])) / 0.20
        torque = d["k_m"] * row[5] + 0.03 / (0.6 * 20) * T_s - d["b"] * row[4]
        rotor = (torque - np.sign(row[4]) * d["T_k"]) / (d["J_dc"] + d["J_bp"] / (0.6 * 400))
        np.testing.assert_allclose(dy.vx, block, rtol=1e-10)
        np.testing.assert_allclose(dy.omega, rotor, rtol=1e-10)
        np.testing.assert_allclose(dy.vx, 0.03 / 20 * dy.omega, rtol=1e-12)


def test_printed_elastic_terms_are_the_gradient_of_a_potential():
    sp = pytest.importorskip("sympy")
    x, y, r, k1, k2, k3 = sp.symbols("x y r k1 k2 k3", positive=True)
    stretch = y + x**2 / (2 * r)
    elastic = k1 * x**2 / 2 + k2 * (x + y) ** 2 / 2 + k3 * stretch**2 / 2
    printed_8 = (k1 + k2) * x + k2 * y + k3 * x / r * stretch
    printed_9 = k2 * (x + y) + k3 * stretch
    assert sp.expand(sp.diff(elastic, x) - printed_8) == 0
    assert sp.expand(sp.diff(elastic, y) - printed_9) == 0


def test_loads_at_rest_are_the_gradient_of_the_potential():
    system = make(BlockOnBelt)
    for row in states(5):
        row = row * [1, 0, 1, 0, 0, 0]
        at = BlockState(*map(jnp.asarray, row[:4]))
        slope = jax.grad(lambda y: system.potential_energy(0.0, y))(at)
        loads = system.loads(at)
        np.testing.assert_allclose([slope.x, slope.y], [loads.on_block, loads.on_rim], rtol=1e-12)
        x, y = row[0], row[2]
        elastic = (17 * x**2 + 11 * (x + y) ** 2 + K3 * (y + x**2 / 0.5) ** 2) / 2
        np.testing.assert_allclose(float(system.elastic_energy(0.0, at)), elastic, rtol=1e-13)


@pytest.mark.parametrize("model", MODELS)
def test_energy_grows_at_the_rate_of_the_powers(model):
    """In every mode, also those the state would not be in: the account is an identity."""
    system = make(model)

    @eqx.filter_jit
    def account(system, y, mode):
        dy = system.vector_field(0.0, y, mode, None)
        rate = jax.jvp(system.energy, (y,), (dy,))[1]
        return rate, system.powers(0.0, y, mode, None)

    for row in states(4):
        for mode, name in enumerate(system.mode_names):
            row = row.copy()
            if "resting" in name:
                row[4] = 0.0
            if "turning" in name:
                row[4] = abs(row[4]) * (1 if "turning forward" in name else -1)
            if "stick" in name:
                row[1] = 0.03 / 20 * row[4] if "turning" in name or "resting" in name else 0.12
            rate, powers = account(system, state_of(model, row), jnp.asarray(mode))
            size = sum(abs(float(p)) for p in powers.values())
            assert abs(float(rate) - sum(map(float, powers.values()))) < 1e-11 * (size + 1.0)


def test_dissipation_has_its_sign():
    system = make(BlockOnDrivenBelt)
    for row in states(20):
        y = DrivenBlockState(*map(jnp.asarray, row))
        assert float(system.normal_force(0.0, y)) > 0
        powers = system.powers(0.0, y, slip_mode(system, y), None)
        assert all(float(powers[name]) <= 0 for name in ("contact", "dampers", "motor"))


def test_observables_agree_with_each_other():
    system = make(BlockOnBelt)
    for row in states(5):
        y = BlockState(*map(jnp.asarray, row[:4]))
        v, N, T_s = (
            f(0.0, y) for f in (system.relative_velocity, system.normal_force, system.friction_force)
        )
        model = Reference(K3)
        np.testing.assert_allclose(float(v), row[1] - 0.12)
        np.testing.assert_allclose(float(N), model.normal(row[0], row[2], row[3]), rtol=1e-13)
        np.testing.assert_allclose(float(T_s / N), model.mu(row[1] - 0.12), rtol=1e-11)
        np.testing.assert_allclose(float(system.friction_coefficient(0.0, y)), float(T_s / N))
        np.testing.assert_allclose(float(system.friction_power(0.0, y)), float(-T_s * v))
        np.testing.assert_allclose(float(system.belt_power(0.0, y)), float(-T_s) * 0.12)


def test_lift_off_is_seen():
    system = make(BlockOnBelt)
    raised = BlockState(x=jnp.zeros(()), vx=jnp.zeros(()), y=jnp.asarray(0.1), vy=jnp.zeros(()))
    assert float(system.normal_force(0.0, raised)) < 0


@pytest.mark.more
@pytest.mark.parametrize("model", MODELS)
def test_one_factor_on_all_masses_and_forces_changes_nothing(model):
    system = make(model)
    scaled = system.scaled(3.7)
    assert float(scaled.m) == pytest.approx(3.7 * 0.2)
    for row in states(5):
        y = state_of(model, row)
        mode = jnp.asarray(slip_mode(system, y))
        assert slip_mode(scaled, y) == int(mode)
        one, other = (s.vector_field(0.0, y, mode, None) for s in (system, scaled))
        np.testing.assert_allclose(one, other, rtol=1e-11, atol=1e-11)


def test_constructed_set_has_its_derived_parameters():
    system = make(BlockOnBelt)
    assert float(system.J) == pytest.approx(0.039375, rel=1e-15)
    assert float(system.Q) == pytest.approx(-0.75 * 0.21 * 9.81 * 0.25, rel=1e-15)
    heavier = make(BlockOnBelt, M=0.42)
    assert float(heavier.J) == pytest.approx(2 * 0.039375)
    assert float(heavier.Q) == pytest.approx(2 * float(system.Q))
    assert float(make(BlockOnBelt, Q=0.0).Q) == 0.0


@pytest.mark.parametrize(
    ("make_it", "message"),
    [
        (lambda: make(BlockOnBelt, m=0.0), r"m = 0.0: it must be finite and positive"),
        (lambda: make(BlockOnBelt, k1=-1.0), r"k1 = -1.0: it must be finite and not negative"),
        (lambda: BlockOnBelt.constructed(k3=np.array([80.0, -1.0])), r"k3\[1\] = -1.0"),
        (lambda: make(BlockOnBelt, V_b=float("nan")), r"V_b = nan: it must be finite"),
        (lambda: make(BlockOnBelt, Q=float("inf")), r"Q = inf: it must be finite"),
        (lambda: make(BlockOnBelt, law=Coulomb(0.3)), r"law = Coulomb: it must be a smooth law"),
        (
            lambda: make(BlockOnBeltSetValued, law=Regularised(Coulomb(0.3), 1e-3)),
            r"law = Regularised: it must be a set-valued law",
        ),
        (
            lambda: make(BlockOnBelt, law=Dahl(Coulomb(0.3), 1e4)),
            r"law = Dahl: it must be a smooth law",
        ),
        (lambda: DCDrive.constructed(eta=0.0), r"eta = 0.0: it must be finite and positive"),
        (lambda: DCDrive.constructed(T_st=1e-3), r"T_st = 0.001: it must be at least T_k = 0.005"),
        (
            lambda: DCDrive.constructed(belt_reaction="right"),
            r"belt_reaction = 'right': it must be one",
        ),
        (lambda: DCDrive.constructed(motor_friction="no"), r"motor_friction = 'no': it must be one of"),
        (lambda: make(BlockOnBelt).scaled(0.0), r"factor = 0.0: it must be finite and positive"),
    ],
)
def test_wrong_parameter_is_named(make_it, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make_it()


def test_wrong_kind_of_argument_is_named():
    with pytest.raises(TypeError, match="drive"):
        make(BlockOnDrivenBelt, drive=make(BlockOnBelt))
    with pytest.raises(TypeError, match="law"):
        make(BlockOnBelt, law=0.3)


def test_parameters_may_be_traced_and_batched():
    at = BlockState(x=jnp.asarray(0.01), vx=jnp.asarray(0.1), y=jnp.asarray(-0.01), vy=jnp.asarray(0.0))

    def acceleration(k3):
        return BlockOnBelt.constructed(k3=k3).vector_field(0.0, at, 0, None).vx

    k3 = jnp.array([80.0, 85.0])
    many = jax.jit(jax.vmap(acceleration))(k3)
    np.testing.assert_allclose(many, [acceleration(k) for k in k3], rtol=1e-14)
    slope = jax.grad(acceleration)(85.0)
    np.testing.assert_allclose(slope, float(acceleration(86.0) - acceleration(84.0)) / 2, rtol=1e-10)


def test_modes_at_rest_follow_the_load():
    system = make(BlockOnBeltSetValued, law=HyperbolicWeakening(0.4, 1.0, 0.3))

    def mode(x):
        y = BlockState(x=jnp.asarray(x), vx=jnp.asarray(0.12), y=jnp.asarray(0.0), vy=jnp.asarray(0.0))
        return slip_mode(system, y)

    names = ["stick", "slip backward", "slip forward"]
    assert [system.mode_names[mode(x)] for x in (0.0, 0.1, -0.1)] == names
    # There the pendulum's spring pulls the block off the belt: N = -11.8 N, outside the model.
    assert mode(0.3) == -1


def test_drive_rests_until_its_torque_is_large_enough():
    drive = DCDrive.constructed(T_st=6e-3)

    def mode(omega, torque):
        y = DriveState(omega=jnp.asarray(omega), i_w=jnp.asarray(torque / 0.05))
        return drive.mode_names[int(drive.initial_mode(0.0, y, None))]

    assert mode(0.0, 5.9e-3) == mode(0.0, -5.9e-3) == "resting"
    assert mode(0.0, 6.1e-3) == mode(1e-9, -1.0) == "turning forward"
    assert mode(0.0, -6.1e-3) == mode(-1e-9, 1.0) == "turning backward"


@pytest.mark.parametrize("kind", ["tanh", "sqrt"])
def test_energy_of_the_regularised_block_grows_at_the_rate_of_its_powers(kind):
    block = make(BlockOnBeltSetValued).regularised(1e-2, kind)
    for row in states(4):
        y = state_of(BlockOnBeltSetValued, row)
        dy = block.vector_field(0.0, y, 0, None)
        rate = jax.jvp(block.energy, (y,), (dy,))[1]
        assert float(rate) == pytest.approx(sum(map(float, block.powers(0.0, y, 0, None).values())))
