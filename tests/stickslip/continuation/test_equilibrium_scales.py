"""Equilibria and orbits born from them in any units, exact hits, branch points, by closed forms."""

from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, continue_equilibrium, continue_orbit

FOLD = 2.0 / (3.0 * np.sqrt(3.0))


def cubic(y, a):
    """Folds at $a = \\pm2/(3\\sqrt3)$."""
    return a + y[0] - y[0] ** 3, -y[1]


def followed_by_others(y, a):
    """The same with components that it moves, from zero, and one that never moves."""
    return a + y[0] - y[0] ** 3, y[0] - 2.0 * y[1], y[1] * y[0] - y[2], -3.0 * y[3] + a * y[2], -y[4]


def plate(y, p):
    """Pull-in: a fold at $p = 4/27$."""
    return y[1], -0.1 * y[1] - y[0] + p / (1.0 - y[0]) ** 2


def van_der_pol(y, a):
    """A Hopf point at zero, orbits of amplitude $2\\sqrt a$."""
    return y[1], (a - y[0] ** 2) * y[1] - y[0]


def pitchfork(y, a):
    """Branches $x = 0$ and $a = x^4 - x^2$, folds of this one at $-1/4$."""
    return a * y[0] + y[0] ** 3 - y[0] ** 5, -y[1]


def transcritical(y, a):
    """Branches $x = 0$ and $x = a$."""
    return a * y[0] - y[0] ** 2, y[0] - y[1]


def lorenz(y, r):
    """A pitchfork at $r = 1$; a Hopf point at $470/19$."""
    return 10.0 * (y[1] - y[0]), y[0] * (r - y[2]) - y[1], y[0] * y[1] - 8.0 / 3.0 * y[2]


def rosenzweig_macarthur(y, k):
    """The predator lives from $k = 2/3$ on; a Hopf point at $7/3$."""
    eaten = y[0] * y[1] / (1.0 + y[0])
    return y[0] * (1.0 - y[0] / k) - eaten, 0.5 * eaten - 0.2 * y[1]


def fitzhugh_nagumo(y, current):
    r"""Hopf points where $1 - v^2 = 0.064$, $I = v^3/3 - v + (v + 0.7)/0.8$."""
    return y[0] - y[0] ** 3 / 3.0 - y[1] + current, 0.08 * (y[0] + 0.7 - 0.8 * y[1])


class State(NamedTuple):
    z: Any


class Scaled(ss.AbstractSmoothSystem):
    """A field in other units of state, time and parameter, with its components in another order."""

    p: Any
    units_of: Any
    time: Any
    unit: Any
    origin: Any
    order: Any
    rates: Any = eqx.field(static=True)

    def vector_field(self, t, y, mode, args):
        natural = (y.z / self.units_of)[jnp.argsort(self.order)]
        rates = jnp.stack(self.rates(natural, (self.p - self.origin) / self.unit))
        return State(rates[self.order] * self.units_of / self.time)


class Scale(NamedTuple):
    units_of: Any
    time: float = 1.0
    unit: float = 1.0
    origin: float = 0.0
    order: Any = None


def scaled(rates, y, a, scale):
    order = np.arange(len(y)) if scale.order is None else scale.order
    sizes = np.broadcast_to(scale.units_of, len(y)).astype(float)
    p = scale.origin + scale.unit * a
    made = Scaled(
        p, jnp.asarray(sizes), scale.time, scale.unit, scale.origin, jnp.asarray(order), rates
    )
    return made, State(jnp.asarray(np.asarray(y, float)[order] * sizes))


def followed(rates, y, a, bounds, scale, **options):
    """Special points, with the parameter in natural units, and the branch."""
    system, start = scaled(rates, y, a, scale)
    low, high = (scale.origin + scale.unit * bound for bound in bounds)
    follow = Follow(**{"step": 0.02, **options})
    branch = continue_equilibrium(system, start, "p", (low, high), follow=follow)
    return [(s.label, (s.value - scale.origin) / scale.unit) for s in branch.specials], branch


def special(found):
    return [(label, pytest.approx(value, abs=1e-9)) for label, value in found if label != "EP"]


ONE = Scale(1.0)
OTHER = (
    Scale(1e-9), Scale(1e-6, 1e-6), Scale(1e3, 3e7), Scale(1e-6, 1e-3, 1e-9, -2e-9),
    Scale(1e9, 1e6, 1e9, 3e9),
)  # fmt: skip
FHN = np.sqrt(1.0 - 0.064)
KNOWN = (
    (cubic, [0.0, 0.0], 0.0, (-1.0, 1.0), [("LP", -FOLD), ("LP", FOLD)]),
    (cubic, [0.01, 0.0], 0.0, (-1.0, 1.0), [("LP", -FOLD), ("LP", FOLD)]),
    (plate, [0.0, 0.0], 0.05, (0.02, 0.16), [("LP", 4.0 / 27.0)]),
    (van_der_pol, [0.0, 0.0], -0.1, (-0.5, 0.5), [("HB", 0.0)]),
    (pitchfork, [0.0, 0.0], -0.2, (-1.0, 1.0), [("BP", 0.0)]),
    (pitchfork, [1.12, 0.0], 0.3, (-1.0, 1.0), [("LP", -0.25), ("BP", 0.0), ("LP", -0.25)]),
    (transcritical, [0.0, 0.0], -0.2, (-1.0, 1.0), [("BP", 0.0)]),
    (transcritical, [0.31, 0.31], 0.31, (-1.0, 1.0), [("BP", 0.0)]),
    (lorenz, [0.0, 0.0, 0.0], 0.5, (0.0, 30.0), [("BP", 1.0)]),
    (
        lorenz, [4.9, 4.9, 9.0], 10.0, (0.0, 30.0),
        [("HB", 470.0 / 19.0), ("BP", 1.0), ("HB", 470.0 / 19.0)],
    ),
    (rosenzweig_macarthur, [0.6667, 1.1], 2.0, (0.3, 4.0), [("BP", 2.0 / 3.0), ("HB", 7.0 / 3.0)]),
    (
        fitzhugh_nagumo, [-1.2, -0.62], 0.0, (-0.5, 2.0),
        [("HB", s * (FHN**3 / 3.0 - FHN + FHN / 0.8) + 0.7 / 0.8) for s in (-1.0, 1.0)],
    ),
    (followed_by_others, [1.0, 0.5, 0.5, 0.0, 0.0], 0.0, (-0.6, 0.6), [("LP", FOLD), ("LP", -FOLD)]),
)  # fmt: skip


# Each compiles its own programs.
FEW = [*KNOWN[:2], *(pytest.param(case, marks=pytest.mark.slow) for case in KNOWN[2:])]


@pytest.mark.more
@pytest.mark.parametrize("case", FEW, ids=lambda case: case[0].__name__)
def test_special_points_in_any_units(case):
    rates, y, a, bounds, right = case
    found, branch = followed(rates, y, a, bounds, ONE)
    assert [pair for pair in found if pair[0] != "EP"] in (special(right), special(right[::-1]))
    for scale in OTHER[1::2]:
        other, again = followed(rates, y, a, bounds, scale)
        assert other == [(label, pytest.approx(value, abs=1e-9)) for label, value in found], scale
        assert 0.5 * len(branch) <= len(again) <= 2.0 * len(branch)


@pytest.mark.slow
@pytest.mark.parametrize("case", KNOWN, ids=lambda case: case[0].__name__)
def test_special_points_in_mixed_units(case):
    rates, y, a, bounds, _ = case
    found, branch = followed(rates, y, a, bounds, ONE)
    rng = np.random.default_rng(0)
    mixed = []
    for k in range(6):
        sizes = 10.0 ** rng.uniform(-12.0, 9.0, len(y))
        time, unit = 10.0 ** rng.uniform(-9.0, 9.0, 2)
        origin = k % 2 * unit * rng.uniform(-5.0, 5.0)
        mixed.append(Scale(sizes, time, unit, origin, rng.permutation(len(y))))
    for scale in (*OTHER, *mixed):
        other, again = followed(rates, y, a, bounds, scale)
        assert other == [(label, pytest.approx(value, abs=1e-9)) for label, value in found], scale
        assert 0.5 * len(branch) <= len(again) <= 2.0 * len(branch)


@pytest.mark.parametrize("step", [0.02, pytest.param(0.1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("a", [0.3, pytest.param(0.345, marks=pytest.mark.slow)])
def test_a_pitchfork_along_its_other_branch(a, step):
    """The parameter turns there, but beyond it another branch goes on: no fold."""
    x = np.sqrt((1.0 + np.sqrt(1.0 + 4.0 * a)) / 2.0)
    found, branch = followed(pitchfork, [x, 0.0], a, (-1.0, 1.0), ONE, step=step)
    assert [pair for pair in found if pair[0] != "EP"] == special(
        [("LP", -0.25), ("BP", 0.0), ("LP", -0.25)]
    )
    x = np.asarray(branch.orbits.y.z)[:, 0]
    np.testing.assert_allclose(branch.values, x**4 - x**2, atol=1e-12)
    (point,) = branch["BP"]
    assert abs(np.asarray(point.orbit.y.z)[0]) < 1e-9


def test_a_fold_beside_a_branch_point():
    """$a = x^2 - 2cx$: a fold at $x = c$, and the branch point at $x = 0$, both in one step."""
    for c in (1e-2, 1e-3):

        def rates(y, a, c=c):
            return (y[0] * (a - y[0] ** 2 + 2.0 * c * y[0]),)

        found, _ = followed(rates, [0.71], 0.5, (-1.0, 1.0), ONE)
        assert [pair for pair in found if pair[0] != "EP"] in (
            special([("BP", 0.0), ("LP", -(c**2))]), special([("LP", -(c**2)), ("BP", 0.0)])
        )  # fmt: skip


@pytest.mark.more
@pytest.mark.parametrize(
    ("rates", "label"), [(van_der_pol, "HB"), (pitchfork, "BP"), (transcritical, "BP")]
)
def test_what_a_step_meets_exactly_is_found_once(rates, label):
    for a in (-0.1, -0.2, -0.5, 0.1, 0.0):
        found, _ = followed(rates, [0.0, 0.0], a, (-0.5, 0.5), ONE)
        assert [pair for pair in found if pair[0] != "EP"] == special([(label, 0.0)]), a
    for options in (
        {"both": False}, {"max_points": 1}, {"max_points": 2}, {"both": False, "max_points": 1},
    ):  # fmt: skip
        found, _ = followed(rates, [0.0, 0.0], 0.0, (-0.5, 0.5), ONE, **options)
        assert [pair for pair in found if pair[0] != "EP"] == special([(label, 0.0)]), options
    # At a bound, and as the last point.
    found, _ = followed(rates, [0.0, 0.0], -0.2, (-0.5, 0.0), ONE)
    assert [pair for pair in found if pair[0] != "EP"] == special([(label, 0.0)])
    found, _ = followed(van_der_pol, [0.0, 0.0], -0.2, (-0.5, 0.5), ONE, both=False, max_points=11)
    assert [label for label, _ in found] == ["HB", "EP"]


@pytest.mark.more
def test_starts_at_and_near_a_fold():
    for a, y in ((0.0, 0.0), (-1e-8, 1e-4), (-1e-16, 1e-8)):
        found, _ = followed(lambda y, a: (a + y[0] ** 2,), [y], a, (-1.0, 1.0), ONE)
        assert [label for label, _ in found] == ["EP", "LP", "EP"]
        assert [value for _, value in found] == pytest.approx([-1.0, 0.0, -1.0], abs=1e-12)
    y = -np.sqrt(1.0 / 3.0)
    alone, _ = followed(lambda y, a: (a + y[0] - y[0] ** 3,), [y], FOLD, (-1.0, 1.0), ONE)
    assert sorted(alone)[2:] == special([("LP", -FOLD), ("LP", FOLD)])
    found, _ = followed(cubic, [y, 0.0], FOLD, (-1.0, 1.0), ONE)
    assert [pair for pair in found if pair[0] != "EP"] in (
        special([("LP", FOLD), ("LP", -FOLD)]), special([("LP", -FOLD), ("LP", FOLD)])
    )  # fmt: skip


@pytest.mark.more
def test_branches_without_special_points():
    flat, _ = followed(lambda y, a: (2.0 - y[0],), [2.0], 0.0, (-1.0, 1.0), ONE)
    parabola, _ = followed(lambda y, a: (a**2 - y[0],), [0.0], 0.0, (-1.0, 1.0), ONE)
    inflection, _ = followed(lambda y, a: (a - y[0] ** 3,), [-0.8], -0.5, (-1.0, 1.0), ONE)
    undamped, _ = followed(lambda y, a: (y[1], a - jnp.sin(y[0])), [0.0, 0.0], 0.0, (-0.9, 0.9), ONE)
    anywhere, _ = followed(lambda y, a: (y[1], -a * y[1]), [0.3, 0.0], 0.5, (-1.0, 1.0), ONE)
    for found in (flat, parabola, inflection, undamped, anywhere):
        assert [label for label, _ in found] == ["EP", "EP"]


@pytest.mark.more
def test_what_is_not_located_has_a_question_mark():
    """At $x = 1$ the field is 0/0, where $p = x(1 - x)^2$ turns."""
    for scale in (ONE, Scale([2e-6, 0.2], 1e-5)):
        found, branch = followed(plate, [0.0, 0.0], 0.0, (-0.01, 0.3), scale, both=False)
        assert [label for label, _ in found] == ["LP", "LP?", "EP"]
        assert found[0][1] == pytest.approx(4.0 / 27.0, abs=1e-9)
        (lost,) = branch["LP?"]
        assert lost.words.startswith("not located: between here and ")


def test_what_jumps_over_zero_has_a_question_mark():
    """An eigenvalue, or a pair, that is on the other side of the axis at once."""

    def single(y, a):
        return (jnp.where(a > 0.0, 1.0, -1.0) * y[0],)

    def pair(y, a):
        return y[1], -y[0] + jnp.where(a > 0.0, 0.1, -0.1) * y[1]

    for rates, start, label in ((single, [0.0], "BP?"), (pair, [0.0, 0.0], "HB?")):
        found, branch = followed(rates, start, -0.1234, (-0.5, 0.5), ONE)
        assert [label for label, _ in found] == ["EP", label, "EP"]
        assert branch[label][0].words.endswith("the function jumps there")


@pytest.mark.slow
@pytest.mark.parametrize("scale", [ONE, *OTHER[:3], Scale([1e-9, 1e4], 1e-3, 1e-6)])
def test_small_orbits_are_born_in_any_units(scale):
    system, start = scaled(van_der_pol, [0.0, 0.0], -0.1234, scale)
    bounds = (-0.5 * scale.unit, 0.5 * scale.unit)
    (hopf,) = continue_equilibrium(system, start, "p", bounds, follow=Follow(step=0.02))["HB"]
    branch = continue_orbit(system, hopf, "p", bounds, follow=Follow(step=0.05, max_points=4))
    a = branch.values / scale.unit
    length = np.broadcast_to(scale.units_of, 2)[0]
    assert 0.0 < a[0] < 0.01
    high = np.asarray(branch.orbits.highest.z)[:, 0] / length
    np.testing.assert_allclose(high[:2], 2.0 * np.sqrt(a[:2]), rtol=1e-3)
    assert float(branch.orbits.period[0]) == pytest.approx(2.0 * np.pi * scale.time, rel=1e-4)
