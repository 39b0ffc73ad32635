"""Friction that drives: an error where the numbers are known, a result code of the lane where not."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import pytest

import stickslip as ss
from stickslip.friction import AbstractDryFrictionLaw, Asymmetric, Coulomb
from stickslip.mechanism import AbstractMechanism, Contact


class Parabola(AbstractDryFrictionLaw):
    """Falls with the square of the speed, below zero where it is fast."""

    mu: Any
    fall: Any

    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    def kinetic(self, v, sense):
        return sense * (self.mu - self.fall * jnp.asarray(v) ** 2)

    def static_coefficient(self, sense=1):
        return jnp.asarray(self.mu, jnp.float64)

    def set_valued_limit(self):
        return self


class Driving(Parabola):
    """The same, and says so."""

    is_dissipative: ClassVar[bool] = False


class Block(AbstractMechanism):
    """A block on a spring, under a load."""

    law: Any
    load: float = 1.0

    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"ground": {"x": 1}}

    def mass_matrix(self, q):
        return {"x": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x}

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law, self.load)}


class Lifted(Block):
    """The same, off the ground where it is not loaded."""

    opening: ClassVar = ("ground",)


def broken(name):
    """A law of the library with a parameter that its constructor never saw, as a fit may set one."""
    return eqx.tree_at(lambda law: getattr(law, name), Coulomb(0.3, 0.2), jnp.array(-0.1))


def run(law, form=lambda block: block, **start):
    block = Block(law)
    return ss.simulate(form(block), 0.0, 5.0, block.state(**start))


@pytest.mark.parametrize("form", [lambda block: block, lambda block: block.regularised(1e-2)])
@pytest.mark.parametrize(
    ("law", "start", "named"),
    [
        (Parabola(0.3, 0.1), {"v_x": 2.0}, r"at the speed of the start of contact 'ground' = -0\.1"),
        (Parabola(0.3, 0.1), {"v_x": -2.0}, r"at the speed of the start of contact 'ground' = -0\.1"),
        (Parabola(-0.3, 0.0), {"x": 1.0}, r"static coefficient forward of contact 'ground' = -0\.3"),
        (broken("mu_k"), {"x": 1.0}, r"kinetic coefficient forward from rest of .* = -0\.1"),
        (
            Asymmetric(Coulomb(0.3), Parabola(-0.1, 0.0)),
            {"x": 1.0},
            r"static coefficient backward of contact 'ground' = -0\.1",
        ),
    ],
)
def test_friction_that_drives_at_the_start_is_an_error_by_name(law, start, named, form, compiled):
    compiled.clear()
    with pytest.raises(ValueError, match=named):
        run(law, form, **start)
    assert not compiled


@pytest.mark.more
@pytest.mark.parametrize("form", [lambda block: block, lambda block: block.regularised(0.1)])
def test_of_lanes_those_that_drive_have_a_result_code(form):
    def outcome(mu, v):
        law = Parabola(mu, 0.1)
        return ss.simulate(
            form(Block(law)), 0.0, 1.0, Block(law).state(v_x=v), throw=False
        ).result  # fmt: skip

    mu, v = jnp.array([0.3, 0.3, -0.3, 0.3]), jnp.array([1.0, 2.0, 0.0, -2.0])
    found = jax.vmap(outcome)(mu, v)
    none = found == ss.RESULTS.no_admissible_mode
    assert none.tolist() == [False, True, True, True]


@pytest.mark.more
def test_what_is_closed_over_by_lanes_has_a_result_code_too():
    def outcome(mu):
        class Own(Block):
            def contacts(self, t, q, v, args):
                return {"ground": Contact(Parabola(mu, 0.1))}

        block = Own(None)
        return ss.simulate(block, 0.0, 1.0, block.state(v_x=1.0), throw=False).result

    found = jax.jit(jax.vmap(outcome))(jnp.array([0.3, -0.3]))
    assert (found == ss.RESULTS.no_admissible_mode).tolist() == [False, True]


@pytest.mark.more
def test_a_law_of_more_than_arithmetic_is_asked_too():
    class Table(Parabola):
        def kinetic(self, v, sense):
            known = jnp.array([0.3, 0.3, -0.2])
            return sense * jnp.interp(sense * jnp.asarray(v), jnp.array([0.0, 1.0, 2.0]), known)

    block = Block(Table(0.3, 0.0))
    fast = block.state(v_x=2.0)
    with pytest.raises(ValueError, match=r"speed of the start of contact 'ground' = -0\.2"):
        ss.simulate(block, 0.0, 1.0, fast)

    def inside(x):  # of a jitted function, where nothing of it is known
        return ss.simulate(block, 0.0, 1.0 + x, fast, throw=False).result

    assert jax.jit(inside)(0.0) == ss.RESULTS.no_admissible_mode


@pytest.mark.more
def test_what_may_drive_runs():
    # A law that says so; a contact without a load; slow enough for the law to resist.
    assert run(Driving(0.3, 0.1), v_x=2.0).successful
    assert run(Parabola(0.3, 0.1), v_x=1.5).successful
    lifted = Lifted(Parabola(0.3, 0.1), -1.0)
    assert ss.simulate(lifted, 0.0, 1.0, lifted.state(v_x=2.0)).successful
