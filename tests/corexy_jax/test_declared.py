"""What follows from the declaration, against what was written by hand for this machine."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax as cx
from corexy_jax._contact_motion import contact_motion
from corexy_jax._contacts import Line, line_masses
from corexy_jax._modes import SIGNS
from stickslip.hybrid import use_executor
from stickslip.hybrid.executor import FUSED, PORTABLE
from stickslip.mechanism import AbstractMechanism
from stickslip.mechanism._scalars import Mass
from tests.corexy_jax._events import RECORDED
from tests.corexy_jax._random import machine
from tests.corexy_jax._runs import solution


@pytest.mark.more
@pytest.mark.parametrize("number", RECORDED)
def test_events_and_ends_are_those_of_the_modes_written_by_hand(number):
    end, *events = RECORDED[number]
    found = solution(number)
    log, system = found.events, cx.CoreXY(found.parameters, found.voltage)
    assert log is not None
    count = int(log.count)
    assert count == len(events)
    np.testing.assert_allclose(log.t[:count], [t for t, *_ in events], rtol=0, atol=1e-10)
    assert np.asarray(log.guard)[:count].tolist() == [guard for _, guard, _ in events]
    assert [system.mode_names[m] for m in log.mode_after[:count]] == [mode for *_, mode in events]
    last = np.array([float(x[-1]) for x in found.y])
    np.testing.assert_allclose(last, end, rtol=1e-12, atol=1e-10)


@pytest.mark.parametrize("executor", [PORTABLE, FUSED])
def test_the_closed_form_is_the_motion_of_the_base_class(executor):
    """In every mode, under forces at random: accelerations, and the force of all that rests."""
    p = machine(3)
    system, mass = cx.CoreXY(p, cx.Harmonic(1.0, 1.0)), line_masses(p)
    (group,) = system.structure.groups
    forces = np.random.default_rng(0).normal(size=(len(SIGNS), 4))

    def both(force, signs):
        rest = signs == 0
        if executor is FUSED:
            force, rest = tuple(force), tuple(rest)
        ours = contact_motion(Line(*mass), force, rest)
        base = AbstractMechanism.motion_together(system, group, Mass(list(mass)), force, rest)
        return jnp.stack([jnp.stack(x) for x in ours]), jnp.stack([jnp.stack(x) for x in base])

    with use_executor(executor):
        ours, base = jax.jit(jax.vmap(both))(jnp.asarray(forces), jnp.asarray(SIGNS, jnp.float64))
    np.testing.assert_allclose(ours, base, rtol=1e-11, atol=1e-11)
