"""Wrong arguments of structures and sliders, and modes by name."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.mechanism import AbstractMechanism
from stickslip.structure import (
    HarmonicForce,
    Jenkins,
    LinearStructure,
    WithSliders,
    craig_bampton,
    iwan,
    modal_damping,
)

EYE = np.eye(2)
PAIR = LinearStructure(EYE, EYE, EYE)


class Swing(AbstractMechanism):
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": -q.x}


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: Jenkins([0.0, 0.0], 1.0, 0.1), "direction"),
        (lambda: Jenkins({"x": [1.0, 2.0]}, 1.0, 0.1), r"direction\['x'\]"),
        (lambda: Jenkins([1.0], 0.0, 0.1), "stiffness"),
        (lambda: Jenkins([1.0], 1.0, -0.1), "bound"),
        (lambda: Jenkins([1.0], [1.0, 2.0], [0.1, 0.2, 0.3]), "bound"),
        (lambda: Jenkins([1.0], [1.0, 2.0], lambda t, q, args: 0.1), "stiffness"),
        (lambda: Jenkins([1.0], 1.0, lambda t: 0.1), "bound"),
        (lambda: iwan([1.0], 1.0, 1.0, -1.0, 0.1), "exponent"),
        (lambda: iwan([1.0], 1.0, 1.0, -0.5, 0.1, 1), "sliders"),
        (lambda: HarmonicForce(1.0, 1.0), "amplitude"),
        (lambda: HarmonicForce([1.0], 0.0), "frequency"),
        (lambda: LinearStructure([[1.0, 0.0]], EYE, EYE), "mass"),
        (lambda: LinearStructure(-EYE, EYE, EYE), "mass"),
        (lambda: LinearStructure(EYE, np.eye(3), EYE), "damping"),
        (lambda: LinearStructure(EYE, EYE, [[1.0, 1.0], [0.0, 1.0]]), "stiffness"),
        (lambda: LinearStructure(EYE, EYE, EYE, lambda t: 0.0), "force"),
        (lambda: PAIR.state([1.0]), "q"),
        (lambda: WithSliders(PAIR, {}), "sliders"),
        (lambda: WithSliders(PAIR, {"a": 1.0}), r"sliders\['a'\]"),
        (lambda: WithSliders(PAIR, {"a / b": Jenkins([1.0, 0.0], 1.0, 0.1)}), "sliders"),
        (lambda: WithSliders(PAIR, {"a": Jenkins([1.0], 1.0, 0.1)}), r"direction of sliders\['a'\]"),
        (lambda: WithSliders(PAIR, {"a": Jenkins({"x": 1.0}, 1.0, 0.1)}), "a row of 2"),
        (lambda: WithSliders(Swing(), {"a": Jenkins({"z": 1.0}, 1.0, 0.1)}), "'x', 'y'"),
        (lambda: WithSliders(Swing(), {"a": Jenkins([1.0], 1.0, 0.1)}), "2 numbers"),
        (
            lambda: WithSliders(
                PAIR, {f"{i}": Jenkins([1.0, 0.0], 1.0, 0.1) for i in range(40)}
            ),
            "40 elements",
        ),
        (lambda: craig_bampton(EYE, EYE, [0, 0], 1), "boundary"),
        (lambda: craig_bampton(EYE, EYE, [2], 1), "boundary"),
        (lambda: craig_bampton(EYE, EYE, [0], 2), "modes"),
        (lambda: craig_bampton(EYE, np.zeros((2, 2)), [0], 1), "stiffness"),
        (lambda: modal_damping(EYE, EYE, [0.1, 0.1, 0.1]), "ratios"),
        (lambda: modal_damping(-EYE, EYE, 0.1), "mass"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_named(call, words):
    with pytest.raises((ValueError, TypeError), match=words):
        call()


@pytest.mark.parametrize(
    ("q", "z", "words"),
    [
        ([1.0, 0.0], [0.0], r"y0\.z"),
        ([0.0, 0.0], [0.0, 0.0], "y0.z|z = "),
    ],
)
def test_a_start_beyond_the_limits_is_named(q, z, words):
    system = WithSliders(PAIR, {"a": Jenkins([1.0, 0.0], 1.0, 0.1)})
    with pytest.raises(ValueError, match=words):
        ss.simulate(system, 0.0, 1.0, system.start(PAIR.state(q), z))


def test_what_a_function_returns_is_looked_at_before_anything_runs():
    for structure, bound, words in (
        (LinearStructure(EYE, EYE, EYE, lambda t, q, v, args: jnp.zeros(3)), 0.1, "force"),
        (PAIR, lambda t, q, args: jnp.zeros(2), "bound"),
    ):
        system = WithSliders(structure, {"a": Jenkins([1.0, 0.0], 1.0, bound)})
        with pytest.raises(ValueError, match=words):
            ss.simulate(system, 0.0, 1.0, ss.structure.Slid(PAIR.state(), jnp.zeros(1)))


def test_every_mode_has_a_name_of_its_own():
    elements = {
        "one": Jenkins([1.0, 0.0], 1.0, 0.1),
        "row": Jenkins([1.0, -1.0], [1.0, 1.0], [0.1, 0.2]),
        "loose": Jenkins([0.0, 1.0], 1.0, lambda t, q, args: q[0]),
    }
    names = WithSliders(PAIR, elements).mode_names
    assert len(names) == 3 * 5 * 4
    assert [names.index(name) for name in names] == list(range(60))
    assert names[0] == "slip backward / 2 of 2 slip backward / slip backward"
    assert "open" in names[59]
    with pytest.raises(ValueError, match="not the name"):
        names.index("stick / stick")
