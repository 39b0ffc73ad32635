"""Arguments of public methods are checked, which adds nothing to a program."""

import doctest
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip import _argument_checks, _types
from stickslip.friction import AbstractDryFrictionLaw, Coulomb, LuGre
from stickslip.systems import BlockOnBelt, BlockState, CoulombOscillator, JointedBeam, Motion

OSCILLATOR = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)


@pytest.mark.parametrize("module", [_argument_checks, _types])
def test_examples_of_the_docstrings(module):
    found = doctest.testmod(module)
    assert found.failed == 0
    assert found.attempted > 0


class Linear(AbstractDryFrictionLaw):
    """A law of somebody's own, with names of its own."""

    set_valued: ClassVar[bool] = False
    is_odd: ClassVar[bool] = True
    is_dissipative: ClassVar[bool] = True

    def kinetic(self, speed, way):
        return 0.5 * jnp.asarray(speed)

    def static_coefficient(self, way=1):
        return jnp.zeros(())

    def set_valued_limit(self):
        return self


def test_a_law_of_ones_own_is_asked_by_the_names_it_gives():
    assert Linear().kinetic(2.0, 1) == 1.0
    with pytest.raises(ValueError, match=r"\Away = 2: it must be \+1 or -1, or 0 at rest\.\Z"):
        Linear().kinetic(2.0, 2)
    with pytest.raises(TypeError, match=r"\Aspeed = 'fast': it must be a real number"):
        Linear().kinetic(speed="fast", way=1)


def test_an_internal_state_has_as_many_numbers_as_the_law_has_states():
    with pytest.raises(ValueError, match=r"\Astate = \(\): it must be the internal state of LuGre"):
        LuGre(Coulomb(0.4), 1e4).state_rate(0.1, ())


def test_a_beam_takes_one_state_and_says_so():
    beam = JointedBeam.constructed(v=5e-4)
    one = beam.start()
    log = jax.tree.map(lambda a: jnp.stack([a, 2.0 * a]), one)
    with pytest.raises(ValueError, match=r"\Ay = .*one state, with one row of 5 .* use jax\.vmap"):
        beam.energy(log)
    np.testing.assert_array_equal(jax.vmap(beam.energy)(log)[0], beam.energy(one))


def test_rows_of_a_log_that_were_never_reached_give_nan():
    rows = Motion(x=jnp.array([0.1, jnp.nan]), v=jnp.array([0.2, jnp.nan]))
    energy = OSCILLATOR.energy(rows)
    assert np.isfinite(energy[0])
    assert np.isnan(energy[1])
    force = OSCILLATOR.friction(rows, jnp.array([0, -1]))
    assert force[0] == 0.5


def test_too_many_arguments_are_pythons_own_error():
    with pytest.raises(TypeError, match="positional arguments"):
        OSCILLATOR.friction(Motion(0.0, 0.0), 0, 1)


@pytest.mark.parametrize(
    ("method", "operands"),
    [
        (Coulomb(0.4, 0.3).force, (0.1, 10.0)),
        (OSCILLATOR.friction, (Motion(0.1, 0.2), 0)),
        (BlockOnBelt.constructed(k3=85.0).potential_energy, (0.0, BlockState(0.1, 0.0, 0.1, 0.0))),
    ],
)
def test_nothing_is_added_to_a_program(method, operands):
    plain = method.__func__.__wrapped__
    looked = jax.make_jaxpr(method)(*operands)
    assert str(looked) == str(jax.make_jaxpr(lambda *given: plain(method.__self__, *given))(*operands))
