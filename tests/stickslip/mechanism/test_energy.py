"""The energy account of declared machines, through events, to the accuracy of the run."""

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.derived import WithIntegrals
from stickslip.friction import Coulomb
from tests.stickslip.mechanism._machines import (
    BetweenBelts,
    Oscillator,
    Train,
    arm,
    bouncing,
    carriage,
    chain,
)


def accounted(machine, y0, t1, max_events=256):
    """Change of the energy, and the integrals of the powers by name."""
    ledger = WithIntegrals(machine, type(machine).powers)
    run = ss.simulate(ledger, 0.0, t1, ledger.start(y0), saveat=ss.SaveAt(max_events=max_events))
    change = float(machine.energy(run.y1.y) - machine.energy(y0))
    sums = {name: float(x) for name, x in run.y1.integrals.items()}
    return change, sums, run


def moving_arm():
    machine = arm()
    return machine, machine.state(a=0.3, b=-0.4, v_a=1.0)


CASES = {
    "oscillator": (
        lambda: (m := Oscillator(1.0, 1.0, Coulomb(1.0, 0.5), 0.2), m.state(v_x=0.2)), 40.0, 8,
    ),
    "chain": (lambda: (m := chain(3), m.state(x_1=1.0, x_3=-2.0)), 20.0, 6),
    "chain, full mass matrix": (lambda: (m := chain(3, Train), m.state(x_1=1.0, x_3=-2.0)), 20.0, 6),
    "arm": (moving_arm, 10.0, 8),
    "opening contact": (lambda: (m := bouncing(), m.state(x=0.3, y=-0.1)), 20.0, 10),
    "dependent contacts": (lambda: (m := carriage(1.3), m.state()), 12.0, 8),
    "between belts": (
        lambda: (m := BetweenBelts(1.0, (Coulomb(0.4, 0.3), Coulomb(0.7)), (0.1, 0.5)), m.state()),
        20.0,
        3,
    ),
}  # fmt: skip


SLOW = {"chain", "dependent contacts"}


@pytest.mark.more
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=pytest.mark.slow) if n in SLOW else n for n in CASES]
)
def test_powers_account_for_the_energy(name):
    make, t1, least = CASES[name]
    machine, y0 = make()
    change, sums, run = accounted(machine, y0, t1)
    assert int(run.num_events) >= least
    size = 1.0 + sum(map(abs, sums.values()))
    assert sum(map(abs, sums.values())) > 0.1
    np.testing.assert_allclose(change, sum(sums.values()), atol=1e-9 * size)
    friction = [x for key, x in sums.items() if key.startswith("friction of")]
    assert all(x <= 1e-12 for x in friction)
    assert min(friction) < -1e-3


@pytest.mark.more
def test_without_a_potential_the_work_of_the_springs_is_a_power():
    """Springs of the chain are forces to the account; those of the oscillator are stored."""
    block = Oscillator(1.0, 1.0, Coulomb(1.0, 0.5), 0.2)
    _, sums, _ = accounted(block, block.state(v_x=0.2), 10.0)
    assert abs(sums["forces"]) < 1e-12
    row = chain(1)
    _, sums, _ = accounted(row, row.state(x_1=2.0), 10.0)
    assert abs(sums["forces"]) > 0.1


def test_powers_by_hand():
    """One instant of a block that slips on its belt: loss and drive, both by the belt's friction."""
    block = Oscillator(1.0, 3.0, Coulomb(1.0, 0.5), 0.2, load=2.0)
    y, mode = block.state(x=0.1, v_x=-0.4), block.mode_names.index("slip backward")
    found = block.powers(0.0, y, jnp.asarray(mode), None)
    assert float(found["friction of belt"]) == pytest.approx(0.5 * 2.0 * -0.6)
    assert float(found["drive of belt"]) == pytest.approx(0.5 * 2.0 * 0.2)
    assert float(found["forces"]) == pytest.approx(0.0)
    assert float(block.energy(y)) == pytest.approx(0.5 * 0.16 + 1.5 * 0.01)
