"""One contract for all laws, and laws with planted faults that must not pass it."""

import doctest
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip.friction
from stickslip.friction import (
    AbstractDryFrictionLaw,
    AbstractFrictionLaw,
    Coulomb,
    ViscousFriction,
    check_friction_law,
)
from tests.stickslip.friction._laws import LAWS

every_law = pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
SPEEDS = np.geomspace(1e-9, 1e2, 45)
V = jnp.concatenate([-SPEEDS[::-1], SPEEDS])


@pytest.mark.more
@every_law
def test_law_keeps_its_claims(law):
    check_friction_law(law)


@every_law
def test_pytree_round_trip(law):
    leaves, structure = jax.tree.flatten(law)
    assert all(leaf.dtype == jnp.float64 for leaf in leaves)
    again = jax.tree.unflatten(structure, leaves)
    assert eqx.tree_equal(law, again)
    # Transformations put placeholders into the leaves, which no constructor may look at.
    placeholders = jax.tree.map(lambda _: object(), law)
    assert jax.tree.structure(placeholders) == structure


@pytest.mark.more
@every_law
def test_one_trace_serves_all_parameters(law):
    traces = 0

    @jax.jit
    def force(law, v, normal_force):
        nonlocal traces
        traces += 1
        return law.force(v, normal_force)

    for factor in (1.0, 1.5, 2.0):
        scaled = jax.tree.map(lambda leaf, factor=factor: leaf * factor, law)
        np.testing.assert_allclose(force(scaled, V, 2.0), scaled.force(V, 2.0), rtol=1e-13, atol=1e-15)
    assert traces == 1


@pytest.mark.more
@every_law
def test_batched_parameters_equal_a_loop(law):
    factors = jnp.array([1.0, 1.1, 1.3])
    batch = jax.tree.map(lambda leaf: leaf * factors, law)

    @eqx.filter_jit
    def both(law, v):
        return law.coefficient(v), law.coefficient_from_state(v, law.steady_state(0.5 * v))

    batched = jax.jit(jax.vmap(both, in_axes=(0, None)))(batch, V)
    looped = [both(jax.tree.map(lambda x, i=i: x[i], batch), V) for i in range(3)]
    for got, expected in zip(batched, map(jnp.stack, zip(*looped, strict=True)), strict=True):
        np.testing.assert_allclose(got, expected, rtol=1e-13, atol=1e-15)


@pytest.mark.more
@every_law
def test_parameters_per_lane_need_no_vmap(law):
    factors = jnp.linspace(1.0, 1.3, V.size)
    batch = jax.tree.map(lambda leaf: leaf * factors, law)

    def coefficient(law, v):
        return law.coefficient(v)

    np.testing.assert_allclose(
        jax.jit(coefficient)(batch, V),
        jax.jit(jax.vmap(coefficient))(batch, V),
        rtol=1e-13,
        atol=1e-15,
    )


@every_law
def test_forces_oppose_coefficient_and_drag(law):
    normal_force = 7.0

    # Each operation outside of `jit` would be a program of its own.
    @eqx.filter_jit
    def forces(law):
        expected = -(law.coefficient(V) * normal_force + law.drag(V))
        slip = law.slip_force(V, normal_force, jnp.sign(V))
        state = law.force_from_state(V, normal_force, law.steady_state(V))
        return expected, law.force(V, normal_force), slip, state

    expected, force, slip, state = forces(law)
    np.testing.assert_array_equal(force, expected)
    np.testing.assert_allclose(slip, expected, rtol=1e-14, atol=0)
    np.testing.assert_allclose(state, expected, rtol=1e-12, atol=0)


@every_law
def test_branch_of_a_sense_is_bounded_beyond_rest(law):
    """Trial steps land anywhere beyond zero velocity; only viscous terms may grow there."""

    @eqx.filter_jit
    def branches(law):
        return [(law.kinetic(-s * SPEEDS, s), law.static_coefficient(s)) for s in (1, -1)]

    for branch, at_rest in branches(law):
        assert np.isfinite(branch).all()
        assert (np.abs(branch) <= 3.0 * (np.asarray(at_rest) + 0.3) + 0.3 * SPEEDS).all()


def primitives(jaxpr):
    for equation in jaxpr.eqns:
        yield equation.primitive.name
        for inner in jax.tree.leaves(equation.params, is_leaf=lambda x: hasattr(x, "eqns")):
            if hasattr(inner, "eqns"):
                yield from primitives(inner)


@pytest.mark.more
@every_law
def test_no_calls_for_the_fused_loop(law):
    """A jitted function inside the law would become a call inside the compiled time loop."""
    state = law.steady_state(V)

    def everything(v):
        return (
            law.coefficient(v),
            law.kinetic(v, 1),
            law.drag(v),
            law.state_rate(v, state),
            law.coefficient_from_state(v, state),
        )

    assert "jit" in set(primitives(jax.make_jaxpr(jax.jit(everything))(V)))
    for function in (everything, lambda v: jax.jvp(everything, (v,), (v,))):
        assert not {"jit", "pjit", "closed_call"} & set(primitives(jax.make_jaxpr(function)(V)))


def test_examples_of_the_package():
    result = doctest.testmod(stickslip.friction)
    assert result.attempted > 20
    assert result.failed == 0


class _Faulty(AbstractDryFrictionLaw):
    """Coulomb's law unless a subclass spoils it."""

    mu: float = 0.3
    set_valued: ClassVar[bool] = True
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    def kinetic(self, v, sense):
        return self.mu * sense + 0.0 * jnp.asarray(v)

    def static_coefficient(self, sense=1):
        return jnp.asarray(self.mu)

    def set_valued_limit(self) -> AbstractFrictionLaw:
        return self


class WrongSign(_Faulty):
    def kinetic(self, v, sense):
        return -self.mu * sense + 0.0 * jnp.asarray(v)


class NotOdd(_Faulty):
    def kinetic(self, v, sense):
        return self.mu * sense * jnp.where(v > 0, 1.1, 1.0)


class AbsoluteSpeed(_Faulty):
    """The branch written with |v|: right on its own side, with a kink where events are located."""

    def kinetic(self, v, sense):
        return self.mu * sense / (1.0 + 2.0 * jnp.abs(v))


class SignInside(_Faulty):
    """The branch ignores its sense and asks the velocity."""

    def kinetic(self, v, sense):
        return self.mu * jnp.sign(v) * jnp.abs(sense)


class StaticBelowKinetic(_Faulty):
    def static_coefficient(self, sense=1):
        return jnp.asarray(0.5 * self.mu)


class JumpsThoughSmooth(_Faulty):
    set_valued: ClassVar[bool] = False


class AsPrinted(_Faulty):
    """Eq. (12) with cosh, whose derivative is infinity over infinity at high speed."""

    set_valued: ClassVar[bool] = False

    def kinetic(self, v, sense):
        x = 190.0 * jnp.asarray(v)
        return self.mu * (1.0 + 0.9 / jnp.cosh(x)) * jnp.tanh(x)


class SinglePrecision(_Faulty):
    def kinetic(self, v, sense):
        return super().kinetic(v, sense).astype(jnp.float32)


class LimitOfAnotherLaw(_Faulty):
    def set_valued_limit(self) -> AbstractFrictionLaw:
        return Coulomb(2.0 * self.mu)


class WrongShape(_Faulty):
    def kinetic(self, v, sense):
        return super().kinetic(v, sense).sum()


class DragTheWrongWay(_Faulty):
    def drag(self, v):
        return -0.1 * jnp.asarray(v)


@pytest.mark.more
@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (WrongSign, "claims to be dissipative"),
        (NotOdd, "claims to be odd"),
        (AbsoluteSpeed, r"differentiable through rest in sense \+1.*in sense -1"),
        (SignInside, "continuous through rest"),
        (StaticBelowKinetic, r"static_coefficient\(\+1\) must not be below"),
        (JumpsThoughSmooth, "must not jump at rest"),
        (AsPrinted, "derivatives must be finite"),
        (SinglePrecision, "must keep float64"),
        (LimitOfAnotherLaw, r"set_valued_limit must keep static_coefficient\(\+1\)"),
        (WrongShape, "must have the shape of v"),
        (DragTheWrongWay, "claims to be dissipative"),
    ],
)
def test_planted_faults_are_found(fault, message):
    with pytest.raises(ValueError, match=f"^{fault.__name__}: .*{message}"):
        check_friction_law(fault())


def test_law_without_a_fault_passes():
    check_friction_law(_Faulty())
    check_friction_law(_Faulty(), np.array([1e-4, 0.3]))


def test_claims_of_the_wrappers_follow_what_they_wrap():
    one_way = LAWS["asymmetric"]
    assert not one_way.is_odd
    assert not LAWS["arctan"].is_odd
    assert not LAWS["lugre, breakaway"].is_odd
    assert one_way.set_valued
    assert not LAWS["arctan"].set_valued
    assert LAWS["sum"].set_valued
    assert not LAWS["sum with bristles"].set_valued
    assert LAWS["sum with bristles"].num_states == 2
    assert stickslip.friction.Sum(ViscousFriction(0.1), one_way).is_odd is False
