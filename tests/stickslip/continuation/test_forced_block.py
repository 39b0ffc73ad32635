"""The forced block's tori and grazing orbits against shooting with SciPy alone."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, fsolve

from stickslip.continuation import Follow, OrbitGuess, continue_orbit, continue_point, periodic_orbit
from tests.stickslip.continuation._systems import ForcedBlock, Motion, closed_branch, of_frequency

pytestmark = pytest.mark.slow


def slip(t, y, force, w):
    """Slower than the belt; the third number is the integral of the divergence."""
    u = 1.0 - y[1]
    rate = -y[0] + 1.5 - 1.5 * u + 0.45 * u**3 + force * np.cos(w * t)
    return y[1], rate, 1.5 - 1.35 * u**2


def end(state, force, w, turns, **options):
    start = [*state, 0.0]
    return solve_ivp(
        slip, (0.0, 2 * np.pi * turns / w), start, "DOP853", args=(force, w), rtol=1e-12, atol=1e-13,
        **options,
    )  # fmt: skip


@pytest.mark.parametrize(("w", "force"), [(3.0, 1.2720514849), (3.5, 1.5279422492)])
def test_torus_of_the_pure_slip_orbit(w, force):
    """A conjugate pair is on the unit circle where the integral of the divergence is zero."""
    start = OrbitGuess(Motion(0.45 + 0.8 / (1.0 - w * w), 0.0), 2 * np.pi / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.8, w),
        start,
        "amplitude",
        (0.7, 2.0),
        forcing_period=of_frequency,
        follow=Follow(step=0.05),
    )
    (torus,) = branch["NS"]
    assert np.abs(torus.orbit.multipliers) == pytest.approx(1.0, abs=1e-9)
    assert int(torus.orbit.events.count) == 0

    def wrong(z):
        last = end(z[:2], z[2], w, 1).y[:, -1]
        return last - [z[0], z[1], 0.0]

    known = fsolve(wrong, [0.45 + force / (1.0 - w * w), 0.0, force], xtol=1e-13)
    assert known[2] == pytest.approx(force, abs=1e-9)
    assert torus.value == pytest.approx(known[2], abs=1e-9)


def from_touch(z, turns):
    """Change of the state over so many turns from where it touches the belt's speed, and derivative.

    At the time, frequency and force `z` it does with v = 1 and no acceleration: x is then known too.
    """
    at, w, force = z

    def slip_and_deviations(t, y):
        rate = 1.5 - 1.35 * (1.0 - y[1]) ** 2
        return *slip(t, y, force, w)[:2], y[3], rate * y[3] - y[2], y[5], rate * y[5] - y[4]

    start = np.array([1.5 + force * np.cos(w * at), 1.0])
    span = at, at + 2 * np.pi * turns / w
    options = {"rtol": 1e-12, "atol": 1e-13, "max_step": 0.2}
    end = solve_ivp(slip_and_deviations, span, [*start, 1.0, 0.0, 0.0, 1.0], "DOP853", **options)
    return end.y[:2, -1] - start, end.y[2:, -1].reshape(2, 2)


def touch(turns, phase, w):
    """Frequency at which an orbit touches the speed of the belt, and its multipliers; force 0.1."""
    z = fsolve(lambda z: from_touch([*z, 0.1], turns)[0], [phase, w], xtol=1e-13)
    found = np.linalg.eigvals(from_touch([*z, 0.1], turns)[1])
    return z[1], found[np.argsort(-np.abs(found))]


def touch_and_flip(phase, w, force):
    """Frequency and force at which the orbit of two turns touches the belt's speed and doubles."""

    def wrong(z):
        away, derivative = from_touch(z, 2)
        return *away, np.linalg.det(derivative + np.eye(2))

    return fsolve(wrong, [phase, w, force], xtol=1e-13)[1:]


def test_an_orbit_of_the_field_that_violates_a_guard_is_refused():
    """Beyond its grazing the orbit of the slip field goes on, faster than the belt for a while."""
    w, force = 1.66, 0.1

    def wrong(y):
        return end(y, force, w, 2).y[:2, -1] - y

    def late(t, y, force, w):
        return slip(t, y, force, w)[1]

    y = fsolve(wrong, [0.0626, 0.067], xtol=1e-13)
    late.direction = -1.0
    run = end(y, force, w, 2, events=late)
    top = int(np.argmax(run.y_events[0][:, 1]))
    at, fastest = float(run.t_events[0][top]), run.y_events[0][top]
    assert fastest[1] > 1.01
    guess = OrbitGuess(Motion(float(fastest[0]), float(fastest[1])), 4 * np.pi / w, 0, at)
    found = periodic_orbit(ForcedBlock(force, w), guess, forced=True)
    assert not bool(found.successful)


@pytest.mark.parametrize(
    ("turns", "w", "start", "phase", "least"),
    [(2, 1.67, (0.06294528, 0.05908821), 2.22, 1.665), (4, 1.711, (0.0693904, 0.00284825), 9.57, 1.7)],
)
def test_grazing_of_the_orbits_of_several_turns(turns, w, start, phase, least):
    """The multipliers at the last orbit without stick are those of the slip, not of the other side."""
    guess = OrbitGuess(Motion(*start), 2 * np.pi * turns / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.1, w),
        guess,
        "frequency",
        (least, w + 0.0015),
        forcing_period=of_frequency,
        follow=Follow(step=0.1),
    )
    (graze,) = branch["GR"]
    known, multipliers = touch(turns, phase, graze.value)
    assert graze.words == "grazing-sliding, 0 events, 2 beyond"
    assert int(graze.orbit.events.count) == 0
    assert graze.value == pytest.approx(known, abs=1e-10)
    np.testing.assert_allclose(np.asarray(graze.orbit.multipliers), multipliers, atol=1e-6)
    assert not branch["PD"]


def test_the_grazing_curve_ends_at_its_doublings():
    """There both ends of the flip curve are: the orbit grazes with a multiplier -1."""
    w = 1.67
    guess = OrbitGuess(Motion(0.06294528, 0.05908821), 4 * np.pi / w, 0)
    branch = continue_orbit(
        ForcedBlock(0.1, w),
        guess,
        "frequency",
        (1.665, 1.6715),
        forcing_period=of_frequency,
        follow=Follow(step=0.1),
    )
    curve = continue_point(
        ForcedBlock(0.1, w),
        branch["GR"][0],
        ("frequency", "amplitude"),
        ((1.4, 3.0), (0.0, 2.0)),
        forcing_period=of_frequency,
        follow=Follow(step=0.05),
    )
    assert [end.words for end in curve.ends] == ["PD: a multiplier is -1"] * 2
    phases = []
    for end in curve.ends:
        frequency, force = end.values
        start = OrbitGuess(end.orbit.y0, end.orbit.period, 0, end.orbit.t0)
        phases.append(fastest(ForcedBlock(force, frequency), start))
    known = [touch_and_flip(t, *end.values) for t, end in zip(phases, curve.ends, strict=True)]
    for end, values in zip(curve.ends, known, strict=True):
        np.testing.assert_allclose(end.values, values, atol=1e-8)
    # Between them the orbit at the border is unstable: the doubled one is there.
    assert (np.real(np.asarray(curve.orbits.multipliers)[1:-1, 0]) < -1.0).all()


def fastest(system, guess):
    """Time at which an orbit of two turns is fastest."""
    run = solve_ivp(
        slip, (float(guess.t0), float(guess.t0 + guess.period)), [*guess.y0, 0.0], "DOP853",
        args=(float(system.amplitude), float(system.frequency)), rtol=1e-10, atol=1e-12, max_step=1e-2,
    )  # fmt: skip
    return run.t[np.argmax(run.y[1])]


def released_again(at, w):
    """Time of the next release from the stick, after one at this time; force 0.1."""

    def stuck(t, y):
        return y[1] - 1.0

    stuck.terminal, stuck.direction = True, 1.0
    options = {"method": "DOP853", "rtol": 1e-13, "atol": 1e-14}
    start = [1.5 + 0.1 * np.cos(w * at), 1.0, 0.0]
    first = solve_ivp(slip, (at, at + 1e-3), start, args=(0.1, w), **options)  # away from v = 1
    run = solve_ivp(
        lambda t, y: slip(t, y, 0.1, w), (at + 1e-3, at + 30.0), first.y[:, -1], events=stuck,
        max_step=4e-3, **options,
    )  # fmt: skip
    t, x = run.t_events[0][0], run.y_events[0][0][0]

    def held(s):
        return x + s - 0.1 * np.cos(w * (t + s)) - 1.5

    high = next(s for s in np.linspace(0.0, 4.0, 400) if held(s) > 0.0)
    return t + brentq(held, 0.0, high, xtol=1e-15)


def test_the_doubled_orbit_with_stick_is_a_fixed_point_of_the_release_map():
    """With a stick the motion is known by when it ends: the slope of this map is the multiplier."""
    branch = closed_branch()
    doubled = continue_orbit(
        branch.system,
        branch["PD"][0],
        "frequency",
        (1.5, 2.0),
        forcing_period=of_frequency,
        follow=Follow(step=0.015),
    )
    # Stick is lost where the orbit of half the period grazes.
    grazing = [point.value for point in doubled["GR"]]
    assert grazing == pytest.approx([1.707799715, 1.667690998], abs=1e-7)
    assert np.asarray(doubled.orbits.repeats).tolist() == [1] * len(doubled)
    sticking = np.flatnonzero(np.asarray(doubled.orbits.events.count) == 2)
    assert sticking.size >= 5
    # It is unstable from where it grazes until it meets the orbit of half its period.
    for i in sticking:
        w, log = doubled.values[i], doubled.orbits.events
        after = np.asarray(log.mode_after[i])[:2]
        (release,), (stick,) = (np.asarray(log.t[i])[:2][slips] for slips in (after == 0, after != 0))
        if (release - stick) % float(doubled.orbits.period[i]) < 0.03:
            continue  # the motion released a little later or earlier does not stick again
        assert (released_again(release, w) - release) * w == pytest.approx(8 * np.pi, abs=1e-6)
        d = 1e-4
        ends = [released_again(release + k * d, w) for k in (-2, -1, 1, 2)]
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * d)
        found = np.asarray(doubled.orbits.multipliers)[i]
        assert found[0] == pytest.approx(slope, rel=1e-5)
        assert found[1] == 0.0
