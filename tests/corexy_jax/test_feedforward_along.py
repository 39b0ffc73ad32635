"""Curves with both motors rolling, against Newton's equations, SciPy and the exact engine."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate
import scipy.optimize

import corexy_jax as cx
from corexy_jax._along import _hold, _least, forces
from corexy_jax._curve_grid import cut
from corexy_jax._leg import plain
from tests.corexy_jax.test_feedforward import MACHINE, needed

ROUNDED = ((0.0, 0.0), (0.3, 0.0), (0.3, 0.2))
RADIUS = 0.05
LINES = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, -1.0]])
CIRCLE = (0.5, 2.0 * np.pi)  # where the circle begins, and by how much it turns [rad]


def arc(start: float, turn: float) -> cx.Path:
    return cx.Path.arc((0.0, 0.0), 0.15, start, turn)


@functools.cache
def corner(**options) -> cx.Feedforward:
    path = cx.Path.rounded(ROUNDED, RADIUS)
    return cx.feedforward_along(MACHINE, path, volts=24.0, **options)


def off_the_corner(place: np.ndarray) -> np.ndarray:
    """Distance [m] of places from the rounded corner."""
    x, y = place.T
    low, high = 0.3 - RADIUS, RADIUS
    off = np.where(x <= low, np.abs(y), np.abs(x - 0.3))
    return np.where((x > low) & (y < high), np.abs(np.hypot(x - low, y - high) - RADIUS), off)


def followed(plan: cx.Feedforward, size: float) -> cx.RollingCheck:
    """What the plan does, which must be as planned."""
    found = cx.check_rolling(plan)
    assert np.all(found.rolls)
    np.testing.assert_allclose(found.slip, 0.0, atol=1e-15)
    assert float(found.deviation) < 1e-8 * size
    assert float(found.end_error) < 1e-8 * size
    assert found.at_rest
    return found


def shares(found: cx.RollingCheck) -> np.ndarray:
    """What the belts need, in parts of their static friction, by the paper's equations, where all
    contacts slide."""
    rows = np.flatnonzero(np.all(np.asarray(found.solution.senses)[:, :6] != 0.0, axis=1))
    return np.array([needed(found.solution, row)[0] for row in rows]) / 3.0


@pytest.mark.slow
def test_a_rounded_corner_is_followed_with_both_motors_rolling():
    plan = corner()
    found = followed(plan, 0.3)
    times = np.linspace(0.0, float(plan.end), 5001)
    place = np.asarray(plan.at(times))
    assert np.max(off_the_corner(place)) < 1e-7
    simulated = np.stack([found.solution.y.x, found.solution.y.y], axis=1)
    assert np.max(off_the_corner(simulated)) < 1e-7
    np.testing.assert_allclose(plan.points[0], ROUNDED[0], atol=1e-12)
    np.testing.assert_allclose(plan.points[-1], ROUNDED[-1], atol=1e-12)
    # Along the arc friction of all lines is told; somewhere the belts are used up, nowhere more.
    used = shares(found)
    assert used.shape[0] > 20
    assert 0.9 * (1.0 - 1e-3) < np.max(used) <= 0.9 * (1.0 + 1e-6)
    # To stop at the corner and to start again takes longer.
    stopped = cx.feedforward(MACHINE, ROUNDED, volts=24.0)
    assert float(plan.end) < 0.95 * float(stopped.end)


@pytest.mark.slow
def test_a_circle_and_a_spline_turn_back_without_being_held():
    """Every line comes to rest and turns: 8 times around the circle, at each the friction jumps."""
    for path, turns in ((arc(*CIRCLE), 8), (cx.Path.through([[0, 0], [0.1, 0.15], [0.2, 0.1],
        [0.35, 0.2]]), 4)):  # fmt: skip
        plan = cx.feedforward_along(MACHINE, path, volts=24.0)
        assert plan.points.shape[0] == turns + 2
        found = followed(plan, 0.3)
        assert np.max(shares(found)) <= 0.9 * (1.0 + 1e-6)
    place = np.asarray(plan.at(plan.leg_times[-1]))
    np.testing.assert_allclose(place, [0.35, 0.2], atol=1e-9)


def greatest(direction, bend, x: float, sign: float, margin: float) -> float:
    """Greatest `sign * u` at the speed sqrt(x) along a unit vector that turns by `bend` a metre, from
    the equations of each part by SciPy."""
    p = MACHINE
    m_x = p.m + 8.0 * p.J_passive / p.r**2
    m_y = p.M + p.m + 4.0 * p.J_passive / p.r**2
    c = 2.0 * 2.0**0.5
    loads = (p.m * p.g + c * (p.P1 + p.P2), (p.M + p.m) * p.g, c * p.P1, c * p.P2)
    friction = float(p.mu_k) * np.array([float(a) for a in loads]) * np.sign(LINES @ direction)
    mass = np.array([float(m_x), float(m_y)])
    # Unknown: u and both belt forces.
    balance = np.zeros((2, 3))
    balance[:, 0] = mass * direction
    balance[:, 1:] = -np.array([[1.0, 1.0], [1.0, -1.0]])
    right = -mass * bend * x - LINES.T @ friction
    belts = [margin * 2.0 * float(mu * P) for mu, P in ((p.mu_1s_b, p.P1), (p.mu_2s_b, p.P2))]
    bounds = [(None, None), *((-b, b) for b in belts)]
    found = scipy.optimize.linprog(np.array([-sign, 0.0, 0.0]), A_eq=balance, b_eq=right, bounds=bounds)
    assert found.success
    return float(found.x[0])


@pytest.mark.parametrize("senses", [(1.0, -1.0, 1.0, 1.0), (-1.0, 0.0, -1.0, -1.0)])
def test_limits_are_those_of_the_acceleration(senses):
    """r'u + r''x is one acceleration: what limits a plan and what it is then made of are the same."""
    rng = np.random.default_rng(2)
    first, second = rng.normal(size=(2, 2))
    u, x, hold = rng.normal(), rng.uniform(0.1, 3.0), 0.7
    here, signs = plain(MACHINE), np.array(senses)
    apart = forces(MACHINE, here, signs, first, second)
    at_once = forces(MACHINE, here, signs, first * u + second * x, np.zeros(2))
    for rows, whole in ((apart.belts, at_once.belts), (apart.volts, at_once.volts)):
        expected = whole @ np.array([1.0, 0.0, hold, 1.0])
        np.testing.assert_allclose(rows @ np.array([u, x, hold, 1.0]), expected, rtol=1e-12)


@pytest.mark.parametrize("axis", [0, 1])
def test_an_axis_turns_back_fast_enough_for_friction_at_rest_to_break(axis):
    """On a circle of radius R an axis turns back with the acceleration v^2 / R, which must be greater
    than what friction at rest beyond friction in motion could hold."""
    p, margin = MACHINE, 0.8
    # Both passive pulleys of a side turn at twice the speed along x; both motors along x and y.
    masses = (p.m + (8.0 * p.J_passive + 2.0 * p.J) / p.r**2,
              p.M + p.m + (4.0 * p.J_passive + 2.0 * p.J) / p.r**2)  # fmt: skip
    tension = 2.0 * 2.0**0.5 * (p.P1 + p.P2)
    load = (p.m * p.g + tension, (p.M + p.m) * p.g)[axis]
    grid = cut(arc(0.3, 2.0 * np.pi), 200)
    (node, *_) = [
        n for n in grid.parts[1:-1]
        if grid.senses[n - 1, axis] != grid.senses[n, axis]
    ]  # fmt: skip
    radius = 1.0 / np.linalg.norm(grid.second[node, 0])
    expected = float(load * (p.mu_s / margin - p.mu_k) * radius / masses[axis])
    assert _least(p, plain(p), grid, int(node), margin) == pytest.approx(expected, rel=1e-6)


def test_what_holds_a_line_is_less_than_its_friction_at_rest_or_in_motion():
    """A line that came in moving may have a little speed left, which friction in motion must end."""
    p, margin = MACHINE, 0.8
    grid = cut(cx.Path.rounded(ROUNDED, RADIUS), 40)
    first, last = 0, grid.lengths.size - 1
    assert grid.senses[first, 1] == 0.0
    assert grid.senses[last, 0] == 0.0
    at_rest = float(margin * p.mu_s * (p.M + p.m) * p.g)
    moving = float(margin * p.mu_k * (p.m * p.g + 2.0 * 2.0**0.5 * (p.P1 + p.P2)))
    assert _hold(plain(p), grid, first, margin) == pytest.approx((-at_rest, at_rest), rel=1e-12)
    assert _hold(plain(p), grid, last, margin) == pytest.approx((-moving, moving), rel=1e-12)


@pytest.mark.slow
def test_it_is_the_shortest_time():
    """Along an arc on which nothing turns back: the greatest acceleration from the begin, the greatest
    braking to the end, and the lower of both speeds, integrated by SciPy."""
    start, turn, radius = 0.5, -0.42, 0.15
    plan = cx.feedforward_along(MACHINE, arc(start, turn), volts=1e3)
    end = radius * abs(turn)

    def rate(sign):
        def right(s, x):
            angle = start - s / radius
            direction = np.array([np.sin(angle), -np.cos(angle)])
            bend = -np.array([np.cos(angle), np.sin(angle)]) / radius
            return [2.0 * greatest(direction, bend, float(x[0]), sign, 0.9)]

        return right

    options = {"rtol": 1e-6, "atol": 1e-9, "dense_output": True, "max_step": end / 50}
    up = scipy.integrate.solve_ivp(rate(1.0), (0.0, end), [0.0], **options)
    down = scipy.integrate.solve_ivp(rate(-1.0), (end, 0.0), [0.0], **options)
    s = end * np.sin(0.5 * np.pi * np.linspace(0.0, 1.0, 4001)) ** 2
    roots = np.sqrt(np.maximum(np.minimum(up.sol(s)[0], down.sol(s)[0]), 0.0))
    best = float(np.sum(2.0 * np.diff(s) / (roots[:-1] + roots[1:])))
    assert best * (1.0 - 1e-4) < float(plan.end) < best * 1.004


@pytest.mark.slow
def test_along_a_line_it_is_the_plan_from_point_to_point():
    ends = [[0.0, 0.0], [0.25, 0.1]]
    curved = cx.feedforward_along(MACHINE, cx.Path.through(ends), volts=24.0)
    straight = cx.feedforward(MACHINE, ends, volts=24.0)
    assert float(curved.end) == pytest.approx(float(straight.end), rel=3e-3)
    slow = cx.feedforward_along(MACHINE, cx.Path.through(ends), volts=5.0)
    times = jnp.linspace(0.0, float(slow.end), 4001)
    volts = np.stack(jax.vmap(slow.voltage)(times))
    assert 5.0 * 0.99 < np.max(np.abs(volts)) <= 5.0 * (1.0 + 1e-9)
    assert float(slow.end) == pytest.approx(
        float(cx.feedforward(MACHINE, ends, volts=5.0).end), rel=1e-2
    )


@pytest.mark.slow
def test_wrong_tensions_slip_unless_the_plan_knows_of_them():
    loose = cx.with_values(MACHINE, {"P1": 16.0, "P2": 24.0})
    assert not np.all(cx.check_rolling(corner(), loose).rolls)
    careful = corner(tension_error=0.2)
    assert float(corner().end) < float(careful.end) < 1.6 * float(corner().end)
    for one in (0.8, 1.2):
        for two in (0.8, 1.2):
            wrong = cx.with_values(MACHINE, {"P1": 20.0 * one, "P2": 30.0 * two})
            assert np.all(cx.check_rolling(careful, wrong).rolls), (one, two)


def test_paths_are_the_curves_they_say():
    path = cx.Path.rounded([*ROUNDED, (0.0, 0.2)], RADIUS)
    assert path.end == pytest.approx(0.25 + 0.1 + 0.25 + np.pi * RADIUS)
    assert len(path.jumps) == 4
    s = np.linspace(0.0, path.end, 401)
    place = np.array([[float(c) for c in path.function(a)] for a in s[::20]])
    half = place[:, 0] <= place[:, 0].max()
    assert half.all()
    np.testing.assert_allclose(place[0], (0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(place[-1], (0.0, 0.2), atol=1e-12)
    assert np.max(off_the_corner(place[place[:, 1] < 0.1])) < 1e-12
    circle = np.array([float(c) for c in arc(0.5, -1.0).function(0.15)])
    np.testing.assert_allclose(circle, 0.15 * np.array([np.cos(-0.5), np.sin(-0.5)]), atol=1e-15)
    spline = cx.Path.through([[0, 0], [0.3, 0.4], [0.3, 0.9]])
    assert spline.end == pytest.approx(1.0)
    np.testing.assert_allclose(spline.function(0.5), (0.3, 0.4), atol=1e-15)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        (lambda: arc(0.0, 1.0), "it leaves the direction of its begin, in which a line stands still"),
        (lambda: arc(0.1, 1.0), "these contacts do not start as they must: rail and pulleys along x"),
        (
            lambda: cx.Path(lambda s: (s, 0.4 * s + 0.0 * s + jnp.abs(s - 0.1)), 0.2, (0.1,)),
            "direction does not jump, as at s = 0.1",
        ),
        (
            lambda: cx.Path(lambda s: (s, 100.0 * (s - 0.1) ** 4), 0.2),
            "at s = 0.1 the curve is too straight for friction at rest to break",
        ),
    ],
)
def test_what_cannot_be_followed_is_refused(path, words):
    with pytest.raises(ValueError, match=rf"path = Path\(.*{words}"):
        cx.feedforward_along(MACHINE, path(), volts=24.0)


@pytest.mark.parametrize(
    ("corners", "radius"),
    [
        ([(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.0, 0.2)], 0.05),
        ([(0.0, 0.0), (0.0, 0.2), (0.3, 0.2), (0.3, 0.0)], 0.1),
        # The arc at a sharp corner takes more than half of its lines.
        ([(0.0, 0.0), (0.3, 0.01), (0.3, 0.2)], 0.055),
    ],
)
def test_all_corners_of_a_closed_path_are_round(corners, radius):
    path = cx.Path.rounded([*corners, corners[0]], radius)
    places = np.asarray(path.jets(np.linspace(0.0, path.end, 20001))[0])
    np.testing.assert_allclose(places[0], places[-1], atol=1e-15)
    first, last = (path.jets(np.array([at]))[1] for at in (0.0, path.end))
    np.testing.assert_allclose(first, last, atol=1e-12)  # in one direction
    # The inner angle a of a corner: 2 r / tan(a/2) is cut off, (pi - a) r goes round.
    points = np.array(corners)
    to, on = np.roll(points, 1, axis=0) - points, np.roll(points, -1, axis=0) - points
    sides = np.linalg.norm(on, axis=1)
    cosine = np.sum(to * on, axis=1) / (np.linalg.norm(to, axis=1) * sides)
    inner = np.arccos(cosine)
    length = sides.sum() + np.sum((np.pi - inner) * radius - 2.0 * radius / np.tan(0.5 * inner))
    assert path.end == pytest.approx(length, rel=1e-13)
    nearest = np.linalg.norm(places[:, None] - points, axis=2).min(axis=0)
    np.testing.assert_allclose(nearest, radius * (1.0 / np.sin(0.5 * inner) - 1.0), rtol=1e-3)


def test_wrong_paths_are_refused():
    with pytest.raises(ValueError, match=r"radius = 0.3: it must be so small that the corners fit"):
        cx.Path.rounded(ROUNDED, 0.3)
    with pytest.raises(ValueError, match=r"jumps = \(0.3, 0.2\): it must be increasing"):
        cx.Path(lambda s: (s, s), 1.0, (0.3, 0.2))
    with pytest.raises(ValueError, match="at none of which the path turns back"):
        cx.Path.rounded([[0, 0], [1, 0], [0, 0]], 0.1)
