"""What the ends of branches are called, and points at values that are asked for."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import (
    Follow,
    OrbitGuess,
    continue_equilibrium,
    continue_orbit,
    load_branch,
    orbit_guess,
    periodic_orbit,
    save_branch,
)
from tests.stickslip.continuation._systems import Motion, Plane, whole_turn


class Meeting(ss.AbstractSmoothSystem):
    r"""$\dot r = r(1 - r^2)$, $\dot\theta = a - \cos\theta$: of the period $2\pi/\sqrt{a^2 - 1}$."""

    a: Any

    def vector_field(self, t, y, mode, args):
        r = jnp.sqrt(y.x**2 + y.y**2)
        grow, turn = 1.0 - r**2, self.a - y.x / r
        return Plane(grow * y.x - turn * y.y, grow * y.y + turn * y.x)


@pytest.mark.more
def test_equilibria_on_the_orbit_and_values_asked_for(tmp_path):
    """The first value is that of the start, the others lie on either side of it."""
    system, wanted = Meeting(2.0), (2.0, 1.2, 2.1)
    guess = OrbitGuess(Plane(1.0, 0.0), 2 * np.pi / 3**0.5)
    branch = continue_orbit(
        system, guess, "a", (0.5, 2.5), follow=Follow(step=0.1, max_points=25, values=wanted)
    )
    assert [point.value for point in branch["UZ"]] == [1.2, 2.0, 2.1]
    for point in branch["UZ"]:
        period = 2 * np.pi / np.sqrt(point.value**2 - 1)
        assert float(point.orbit.period) == pytest.approx(period, rel=1e-10)
        assert float(point.system.a) == point.value
    end = branch["EP"][0]
    assert end.words.startswith("homoclinic to a saddle-node, SNIC: the period grows without bound")
    assert float(end.words.rpartition(" ")[2]) == pytest.approx(1.0, abs=(end.value - 1.0) ** 2)
    assert float(system.a) == 2.0
    saved = load_branch(save_branch(branch, tmp_path / "branch.nc"), system, Plane(0.0, 0.0))
    assert [float(s.system.a) for s in saved["UZ"]] == [1.2, 2.0, 2.1]
    with pytest.raises(ValueError, match=r"values\[1\] = 3.0: it must be within the bounds"):
        continue_orbit(system, guess, "a", (0.5, 2.5), follow=Follow(values=(1.0, 3.0)))


class Saddle(ss.AbstractSmoothSystem):
    r"""$\ddot x = x - x^2 + \mu\dot x + x\dot x$: Hopf point at -1, homoclinic orbit at -0.8645."""

    mu: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, y.x - y.x**2 + self.mu * y.v + y.x * y.v)


@pytest.mark.slow
def test_from_a_hopf_point_to_a_saddle():
    """The constant is that of normal-form tables, to the digits printed; the other end is exact."""
    system = Saddle(-0.95)
    guess = orbit_guess(system, Motion(1.2, 0.1), transient=200.0, max_period=40.0)
    branch = continue_orbit(system, guess, "mu", (-1.2, -0.7), follow=Follow(step=0.05))
    (birth,) = branch["HB"]
    assert birth.value == pytest.approx(-1.0, abs=1e-12)
    assert float(birth.orbit.period) == pytest.approx(2 * np.pi, rel=1e-12)
    assert float(birth.orbit.y0.x) == pytest.approx(1.0, abs=1e-12)
    assert float(birth.system.mu) == birth.value
    first, last = branch["EP"]
    assert first.words.startswith("at_rest")
    assert last.words.startswith("homoclinic to a saddle: the period grows without bound")
    assert float(last.words.rpartition(" ")[2]) == pytest.approx(-0.8645, abs=1e-4)


def test_equilibria_at_values_asked_for():
    """$x = a$, $v = 0$; the start, a bound and values between states."""
    wanted = (0.0, 0.123, -0.2, 0.3)
    branch = continue_equilibrium(
        Driven(0.0), Motion(0.0, 0.0), "a", (-0.2, 0.3), follow=Follow(step=0.02, values=wanted)
    )
    assert [point.value for point in branch["UZ"]] == [-0.2, 0.0, 0.123, 0.3]
    for point in branch["UZ"]:
        assert float(point.orbit.y.x) == pytest.approx(point.value, abs=1e-14)
        assert float(point.system.a) == point.value


class Driven(ss.AbstractSmoothSystem):
    r"""$\ddot x + 0.1\dot x + x - a = 0$."""

    a: Any

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, self.a - y.x - 0.1 * y.v)


@pytest.mark.more
@pytest.mark.parametrize("waited", [0.0, 30.0])
def test_a_motion_that_settles_is_at_rest(waited):
    """Whether or not the guess begins where its plane contains the equilibrium."""
    guess = orbit_guess(Driven(0.5), Motion(1.0, 0.0), transient=waited, max_period=10.0)
    assert str(periodic_orbit(Driven(0.5), guess).result) == "at_rest"


class Walled(ss.AbstractHybridSystem):
    r"""$\ddot x + 0.1\dot x + 4x = 2\cos t - 0.1\,\mathrm{sgn}\,\dot x$, a wall: $v^+ = -0.5 v^-$."""

    wall: Any
    mode_names: ClassVar = ("backward", "forward")
    guard_names: ClassVar = ("turn", "touch")

    def time_scale(self, args):
        return 1.0

    def vector_field(self, t, y, mode, args):
        sign = 2.0 * jnp.asarray(mode, jnp.float64) - 1.0
        return Motion(y.v, 2.0 * jnp.cos(t) - 0.1 * sign - 0.1 * y.v - 4.0 * y.x)

    def guards(self, t, y, mode, args):
        return jnp.where(mode == 1, y.v, -y.v), jnp.where(mode == 1, self.wall - y.x, 1.0)

    def transition(self, t, y, mode, guard, args):
        return Motion(y.x, jnp.where(guard == 1, -0.5 * y.v, 0.0 * y.v)), 1 - mode

    def initial_mode(self, t, y, args):
        return jnp.where(y.v > 0, 1, 0).astype(jnp.int32)


@pytest.mark.slow
def test_the_touch_of_a_wall_in_place_of_a_turn_is_grazing():
    """With as many events as before: an impact turns the motion round that friction let slip."""
    guess = OrbitGuess(Motion(0.0, 0.667), 2 * np.pi, 1, 1.5 * np.pi)
    orbit = periodic_orbit(Walled(5.0), guess, forced=True)
    largest = float(orbit.highest.x)
    branch = continue_orbit(
        Walled(largest + 0.05),
        orbit,
        "wall",
        (largest - 0.1, largest + 0.1),
        forcing_period=whole_turn,
        follow=Follow(step=0.2, max_points=8),
    )
    assert not branch["SQ"]
    (graze,) = branch["GR"]
    assert graze.words == "grazing, 2 events, 2 beyond"
    assert graze.value == pytest.approx(largest, abs=1e-9)
