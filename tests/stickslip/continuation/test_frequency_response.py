"""Responses over the frequency against closed forms between events and harmonic balance."""

import itertools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from stickslip.continuation import (
    Follow,
    Forcing,
    OrbitGuess,
    backbone,
    continue_orbit,
    forced_response,
    frequency_response,
)
from tests.stickslip.continuation._forced import (
    PUSH,
    REST,
    Duffing,
    Jenkins,
    Linear,
    Slider,
    exact,
    flow,
    half_turn,
    harmonic_balance,
    solved,
)
from tests.stickslip.continuation._systems import CoulombForced, Motion

# spec/next.md, section 1.
TABLE = {
    0.8: 0.116198657201, 0.95: 0.167026567503, 1.0: 0.199363055707, 1.05: 0.399871551729,
    1.1: 0.504814269795, 1.15: 0.439833909646, 1.2: 0.375320078054, 1.25: 0.322681175343,
}  # fmt: skip
PEAK = 1.08530718, 0.512307322015


def transfer(s, w):
    """Response of the linear oscillator to a force of 1."""
    return 1.0 / (s.stiffness - s.mass * w**2 + 1j * s.damping * w)


@pytest.mark.more
def test_a_linear_oscillator_is_its_transfer_function():
    """Amplitude, phase, mean, other harmonics; also of the speed, and with a force that leads."""
    system = Linear(1.3, lead=0.4, offset=2.0)
    read = {"x": "x", "v": "v", "a": lambda s, t, y, dy, mode, args: dy.v}
    found = forced_response(system, Motion(0.0, 0.0), PUSH, observables=read)
    known = 0.7 * transfer(system, 1.3)
    for name, factor in (("x", 1.0), ("v", 1.3j), ("a", -(1.3**2))):
        assert complex(found.harmonics[name][0]) == pytest.approx(known * factor, abs=1e-10)
        assert np.max(np.abs(found.harmonics[name][1:])) < 1e-10
        assert float(found.amplitude[name]) == pytest.approx(abs(known * factor), abs=1e-10)
    assert float(found.phase["x"]) == pytest.approx(np.angle(known), abs=1e-10)
    assert float(found.mean["x"]) == pytest.approx(2.0 / 5.0, abs=1e-10)
    assert bool(found.stable)
    assert int(found.num_conserved) == 0
    decay = np.exp(-0.15 / 2.0 * 2.0 * np.pi / 1.3)
    np.testing.assert_allclose(np.abs(found.multipliers), decay, rtol=1e-10)


@pytest.mark.more
def test_in_any_units():
    """The same in units of a hundred millionth, and in those a hundred million times as large."""
    for size, time in ((1e-8, 1e-3), (1e8, 1e4)):
        system = Linear(
            1.3 / time, stiffness=5.0 / time**2, damping=0.3 / time, force=0.7 * size / time**2
        )
        found = forced_response(system, Motion(0.0, 0.0), PUSH)
        known = 0.7 * size * transfer(Linear(1.3), 1.3)
        assert abs(complex(found.harmonics["x"][0]) - known) < 1e-10 * size
        assert float(found.amplitude["x"]) == pytest.approx(abs(known), rel=1e-10)


def test_bad_arguments_are_named():
    with pytest.raises(
        ValueError, match=r"forcing.frequency = 'speed': it must be named after a param"
    ):
        forced_response(Linear(1.3), Motion(0.0, 0.0), Forcing("speed"))
    with pytest.raises(ValueError, match=r"observables\['y'\] = 'y': it must be a comp"):
        forced_response(Linear(1.3), Motion(0.0, 0.0), observables="y")
    with pytest.raises(ValueError, match=r"frequencies\[1\] = 1.0: it must be above the one"):
        frequency_response(Linear(1.3), Motion(0.0, 0.0), (2.0, 1.0))
    with pytest.raises(ValueError, match=r"forcing.force = None: it must be given"):
        backbone(Linear(1.3), Motion(0.0, 0.0), "force", [1.0])
    with pytest.raises(ValueError, match=r"energy = None: it must be given for a system that has no"):
        backbone(Duffing(1.3), Motion(0.0, 0.0), "force", [1.0], Forcing(force="t"))


@pytest.mark.more
@pytest.mark.parametrize(("w", "limit"), [(0.97, 0.02), (1.003, 0.02), (1.02, 0.002)])
def test_what_is_hardly_damped_is_simulated_until_newtons_method_finds_it(w, limit):
    """Q is 1,000; the last one ends in another mode than it begins in, 20 periods after its start."""
    found = forced_response(Jenkins(w, limit=limit, damping=0.001), REST, PUSH)
    top = float(found.amplitude["x"])
    guess = [top, 3.11 if w > 1.0 else 0.03, np.arccos(1.0 - 4.0 * limit / top)]
    known = solved(half_turn, guess, w, 0.1, limit, 1.0, 0.5, 0.001)
    assert top == pytest.approx(known[0], rel=1e-10)
    assert int(found.num_events) == 4


@pytest.fixture(scope="module")
def jenkins():
    return frequency_response(Jenkins(1.0), REST, (0.6, 2.0), PUSH, observables=("x", "slider_force"))


@pytest.mark.slow
def test_jenkins_in_one_call():
    found = frequency_response(Jenkins(1.0), REST, list(TABLE), PUSH)
    np.testing.assert_array_equal(found.frequency, list(TABLE))
    np.testing.assert_allclose(found.amplitude["x"], list(TABLE.values()), atol=1e-11)
    assert np.asarray(found.responses.num_events).tolist() == [0, 0, 0, 4, 4, 4, 4, 4]
    assert found.stable.all()


@pytest.mark.slow
def test_the_peak_and_the_borders(jenkins):
    """At a border the stuck oscillator reaches f_s/k_t; the peak is where the closed form has it."""
    value, top = jenkins.peak()
    assert value == pytest.approx(PEAK[0], abs=2e-8)
    assert float(top.amplitude["x"]) == pytest.approx(PEAK[1], abs=1e-11)
    near, step = [PEAK[1], 1.65, 1.2], 1e-5
    slope = [exact(value + s * step, near)[0] for s in (-1.0, 1.0)]
    assert (slope[1] - slope[0]) / (2.0 * step) == pytest.approx(0.0, abs=1e-6)
    borders = [
        brentq(lambda w: abs(0.1 / (1.5 - w**2 + 0.04j * w)) - 0.2, *ends)
        for ends in ((0.9, 1.1), (1.3, 1.5))
    ]
    np.testing.assert_allclose([s.value for s in jenkins.branch["GR"]], borders, atol=1e-8)
    first, slips, last = jenkins.parts
    assert (first.num_events, slips.num_events, last.num_events) == (0, 4, 0)
    assert first.words == last.words == "stick; one of a family: 1 conserved, as in the start"
    assert slips.words == "stick, slip forward, stick, slip backward"
    assert jenkins.stable.all()


@pytest.mark.slow
def test_every_point_is_in_closed_form(jenkins):
    """The stuck ones from the virgin state, the slider's loop, and the work of one turn."""
    stuck = np.asarray(jenkins.responses.num_events) == 0
    w, a = jenkins.frequency, jenkins.amplitude["x"]
    linear = 0.1 / (1.5 - w**2 + 0.04j * w)
    np.testing.assert_allclose(a[stuck], np.abs(linear)[stuck], atol=1e-10)
    first = jenkins.responses.harmonics["x"][:, 0]
    np.testing.assert_allclose(first[stuck], linear[stuck], atol=1e-10)
    np.testing.assert_allclose(jenkins.responses.mean["x"], 0.0, atol=1e-10)
    slips = np.flatnonzero(~stuck)
    np.testing.assert_allclose(jenkins.amplitude["slider_force"][slips], 0.1, atol=1e-10)
    for i in slips[:: max(1, slips.size // 8)]:
        known = exact(w[i], [a[i], np.mod(np.angle(-1j * first[i].conj()) + np.pi / 2, np.pi), 1.3])
        assert a[i] == pytest.approx(known[0], abs=1e-9)
    # All that the force gives, pi F |x_1| sin(lag), goes into the dashpot and 4 f_s (A - f_s/k_t).
    f = jenkins.responses.harmonics["slider_force"]
    x = jenkins.responses.harmonics["x"]
    odd = np.arange(1, 4)
    taken = np.pi * np.sum(odd * np.imag(np.conj(x) * f), axis=1) * -1.0
    loop = 4.0 * 0.1 * (a[slips] - 0.2)
    np.testing.assert_allclose(np.abs(taken[slips]), loop, rtol=2e-2, atol=1e-4)  # three harmonics
    force = -np.pi * 0.1 * np.imag(first[slips])
    dashpot = np.pi * 0.04 * w[slips] * np.sum(odd**2 * np.abs(x[slips]) ** 2, axis=1)
    np.testing.assert_allclose(force - dashpot, loop, rtol=1e-3, atol=1e-6)


@pytest.mark.more
@pytest.mark.parametrize(
    ("limit", "stiffness", "damping", "ends"),
    [
        # Near the border Newton's method comes across slips, which moved the slider: 3.5e-7 off.
        (0.36, 1.4, 0.005, (0.86, 1.45)),
        # Beyond it a step failed, because the slider had the size that it has at rest, and the motion
        # that sticks was taken for what comes next: a border at 1.00124 that is none.
        (0.1, 0.5, 0.04, (0.6, 1.05)),
    ],
)
def test_a_slider_that_begins_to_slip_has_one_border(limit, stiffness, damping, ends):
    def linear(w):
        return 0.1 / (1.0 + stiffness - w**2 + 1j * damping * w)

    system = Jenkins(ends[0], limit=limit, tangential=stiffness, damping=damping)
    x = linear(ends[0])
    start = Slider(x.real, (1j * ends[0] * x).real, 0.0)
    branch = continue_orbit(
        system, OrbitGuess(start, 2.0 * np.pi / ends[0], 1), "frequency", ends,
        forcing_period=PUSH.rule, follow=Follow(step=0.02, max_points=1000, both=False),
    )  # fmt: skip
    assert [special.label for special in branch.specials] == ["GR", "EP"]
    border, end = branch.specials
    right = brentq(lambda w: abs(linear(w)) - limit / stiffness, 0.95, ends[1])
    assert border.value == pytest.approx(right, abs=1e-10)
    assert abs(float(border.orbit.y0.z)) < 1e-15
    assert end.value == pytest.approx(ends[1], abs=1e-12)
    assert int(end.orbit.events.count) == 4


@pytest.mark.more
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_a_slider_that_never_moves_has_the_size_of_what_does(unit):
    """In nanometres as in metres: its place is one multiplier, the others are those of the mass."""
    found = forced_response(Jenkins(0.8, limit=0.1 * unit, force=0.1 * unit), REST, PUSH)
    decay = np.exp(-0.02 * 2.0 * np.pi / 0.8)
    assert float(found.y0.z) == 0.0
    np.testing.assert_allclose(np.abs(found.multipliers), [1.0, decay, decay], rtol=1e-6)
    assert (int(found.num_conserved), bool(found.stable)) == (1, True)
    assert float(found.amplitude["x"]) == pytest.approx(0.116198657201 * unit, rel=1e-9)


@pytest.mark.slow
def test_harmonic_balance_converges_to_it():
    known = float(forced_response(Jenkins(1.1), REST, PUSH).amplitude["x"])
    errors = [abs(harmonic_balance(1.1, count) - known) for count in (1, 3, 5, 9, 15)]
    assert all(later < 0.5 * before for before, later in itertools.pairwise(errors))
    assert errors[-1] < 1e-6


@pytest.mark.slow
def test_sliders_that_can_stick_stay_where_the_start_has_them():
    """One of a family: the place is that of the start, the amplitude that of all of them."""
    for place in (0.0, 0.1, -0.05):
        found = forced_response(Jenkins(0.8), slider_at(place), PUSH)
        assert float(found.y0.z) == place
        assert float(found.mean["x"]) == pytest.approx(place / 3.0, abs=1e-11)
        assert int(found.num_conserved) == 1
        assert float(found.amplitude["x"]) == pytest.approx(TABLE[0.8], abs=1e-11)
    # It cannot: they shake down to where it can just be.
    found = forced_response(Jenkins(0.8), slider_at(0.3), PUSH, periods=100)
    assert abs(float(found.y0.z)) < 0.3
    assert float(found.amplitude["x"]) == pytest.approx(TABLE[0.8], abs=1e-9)


def slider_at(place):
    return eqx.tree_at(lambda s: s.z, REST, place)


@pytest.mark.slow
def test_derivatives_are_those_of_the_closed_form():
    def amplitude(p):
        return forced_response(Jenkins(p[0], limit=p[1]), REST, PUSH).amplitude["x"]

    point, h, near = jnp.asarray([1.1, 0.1]), 1e-5, [0.5, 1.7, 1.2]
    by_frequency = (exact(1.1 + h, near)[0] - exact(1.1 - h, near)[0]) / (2.0 * h)
    by_limit = (exact(1.1, near, limit=0.1 + h)[0] - exact(1.1, near, limit=0.1 - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(jax.jacfwd(amplitude)(point), [by_frequency, by_limit], atol=1e-7)
    np.testing.assert_allclose(jax.grad(amplitude)(point), [by_frequency, by_limit], atol=1e-7)


@pytest.mark.slow
def test_lanes():
    """Friction by lanes, from nothing to what sticks all the time: limits are linear."""
    limits = jnp.asarray([0.0, 0.02, 0.05, 0.1, 0.2, 1.0])

    def amplitude(limit):
        found = forced_response(Jenkins(1.1, limit=limit), REST, PUSH)
        return found.amplitude["x"], found.successful

    found, good = ss.map_lanes(amplitude)(limits)
    assert good[1:].all()
    ends = [abs(0.1 / (k - 1.21 + 0.044j)) for k in (1.0, 1.5)]
    assert float(found[-1]) == pytest.approx(ends[1], abs=1e-10)
    slips = slice(1, 4)
    known = [
        exact(1.1, [a, 2.0, 1.0], limit=float(limit))[0]
        for limit, a in zip(limits[slips], found[slips], strict=True)
    ]
    np.testing.assert_allclose(found[slips], known, atol=1e-9)
    if bool(good[0]):
        assert float(found[0]) == pytest.approx(ends[0], abs=1e-9)
    else:
        assert np.isnan(found[0])


def den_hartog(w, f, guess):
    """Amplitude and phase at the top of the orbit that never stops."""

    def wrong(u):
        top, phase = u
        state = np.array([top, 0.0, np.cos(phase), np.sin(phase), 1.0])
        end = flow(w, 1.0, 0.1, f, 1.0, np.pi / w) @ state
        return [end[0] + top, end[1]]

    return solved(wrong, guess)


@pytest.mark.slow
def test_den_hartog_in_one_call():
    """Where it begins to stop (O6): the force after a reversal is the kinetic one."""
    found = frequency_response(CoulombForced(1.5, 1.0), Motion(0.0, 0.0), (0.6, 1.4), Forcing())
    free = np.asarray(found.responses.num_events) == 2
    near = None
    for w, a in zip(found.frequency[free][::-4], found.amplitude["x"][free][::-4], strict=True):
        near = den_hartog(w, 1.5, [a, 2.5] if near is None else near)
        assert a == pytest.approx(near[0], abs=1e-9)

    def left(w):
        top, phase = den_hartog(w, 1.5, near)
        return 1.5 * np.cos(phase) - top + 1.0

    (border,) = (s for s in found.branch["GR"] if abs(left(s.value)) < 1e-3)
    assert border.value == pytest.approx(
        brentq(left, border.value - 0.01, border.value + 0.01), abs=1e-8
    )
    levels = frequency_response(
        CoulombForced(1.3770178175, 1.0), Motion(0.0, 0.0), (0.9, 1.1), Forcing()
    )
    assert any(abs(s.value - 1.0) < 1e-7 for s in levels.branch["GR"])


def duffing_fold(guess):
    """Harmonic balance of nine harmonics, extended by a singular Jacobian."""
    odd = np.arange(1, 10, 2)
    turn = 2.0 * np.pi * np.arange(256) / 256
    waves = np.concatenate([np.cos(np.outer(odd, turn)), np.sin(np.outer(odd, turn))])

    def parts(u, w):
        a, b, n = u[:5], u[5:], odd * w
        f = 2.0 / 256 * waves @ ((u @ waves) ** 3)
        load = np.array([0.2, 0.0, 0.0, 0.0, 0.0])
        one = np.concatenate([(1 - n**2) * a + 0.1 * n * b - load, (1 - n**2) * b - 0.1 * n * a]) + f
        slope = 2.0 / 256 * (waves * (3.0 * (u @ waves) ** 2)) @ waves.T
        slope += np.block(
            [[np.diag(1 - n**2), np.diag(0.1 * n)], [-np.diag(0.1 * n), np.diag(1 - n**2)]]
        )
        return one, np.linalg.det(slope / np.linalg.norm(slope, axis=1, keepdims=True))

    def wrong(z):
        one, other = parts(z[:-1], z[-1])
        return np.append(one, other)

    return solved(wrong, guess)[-1]


@pytest.mark.slow
def test_a_duffing_oscillator_folds():
    found = frequency_response(Duffing(1.0), Motion(0.0, 0.0), (0.8, 2.2), follow=Follow(step=0.03))
    folds = found.branch["LP"]
    assert len(folds) == 2
    w = np.asarray(found.frequency)
    # Beside a fold, on its own branch: there the frequency turns.
    turned = np.flatnonzero(np.diff(w[1:]) * np.diff(w[:-1]) < 0) + 1
    for fold in folds:
        i = turned[np.argmin(np.abs(w[turned] - fold.value))]
        first = found.responses.harmonics["x"][i]
        guess = np.zeros(11)
        guess[[0, 5, 10]] = first[0].real, -first[0].imag, fold.value
        guess[[1, 6]] = first[2].real, -first[2].imag
        assert fold.value == pytest.approx(duffing_fold(guess), abs=1e-8)
    upper, lower = (s.value for s in folds)
    assert lower < upper
    turned = np.flatnonzero(np.diff(found.frequency) < 0)
    middle = turned[2:-2]
    assert not found.stable[middle].any()
    assert found.stable[: turned[0]].all()
    assert found.stable[turned[-1] + 2 :].all()
    asked = frequency_response(Duffing(1.0), Motion(0.0, 0.0), (0.8, 0.5 * (lower + upper), 2.2))
    assert asked.frequency.size == 5
    assert asked.stable.tolist() == [True, True, False, True, True]
    assert np.all(np.diff(asked.amplitude["x"][1:4]) < 0)


@pytest.mark.slow
def test_phase_resonance_of_a_linear_oscillator():
    """At its natural frequency, with the damping ratio c/(2 sqrt(k m)) and the amplitude F/(c w)."""
    system, natural = Linear(1.5), np.sqrt(5.0 / 2.0)
    found = backbone(system, Motion(0.0, 0.0), "force", [0.1, 0.7, 3.0], PUSH)
    np.testing.assert_allclose(found.frequency, natural, rtol=1e-11)
    np.testing.assert_allclose(found.damping, 0.3 / (2.0 * np.sqrt(10.0)), rtol=1e-9)
    np.testing.assert_allclose(found.amplitude, np.array([0.1, 0.7, 3.0]) / (0.3 * natural), rtol=1e-9)


@pytest.mark.slow
def test_phase_resonance_of_a_jenkins_oscillator():
    """Dissipated are the dashpot's part and 4 f_s (A - f_s/k_t); stiffer where it sticks."""
    found = backbone(Jenkins(1.2), REST, "force", [0.005, 0.03, 0.05, 0.1, 0.3], PUSH)
    assert np.all(np.diff(found.frequency) < 0)
    assert found.frequency[0] == pytest.approx(np.sqrt(1.5), abs=1e-10)
    assert found.damping[0] == pytest.approx(0.04 / (2.0 * np.sqrt(1.5)), rel=1e-9)
    for force, w, a, work in zip(
        found.values[1:], found.frequency[1:], found.amplitude[1:], found.dissipation[1:], strict=True
    ):
        assert a == pytest.approx(exact(w, [a, 1.57, 1.0], force=force)[0], abs=1e-9)
        x = found.responses.harmonics["x"][np.flatnonzero(found.values == force)[0]]
        assert x[0].real == pytest.approx(0.0, abs=1e-11)
        dashpot = np.pi * 0.04 * w * np.sum(np.arange(1, 4) ** 2 * np.abs(x) ** 2)
        assert work == pytest.approx(dashpot + 0.4 * (a - 0.2), rel=2e-4)
    assert np.argmax(found.damping) not in (0, 4)


@pytest.mark.slow
def test_a_second_curve_compiles_nothing(jenkins, compiled):
    """The first one along which an orbit has to begin elsewhere has a program of its own for that."""
    for limit in (0.07, 0.071):
        compiled.clear()
        found = frequency_response(
            Jenkins(1.0, limit=limit), REST, (0.7, 1.9), PUSH, observables=("x", "slider_force")
        )
        repr(found), found.peak(), found.stable, found.responses.phase
    assert compiled == []


@pytest.mark.slow
def test_where_friction_holds_everything():
    found = forced_response(CoulombForced(0.7, 1.0), Motion(0.0, 0.0), Forcing())
    assert bool(found.at_rest)
    assert float(found.amplitude["x"]) == 0.0
    with pytest.raises(ValueError, match="friction holds everything at rest"):
        frequency_response(CoulombForced(0.7, 1.0), Motion(0.0, 0.0), (0.6, 1.4), Forcing())
