"""Equilibria over a parameter against closed forms, and the orbits born at their Hopf points."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.continuation import Follow, continue_equilibrium, continue_orbit
from stickslip.systems import Motion as Place
from tests.stickslip.continuation._systems import Cycle, ForcedBlock, Motion, WeakeningBlock


class Normal(ss.AbstractSmoothSystem):
    r"""$\dot x = a + x - x^3$: folds at $a = \pm2/(3\sqrt3)$; $\dot y = -y$. In units of `size`."""

    a: Any
    size: float = 1.0
    units: ClassVar = {"x": "1", "y": "1"}

    def vector_field(self, t, y, mode, args):
        x = y.x / self.size
        return Cycle(self.size * (self.a + x - x**3), -y.y)


@pytest.mark.parametrize("size", [1.0, 1e-9, 1e6])
def test_folds_in_closed_form(size):
    start = Cycle(size * 1.3, 0.0)
    branch = continue_equilibrium(Normal(0.6, size), start, "a", (-0.8, 0.8), follow=Follow(step=0.05))
    fold = 2.0 / (3.0 * np.sqrt(3.0))
    assert sorted(s.value for s in branch["LP"]) == pytest.approx([-fold, fold], abs=1e-12)
    a, x = branch.values, np.asarray(branch.orbits.y.x) / size
    np.testing.assert_allclose(a + x - x**3, 0.0, atol=1e-13)
    slope = 1.0 - 3.0 * x**2
    assert (branch.orbits.stable == (slope < 0)).all()
    np.testing.assert_allclose(np.sort(branch.orbits.eigenvalues.real)[:, 0], np.minimum(slope, -1.0))
    assert (np.diff(x) > 0).all() or (np.diff(x) < 0).all()  # in order along it
    assert [s.words for s in branch["EP"]] == ["bounds", "bounds"]
    assert branch.values[[0, -1]] == pytest.approx([s.value for s in branch["EP"]], abs=1e-12)
    assert not branch["HB"]


def test_hopf_point_in_closed_form():
    """Leine's block with a dashpot: $v_H = (\\sqrt{3/c} - 1)/3$, frequency 1 there."""
    c = 0.5
    system = WeakeningBlock(belt_speed=0.6, damping=c)
    branch = continue_equilibrium(
        system,
        Motion(1.0 / (1.0 + 3.0 * 0.6), 0.0),
        "belt_speed",
        (0.3, 0.9),
        mode0="slip",
        follow=Follow(step=0.02),
    )
    (hopf,) = branch["HB"]
    assert hopf.value == pytest.approx((np.sqrt(3.0 / c) - 1.0) / 3.0, abs=1e-12)
    assert hopf.orbit.period == pytest.approx(2.0 * np.pi, abs=1e-12)
    assert hopf.orbit.mode == 1
    assert (branch.orbits.stable == (branch.values > hopf.value)).all()
    data = branch.to_dataset()
    assert data["label"].values.tolist() == [s.label for s in branch.specials]
    assert data["x"].attrs["units"] == "m"
    # Two real eigenvalues of opposite signs are no Hopf point, though their sum passes zero.


class Saddle(ss.AbstractSmoothSystem):
    r"""$\dot x = x$, $\dot y = -(1 + a) y$: the sum of the eigenvalues passes zero at $a = 0$."""

    a: Any
    units: ClassVar = {"x": "1", "y": "1"}

    def vector_field(self, t, y, mode, args):
        return Cycle(y.x, -(1.0 + self.a) * (y.y - 1.0))


def test_a_saddle_is_no_hopf_point():
    branch = continue_equilibrium(
        Saddle(0.3), Cycle(0.0, 1.0), "a", (-0.5, 0.5), follow=Follow(step=0.02)
    )
    assert [s.label for s in branch.specials] == ["EP", "EP"]


@pytest.mark.slow
def test_orbits_are_born_at_the_hopf_point():
    """The unstable slip cycle of the block: from the Hopf point to the discontinuous fold."""
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    rest = continue_equilibrium(
        system, Motion(0.35, 0.0), "belt_speed", (0.3, 0.9), mode0="slip", follow=Follow(step=0.02)
    )
    (hopf,) = rest["HB"]
    branch = continue_orbit(
        system, hopf, "belt_speed", (0.4, 0.8), follow=Follow(step=0.2, max_points=80)
    )
    (fold,) = branch["GR"]
    assert fold.value == pytest.approx(0.6721494669, abs=1e-8)
    assert abs(branch.values[0] - hopf.value) < 1e-4
    assert float(branch.orbits.period[0]) == pytest.approx(2.0 * np.pi, abs=1e-3)
    slip = np.asarray(branch.orbits.events.count) == 0
    assert slip.sum() > 5
    assert (np.abs(np.asarray(branch.orbits.multipliers)[slip, 0]) > 1.0).all()


def test_wrong_arguments():
    system = WeakeningBlock(belt_speed=0.6, damping=0.5)
    with pytest.raises(ValueError, match="depends on the time"):
        continue_equilibrium(
            ForcedBlock(0.1, 1.75), Motion(0.4, 0.0), "frequency", (1.0, 2.0), follow=Follow(step=0.02)
        )
    with pytest.raises(ValueError, match=r"y0 = .*: it must be near an equilibrium"):
        continue_equilibrium(
            Normal(jnp.asarray(jnp.nan)), Cycle(1.0, 0.0), "size", (0.5, 2.0), follow=Follow(step=0.02)
        )
    with pytest.raises(ValueError, match="around the value of belt_speed"):
        continue_equilibrium(
            system, Motion(0.35, 0.0), "belt_speed", (0.7, 0.9), mode0="slip", follow=Follow(step=0.02)
        )
    fold = continue_equilibrium(
        Normal(0.3), Cycle(1.3, 0.0), "a", (-0.8, 0.8), follow=Follow(step=0.02)
    )["LP"][0]
    with pytest.raises(ValueError, match="it must be a Hopf point, HB"):
        continue_orbit(Normal(0.3), fold, "a", (-0.8, 0.8))
    with pytest.raises(TypeError, match="an OrbitGuess or a BranchPoint"):
        continue_orbit(Normal(0.3), Place(0.0, 0.0), "a", (-0.8, 0.8))
