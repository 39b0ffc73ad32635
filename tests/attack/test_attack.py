"""The random attack finds what is wrong, and nothing where nothing is."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from stickslip.friction import Stribeck
from tests.attack._draw import numbers, structure_of
from tests.attack._one import attack, smallest
from tests.attack._reference import March
from tests.attack._structure import Numbers, Parameter, Program, Structure, Touch
from tests.attack._transformations import OF_STRUCTURES, units
from tests.attack._verdict import CLASSES, CRASH, RIGHT, TIMES, WRONG, again, beside_truth, truth_of

FORCE, SPEED = (0, 1, 0), (1, 0, -1)
BLOCK = Structure(
    {"x": "m"}, {("x", "x"): "p0"}, (("x", "-p1 * x"),),
    (Touch("belt", {"x": "1.0"}, True, "Coulomb(p2, p3)", surface="p4"),),
    parameters={
        "p0": Parameter((-1, 1, 2), 0.5, 2.0), "p1": Parameter((-1, 1, 0), 0.5, 2.0),
        "p2": Parameter(FORCE, 0.5, 2.0), "p3": Parameter(FORCE, 0.5, 2.0),
        "p4": Parameter(SPEED, 0.5, 2.0),
    },
)  # fmt: skip
VALUES = Numbers({"p0": 1.0, "p1": 1.0, "p2": 1.0, "p3": 0.5, "p4": 0.2}, {"x": 0.0, "v_x": 0.2}, 50.0)


@pytest.mark.more
def test_block_on_a_belt_is_right_in_the_reference_and_in_the_package():
    """Its place after 50 s stands in the docstring of `AbstractMechanism`."""
    truth = truth_of(BLOCK, VALUES)
    assert truth.y[-1, 0] == pytest.approx(1.0354672845, abs=1e-9)
    program = Program(BLOCK)
    ts = np.linspace(0.0, VALUES.end, TIMES)
    assert beside_truth(program.run(VALUES, ts), truth, VALUES) == (RIGHT, "")
    other, scaled, back = units(BLOCK, VALUES, np.random.default_rng(1))
    got = program.run(scaled, ts * (scaled.end / VALUES.end))
    states = back(ts, dict(zip(other.components, got.y.T, strict=True)))
    np.testing.assert_allclose(np.stack([*states.values()], -1), truth.y, atol=1e-8)


@pytest.mark.more
@pytest.mark.parametrize("name", OF_STRUCTURES)
def test_said_otherwise_a_machine_is_the_same_for_the_reference(name):
    """So the transformations are right, whatever the package does."""
    found, rng = 0, np.random.default_rng(5)
    while not found:
        structure = structure_of(rng)
        n = numbers(structure, rng)
        other = OF_STRUCTURES[name](structure, n, rng)
        if other is None or structure.form:
            continue
        s, m, back = other
        ts = np.linspace(0.0, 0.3, 3)
        (one, end), (two, _) = (
            March(a, b._replace(end=0.3), 1e-9, 20).run(ts) for a, b in ((structure, n), (s, m))
        )
        states = back(ts, dict(zip(s.components, two.T, strict=True)))
        found = end == 0.3
        np.testing.assert_allclose(
            np.stack([states[c] for c in structure.components], -1), one, atol=1e-6
        )


@pytest.mark.slow
def test_planted_fault_is_found_and_shrunk(monkeypatch):
    """Friction that is a hundredth too small ahead; a second mass and its spring have no part in it."""
    right = Stribeck.kinetic

    def smaller(self, v, sense):
        return right(self, v, sense) * (1.0 - 0.005 * (1.0 + sense))

    monkeypatch.setattr(Stribeck, "kinetic", smaller)
    more = replace(
        BLOCK,
        coordinates={"x": "m", "y": "m"},
        mass={**BLOCK.mass, ("y", "y"): "p0"},
        forces=(*BLOCK.forces, ("x", "-0.1 * v_x"), ("y", "-p1 * y")),
        contacts=(replace(BLOCK.contacts[0], law="Stribeck(p2, p3, p4)"),),
    )
    n = VALUES._replace(start={"x": 0.0, "v_x": 1.0, "y": 0.5, "v_y": 0.0}, end=6.0)
    found = again(more, n, "reference")
    assert found.verdict == WRONG
    text = smallest(more, found, 300.0)
    assert WRONG in text
    assert "Stribeck" in text
    assert "y = " not in text.split("class Machine")[1].split("machine = ")[0]


@pytest.mark.slow
def test_structures_of_a_seed_are_not_silently_wrong():
    counts: Counter = Counter()
    for number in range(4):
        _, found, _ = attack(11, number, 60.0)
        counts.update(found)
    assert not [k for k in counts if k[1] in (WRONG, CRASH)]
    assert {v for _, v in counts} <= set(CLASSES)
