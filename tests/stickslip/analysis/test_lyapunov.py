"""Lyapunov exponents against closed forms, published values and a computation by hand."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.analysis import (
    LyapunovSpectrum,
    Segments,
    lyapunov_diagram,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    two_trajectory_exponent,
    volume_growth,
)
from stickslip.analysis._growth import first_frame, mean_and_error, orthonormal_columns
from stickslip.derived import WithDeviations
from stickslip.sweep import Compute
from stickslip.systems import (
    BlockOnBelt,
    BlockOnBeltSetValued,
    BlockOnDrivenBelt,
    BlockOnDrivenBeltSetValued,
    BlockState,
    BouncingBall,
    CoulombOscillator,
    DrivenBlockState,
    JointedBeam,
    Motion,
    OscillatorBetweenStops,
)
from tests.stickslip.systems._systems import CASES

from ._chaos import Flow, Impacts, Point, lorenz

SMOOTH = ss.Integrator("tsit5", ss.AdaptiveStep(1e-8, 1e-10), max_steps=10_000_000)
FINE = ss.Integrator("tsit5", ss.AdaptiveStep(1e-11, 1e-11), max_steps=10_000_000)
BY_HAND = Impacts(c=0.05, e=0.8, P=1.0, Omega=2.8, stop=0.0)
START = Motion(x=0.1, v=0.0)


@jax.jit
def smooth_spectrum(system, u0):
    return lyapunov_spectrum(system, u0, Segments(0.5, 1600, 20.0, warm_up=40), integrator=SMOOTH)


def impacting(**changes):
    p = {**BY_HAND._asdict(), **changes}
    return OscillatorBetweenStops(
        1.0, 1.0, damping=p["c"], lower=p["stop"], upper=100.0, restitution=p["e"], rest_speed=0.0,
        force_amplitude=p["P"], force_frequency=p["Omega"],
    )  # fmt: skip


def agree(value, exact, error, at_most):
    """Within three of its own errors, which must be small themselves, and those of the integrator."""
    assert float(error) < at_most
    assert abs(float(value) - exact) <= 3 * float(error) + 1e-7


# Smooth flows


@pytest.mark.more
def test_linear_flow_has_the_real_parts_of_its_eigenvalues():
    matrix = np.array([[-0.3, 0.8, 0.1], [-0.9, -0.1, 0.0], [0.3, 0.2, -1.1]])
    zero = jnp.asarray(0.0)
    found = smooth_spectrum(Flow(jnp.asarray(matrix), zero, zero), Point(0.3, 0.1, -0.2))
    exact = np.sort(np.linalg.eigvals(matrix).real)[::-1]
    for i in range(3):
        agree(found.exponents[i], exact[i], found.error[i], 2e-3)
    np.testing.assert_allclose(found.sum, np.trace(matrix), atol=1e-6)


@pytest.mark.more
def test_fixed_point_of_lorenz():
    """Below rho = 1 the origin attracts: its eigenvalues."""
    found = smooth_spectrum(lorenz(0.5), Point(0.1, 0.2, 0.3))
    exact = np.sort([-8 / 3, *np.linalg.eigvals([[-10.0, 10.0], [0.5, -1.0]])])[::-1]
    np.testing.assert_allclose(found.exponents, exact, atol=1e-4)
    assert float(found.kaplan_yorke_dimension) == 0.0


def test_limit_cycle_has_zero_and_its_floquet_exponent():
    """r' = r (0.2 - r^2), z' = -0.7 z: 0 along the circle, -0.4 across, -0.7 off the plane."""
    matrix = np.array([[0.2, -1.3, 0.0], [1.3, 0.2, 0.0], [0.0, 0.0, -0.7]])
    flow = Flow(jnp.asarray(matrix), jnp.asarray(0.0), jnp.asarray(1.0))
    found = smooth_spectrum(flow, Point(0.5, 0.0, 0.1))
    for value, exact, error in zip(found.exponents, (0.0, -0.4, -0.7), found.error, strict=True):
        agree(value, exact, error, 2e-3)
    assert float(found.running[-1, 0]) == pytest.approx(float(found.exponents[0]), abs=1e-12)


@pytest.mark.more
def test_lorenz():
    """Sprott 2003: 0.9056, 0, -14.572, dimension 2.062; the sum is the divergence -41/3."""
    found = smooth_spectrum(lorenz(), Point(1.0, 1.0, 20.0))
    for value, exact, error in zip(found.exponents, (0.9056, 0.0, -14.5723), found.error, strict=True):
        agree(value, exact, error, 0.02)
    np.testing.assert_allclose(found.sum, -41 / 3, rtol=1e-6)
    assert float(found.kaplan_yorke_dimension) == pytest.approx(2.062, abs=3e-3)
    assert bool(found.result == ss.RESULTS.successful)


@pytest.mark.more
def test_two_trajectories_of_a_linear_flow():
    """Eq. (2.25), with and without bringing the motions together again: the slowest decay, -0.2."""
    flow = Flow(jnp.diag(jnp.array([-0.2, -1.0, -2.0])), jnp.asarray(0.0), jnp.asarray(0.0))

    def exponent(warm_up, renormalise):
        return two_trajectory_exponent(
            flow, Point(1.0, 1.0, 1.0), Segments(1.0, 20, warm_up=warm_up), distance=1e-3,
            renormalise=renormalise, integrator=SMOOTH,
        )  # fmt: skip

    again, printed = jax.jit(lambda: (exponent(20, True), exponent(None, False)))()
    np.testing.assert_allclose(again.exponent, -0.2, atol=1e-6)
    # Spread evenly over three components, of which two are soon gone.
    np.testing.assert_allclose(printed.distance[-1], 1e-3 / 3**0.5 * np.exp(-4.0), rtol=1e-4)
    np.testing.assert_allclose(printed.running[-1], -0.2 - 0.5 * np.log(3.0) / 20, atol=1e-5)
    assert np.isnan(printed.error)


# Maps


def test_maps():
    """Logistic at 4: ln 2. Tent of slope s: ln s exactly."""
    logistic = lyapunov_spectrum_of_map(lambda x: 4 * x * (1 - x), 0.2345, Segments(1, 20_000, 100))
    agree(logistic.exponents[0], np.log(2), logistic.error[0], 0.01)
    slope = 1.99  # at 2 the orbit ends at 0: each step shifts out a binary digit
    tent = lyapunov_spectrum_of_map(
        lambda x: slope * jnp.where(x < 0.5, x, 1 - x), 0.2345, Segments(1, 200)
    )
    np.testing.assert_allclose(tent.exponents, np.log(slope), rtol=1e-13)
    assert float(tent.error[0]) < 1e-12


def test_segments_of_several_iterations():
    """The volume of the Hénon map shrinks by 0.3 an iteration, however many make a segment."""
    found = lyapunov_spectrum_of_map(
        lambda z: (1 - 1.4 * z[0] ** 2 + z[1], 0.3 * z[0]), (0.1, 0.1), Segments(3, 20, 6, 2, t0=10)
    )
    np.testing.assert_allclose(found.local.sum(axis=1), np.log(0.3), rtol=1e-12)
    np.testing.assert_array_equal(found.time, 3.0 * np.arange(1, 21))
    assert float(found.t1) == 10 + 6 + 3 * (20 + 2)


@pytest.mark.more
def test_growth_of_volume_after_a_transient():
    """The damper takes 0.1 / s of the volume, wherever the average begins."""
    system = OscillatorBetweenStops(
        1.0, 2.0, damping=0.1, lower=-9.0, upper=9.0, restitution=0.8, rest_speed=0.0
    )
    record = Segments(0.1, 20, transient=1.0, warm_up=2, t0=3.0)
    grown = jax.jit(lambda: volume_growth(system, Motion(0.0, 1.5), record, integrator=FINE))()
    np.testing.assert_allclose(grown, -0.1, rtol=1e-10)


@pytest.mark.slow
def test_henon_map():
    """Sprott 2003: 0.4192; the determinant is -0.3 everywhere."""
    henon = lyapunov_spectrum_of_map(
        lambda z: (1 - 1.4 * z[0] ** 2 + z[1], 0.3 * z[0]), (0.1, 0.1), Segments(1, 40_000, 100)
    )
    agree(henon.exponents[0], 0.4192, henon.error[0], 0.01)
    np.testing.assert_allclose(henon.sum, np.log(0.3), rtol=1e-12)


# Events


def switchable(monkeypatch):
    """The engine's saltation where `args` is true, else what stands there if one forgets about it."""
    right = WithDeviations.transition

    def transition(self, t, y, mode, guard, args):
        after, new = right(self, t, y, mode, guard, args)

        def through(d):
            # As if every deviated motion met the event at the same time: the Jacobian of the jump.
            jump = lambda s: self.system.transition(t, s, mode, guard, args)[0]  # noqa: E731
            return jax.jvp(jump, (y.y,), (d,))[1]

        frozen = jax.vmap(through, -1, -1)(y.deviations)
        chosen = jax.tree.map(lambda a, b: jnp.where(args, a, b), after.deviations, frozen)
        return after._replace(deviations=chosen), new

    monkeypatch.setattr(WithDeviations, "transition", transition)


def equals_the_computation_by_hand(growth, e):
    """Growth of both directions over 30 s and a dozen impacts, from the same frame."""
    exact = BY_HAND._replace(e=e).growth(START, 30.0, np.asarray(first_frame(2, 2)))
    np.testing.assert_allclose(growth, exact, atol=1e-6)


def test_impacts_equal_the_computation_by_hand(monkeypatch):
    """Two restitutions in a batch; the same test fails once saltation is switched off."""
    switchable(monkeypatch)

    @jax.jit
    def grown(restitution, saltation):
        def lane(e, saltation):
            # Segments in step with the computation by hand.
            found = lyapunov_spectrum(
                impacting(e=e), START, Segments(1.5, 20, warm_up=0, blocks=2), args=saltation,
                integrator=FINE,
            )  # fmt: skip
            return found.local.sum(axis=0) * 1.5

        return jax.vmap(lane)(restitution, saltation)

    found = np.asarray(grown(jnp.array([0.8, 0.82, 0.8]), jnp.array([True, True, False])))
    equals_the_computation_by_hand(found[0], 0.8)
    equals_the_computation_by_hand(found[1], 0.82)
    assert found[0, 0] > 3.0
    assert found[1, 0] < 0.0
    with pytest.raises(AssertionError, match="Not equal to tolerance"):
        equals_the_computation_by_hand(found[2], 0.8)
    assert abs(found[2] - found[0]).max() > 0.5

    @jax.jit
    def volume():
        return volume_growth(
            impacting(), START, Segments(1.5, 20, warm_up=0), integrator=FINE, max_events=64
        )

    np.testing.assert_allclose(found[0].sum(), 30.0 * volume(), atol=1e-7)


# The sum of the exponents is the mean growth of volume: divergence of the fields, ln |det S| of events.

STOPPED = OscillatorBetweenStops(
    1.0, 2.0, damping=0.1, lower=-0.6, upper=1.0, restitution=0.8, rest_speed=0.0,
    force_amplitude=0.7, force_frequency=1.3,
)  # fmt: skip
BELT = BlockOnBelt.constructed(85.0)
DRIVEN = BlockOnDrivenBelt.constructed(85.0)
BELT_START = BlockState(0.0, 0.0, 0.0, 0.0)
DRIVEN_START = DrivenBlockState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
FREE_BEAM = JointedBeam.constructed(5e-3, mu_s=0.0, damping=0.02, modes=2)
SUMS = {
    # system, start, duration, whether the exponents are finite
    "between stops": (STOPPED, Motion(0.0, 1.5), 12.0, True),
    "ball": (BouncingBall(0.5, 9.81, 0.7, 0.02), Motion(1.0, 0.0), 2.0, True),
    "block on belt": (BELT, BELT_START, 4.0, True),
    "block with drive": (DRIVEN, DRIVEN_START, 4.0, True),
    "set-valued block": (BlockOnBeltSetValued.constructed(85.0), BELT_START, 4.0, False),
    "set-valued block with drive": (
        BlockOnDrivenBeltSetValued.constructed(85.0),
        DRIVEN_START,
        4.0,
        False,
    ),
    "beam without friction": (FREE_BEAM, FREE_BEAM.start(), 4.0, True),
    "beam": (JointedBeam.constructed(5e-3, modes=2), FREE_BEAM.start(), 4.0, False),
    "beam as printed": (JointedBeam.printed(5e-3, modes=2), FREE_BEAM.start(), 4.0, False),
    **{
        name: (CASES[name].system, CASES[name].start, CASES[name].t1, False)
        for name in ("oscillator on a belt", "sliding block", "two blocks")
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SUMS)
def test_sum_of_exponents_is_the_growth_of_volume(name):
    """Over the same time the two are one number; where slip ends in stick both are minus infinity."""
    system, start, duration, finite = SUMS[name]
    # In the stiff contact a direction shrinks by 1e11 within 0.05 s.
    segments = 400 if "block " in name else 40

    @jax.jit
    def both():
        record = Segments(duration / segments, segments, warm_up=0)
        found = lyapunov_spectrum(system, start, record, integrator=FINE)
        return found.sum, volume_growth(system, start, record, integrator=FINE)

    total, volume = (float(a) for a in both())
    if finite:
        assert volume != 0.0
        np.testing.assert_allclose(total, volume, rtol=1e-6, atol=1e-7)
    else:
        assert total == volume == -np.inf


@pytest.mark.slow
def test_impacts_over_a_long_time_and_by_two_trajectories():
    options = dict(record=Segments(1.5, 2000, 150.0), integrator=FINE)
    found = jax.jit(lambda: lyapunov_spectrum(impacting(), START, **options))()
    # The computation by hand has an error too: parts from different starts, their beginnings left out.
    parts = []
    for x in np.linspace(0.1, 0.6, 8):
        whole, first = (BY_HAND.growth((x, 0.1), t, np.eye(2)) for t in (600.0, 100.0))
        parts.append((whole - first) / 500.0)
    exact, spread = np.mean(parts, axis=0), np.std(parts, axis=0, ddof=1) / 8**0.5
    for i in range(2):
        agree(found.exponents[i], exact[i], np.hypot(found.error[i], spread[i]), 0.025)
    two = jax.jit(lambda: two_trajectory_exponent(impacting(), START, distance=1e-7, **options))()
    agree(two.exponent, exact[0], np.hypot(two.error, spread[0]), 0.025)


@pytest.mark.more
def test_stick_slip_cycle_has_zero_and_minus_infinity():
    """One direction is along the cycle, the other is lost whenever the block comes to stick."""
    speeds = [0.2, 0.3]
    found = lyapunov_diagram(
        CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), {"belt_speed": speeds},
        lambda system: Motion(0.0, system.belt_speed),
        Segments(2.0, 60, warm_up=10), spectrum={"integrator": SMOOTH},
        compute=Compute("portable"),
    )  # fmt: skip
    assert found.exponents.dims == ("belt_speed", "exponent")
    assert found.exponents.units == "1/s"
    np.testing.assert_array_equal(found.status, 0)
    assert np.isneginf(found.exponents[:, 1]).all()
    assert np.isnan(found.error[:, 1]).all()
    assert (abs(found.exponents[:, 0]) <= 3 * found.error[:, 0]).all()
    assert float(found.error[:, 0].max()) < 0.05
    for lost, v in zip(found.lost.values, speeds, strict=True):
        stick, slip = 1.0 / v, 2 * np.pi - 2 * np.arctan(0.5 / v)
        # Lost in every segment that ends in a stick: what takes its place is a speed against the
        # belt, which a stick does not allow.
        assert abs(lost[1] - 60.0 * stick / (stick + slip)) <= 1
        assert lost[0] == 0


# The parts


def test_lost_direction_is_replaced():
    images = jnp.array([[1.0, 2.0, 0.3], [0.0, 0.0, 0.1], [2.0, 4.0, 0.7]])
    q, logs = orthonormal_columns(images)
    np.testing.assert_allclose(q.T @ q, np.eye(3), atol=1e-14)
    assert np.isneginf(np.asarray(logs)).tolist() == [False, True, False]


def test_error_sees_noise_and_drift():
    noise = np.random.default_rng(1).standard_normal((4000, 1))
    mean, error = mean_and_error(jnp.asarray(noise), 10)
    assert 0.3 / 4000**0.5 < float(error[0]) < 3 / 4000**0.5
    drift = 1 / np.arange(1.0, 1001)[:, None]  # a shear: ln(t)/t on its way to 0
    mean, error = mean_and_error(jnp.asarray(drift), 10)
    assert abs(float(mean[0])) <= 3 * float(error[0])


# Bad input


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": 0.0}, "length = 0.0: it must be finite and positive"),
        ({"count": 2}, "count = 2: it must be an integer of at least 4"),
        ({"count": 12}, "count = 12: it must be at least 2 blocks = 20"),
        ({"warm_up": -1}, "warm_up = -1"),
        ({"blocks": 1}, "blocks = 1"),
        ({"exponents": 3}, "exponents = 3: it must be at most 2"),
        ({"transient": -1.0}, "transient = -1.0"),
        ({"components": ("x", "w")}, r"components = \('x', 'w'\): .* of x, v"),
        ({"components": ()}, "components"),
    ],
)
def test_wrong_arguments(changes, message):
    own = {name: changes[name] for name in ("exponents", "components") if name in changes}
    record = {"length": 1.0, "count": 20, **{k: v for k, v in changes.items() if k not in own}}
    with pytest.raises(ValueError, match=message):
        lyapunov_spectrum(impacting(), START, Segments(**record), **own)
    with pytest.raises(TypeError, match="system = 'oscillator': it must be"):
        lyapunov_spectrum("oscillator", START, Segments(1.0, 20))


def test_wrong_arguments_of_the_others():
    with pytest.raises(ValueError, match=r"distance = 0\.0"):
        two_trajectory_exponent(impacting(), START, Segments(1.0, 20), distance=0.0)
    with pytest.raises(ValueError, match=r"record\.length = 0\.5: it must be a whole number of iter"):
        lyapunov_spectrum_of_map(lambda x: x, 0.1, Segments(0.5, 20))
    with pytest.raises(TypeError, match="unexpected keyword argument 'iterations'"):
        lyapunov_spectrum_of_map(lambda x: x, 0.1, Segments(1, 100), iterations=100)
    with pytest.raises(TypeError, match="function"):
        lyapunov_spectrum_of_map(2.0, 0.1, Segments(1, 100))
    grid = {"damping": [0.1]}
    for system, y0, message in (
        ("oscillator", START, "system = 'oscillator'"),
        (impacting(), START, r"grid\['wrong'\]"),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            lyapunov_diagram(
                system,
                {"wrong": [1.0]} if system != "oscillator" else grid,
                y0,
                Segments(1.0, 20),
            )
    with pytest.raises(TypeError, match=r"spectrum = \[1\]: it must be"):
        lyapunov_diagram(impacting(), grid, START, Segments(1.0, 20), spectrum=[1])
    with pytest.raises(ValueError, match="count = 3"):
        lyapunov_diagram(impacting(), grid, START, Segments(1.0, 3))
    with pytest.raises(TypeError, match=r"record = 30\.0: it must be a Segments"):
        volume_growth(impacting(), START, 30.0)
    assert LyapunovSpectrum.__doc__
