"""Attractors that never repeat: exponents and shares beside another integration, none that is none."""

import jax
import numpy as np
import pytest

from stickslip.basin import Judge, Settle, basins
from stickslip.systems import BlockOnBelt, BlockState

from ._systems import Duffing, HalfDamped, TwoRotors, strobes

BOX = {"x": (-1.5, 1.5), "v_x": (-1.5, 1.5)}
PERIOD = 2.0 * np.pi


@pytest.mark.more
def test_a_periodic_and_a_chaotic_motion_side_by_side():
    """Each of 256 starts is called as another integration says, and the exponents are as there."""
    system, settle = Duffing(), Settle(300.0 * PERIOD, PERIOD)
    found = basins(system, system.state(), BOX, settle, points=256)
    assert [a.kind for a in found.attractors] == ["orbit", "chaos"]
    rows, greatest = strobes(system, found.starts.x, found.starts.v_x, 500)
    repeats = np.hypot(*(rows[-1] - rows[-2])) < 1e-6
    assert 0.1 < np.mean(repeats) < 0.5
    settled = found.code >= 0
    assert np.mean(settled) > 0.97
    assert np.array_equal(found.code[settled] == 0, repeats[settled])
    chaos = found.attractors[1]
    assert float(chaos.motion.exponents.sum()) == pytest.approx(-0.15, abs=1e-6)
    # The first start of the reference that does not repeat.
    at = int(np.argmax(~repeats))
    state = found.starts.x[at : at + 1], found.starts.v_x[at : at + 1]
    greatest = strobes(system, *state, 2000)[1]
    assert abs(greatest - float(chaos.motion.exponents[0])) < 3.0 * float(chaos.motion.error[0])
    assert greatest > 0.05
    # A sweep knows them by the map.
    judge = Judge(system, found, settle)
    assert int(jax.jit(judge)(x=state[0][0], v_x=state[1][0])["code"]) == 1
    again = basins(system, system.state(), BOX, settle, points=16, known=found.attractors)
    assert again.names[1] == "chaos 1"


@pytest.mark.more
def test_two_rotors_never_meet_again():
    """Exponents of a torus: two are zero, and the others those of each rotor alone."""
    system = TwoRotors()
    found = basins(
        system, system.state(x=0.5), {"v_x": (-1.0, 1.0), "y": (0.5, 1.0)}, Settle(400.0), points=64
    )
    assert [a.name for a in found.attractors] == ["torus 1"]
    assert found.shares["torus 1"] == 1.0
    torus = found.attractors[0]
    assert torus.words.startswith("torus 1, exponent ")
    assert np.all(np.abs(torus.motion.exponents[:2]) < 0.02)
    assert np.all(torus.motion.exponents[2:] < -0.1)


@pytest.mark.more
def test_motions_without_damping_are_no_attractors():
    """An orbit among a family of them, beside a part that is damped."""
    system = HalfDamped()
    box = {"x": (-1.0, 1.0), "v_x": (-1.0, 1.0), "y": (-1.0, 1.0)}
    found = basins(system, system.state(), box, Settle(200.0), points=64)
    assert not found.attractors
    assert found.shares == {"not settled": 1.0}


@pytest.mark.slow
@pytest.mark.parametrize("k3", [84.0, 89.0])
def test_a_long_way_to_an_orbit_is_no_attractor(k3):
    """Beside the unstable orbit of the block on a belt motions wander for 100 s; there is one
    attractor, whichever start finds it."""
    system, y0 = BlockOnBelt.constructed(k3), BlockState(0.0, 0.0, 0.0, 0.0)
    box = {"x": (-0.01, 0.06), "vx": (-0.3, 0.12), "y": (-0.02, 0.02), "vy": (-0.2, 0.2)}
    for duration in (60.0, 200.0):
        found = basins(system, y0, box, Settle(duration), points=64)
        assert [a.kind for a in found.attractors] == ["orbit"]
        assert float(found.attractors[0].motion.repeats) == 1
    assert found.shares["orbit 1"] > 0.9
