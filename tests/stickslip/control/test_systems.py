"""Loops of other systems, and loops inside of what takes any system."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.control import WithController
from stickslip.derived import WithDeviations, WithIntegrals
from stickslip.identification import Observed, Problem, Record
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.control._axis import begin, under_pid
from tests.stickslip.control._reference import Loop


@pytest.mark.more
def test_an_output_may_be_a_parameter_of_the_system():
    """The spring is twice as stiff from 3.5 s on: at 0.7 m it tears the block off its belt at once."""
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)

    def stiffness(k, t, measured, state, args):
        return jnp.where(k < 5, 1.0, 2.0), state

    def drive(system, output, args):
        return eqx.tree_at(lambda s: s.stiffness, system, output), args

    loop = WithController(block, stiffness, 0.7, drive=drive)
    run = ss.simulate(loop, 0.0, 9.0, loop.start(Motion(x=0.0, v=0.2)))
    first = ss.simulate(block, 0.0, 3.5, Motion(x=0.0, v=0.2))
    stiffer = CoulombOscillator(1.0, 2.0, 1.0, 0.5, 0.2)
    second = ss.simulate(stiffer, 3.5, 9.0, first.y1, "slip backward")
    assert float(run.y1.y.x) == pytest.approx(float(second.y1.x), abs=1e-10)
    assert int(first.num_events) == 0


@pytest.mark.more
def test_a_regularised_axis_is_near():
    loop = under_pid()
    near = WithController(loop.system.regularised(1e-4), loop.update, 0.01, loop.initial)
    accurate = ss.Integrator(step=ss.AdaptiveStep(1e-8))
    run = ss.simulate(near, 0.0, 1.0, begin(near), integrator=accurate)
    assert float(run.y1.y.x) == pytest.approx(Loop().run(100, 0.1)[0], abs=1e-3)


@pytest.mark.more
def test_breaks_and_integrals_around_a_loop():
    loop = under_pid()
    broken = ss.WithBreaks(loop, [0.305])
    run = ss.simulate(broken, 0.0, 1.0, broken.start(begin(loop)))
    x = Loop().run(100, 0.1)[0]
    assert float(run.y1.y.y.x) == pytest.approx(x, abs=1e-14)
    ledger = WithIntegrals(
        loop, lambda s, t, y, mode, args: {"work": y.output * y.y.v_x}, units={"work": "J"}
    )
    run = ss.simulate(ledger, 0.0, 0.5, ledger.start(begin(loop)))
    # The work of the output is what friction takes, 1 N of the way, and the energy at the end.
    y = run.y1.y.y
    assert float(run.y1.integrals["work"]) == pytest.approx(0.1 - float(y.x) + 0.5 * float(y.v_x) ** 2)


@pytest.mark.more
def test_deviations_of_a_loop_are_its_derivatives():
    loop = under_pid()
    tangent = WithDeviations(loop)
    start = begin(loop)
    size = len(loop.units) + 2
    along = np.zeros((size, 1))
    along[0] = 1.0
    run = ss.simulate(tangent, 0.0, 0.5, tangent.start(start, along))
    ends = [Loop().run(50, 0.1 + h)[:2] for h in (-1e-6, 1e-6)]
    slopes = (np.array(ends[1]) - np.array(ends[0])) / 2e-6
    found = [float(part[0]) for part in run.y1.deviations.y]
    assert np.allclose(found, slopes, rtol=1e-6)


@pytest.mark.more
def test_friction_is_identified_through_the_loop():
    """From positions alone, with the controller known."""
    times = np.linspace(0.0, 1.5, 31)

    def loop(values):
        return under_pid(0.02, kinetic=values["kinetic"])

    run = ss.simulate(
        loop({"kinetic": 1.0}), 0.0, 1.5, begin(loop({"kinetic": 1.0})), saveat=ss.SaveAt(ts=times)
    )
    noise = 1e-5 * np.random.default_rng(0).standard_normal(times.size)
    problem = Problem(
        system=lambda values, inputs: loop(values),
        initial_state=lambda values, inputs: begin(loop(values)),
        unknowns={"kinetic": 0.9},
        observed={"position": Observed(lambda t, y, system: y.y.x, 1e-5, "m")},
        records=Record(times, {"position": np.asarray(run.outputs.y.y.x) + noise}),
    )
    assert float(problem.fit().values["kinetic"]) == pytest.approx(1.0, abs=5e-4)
