"""The drive with the sign of its belt reaction as a number is the drive with the word."""

import jax
import numpy as np
import pytest

from experiments.block._drive import SIGNS, signed_drive
from stickslip.systems import BlockOnDrivenBelt, DCDrive, DrivenBlockState


@pytest.mark.parametrize("word", SIGNS)
def test_the_full_model_moves_as_with_the_word(word):
    by_word = BlockOnDrivenBelt.constructed(85.0, drive=DCDrive.constructed(belt_reaction=word))
    by_number = BlockOnDrivenBelt.constructed(85.0, drive=signed_drive(SIGNS[word]))
    slope = jax.jit(lambda system, y: system.vector_field(0.3, y, 0, None))
    for row in np.random.default_rng(3).normal(size=(20, 6)):
        state = DrivenBlockState(*row)
        np.testing.assert_allclose(slope(by_number, state), slope(by_word, state), rtol=1e-14, atol=0)


def test_the_two_signs_differ():
    slopes = [
        BlockOnDrivenBelt.constructed(85.0, drive=signed_drive(sign)).vector_field(
            0.0, DrivenBlockState(*np.full(6, 0.1)), 0, None
        )
        for sign in SIGNS.values()
    ]
    assert not np.allclose(np.asarray(slopes[0]), np.asarray(slopes[1]), rtol=1e-6)
