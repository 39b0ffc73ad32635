"""Each limit of friction has a guard of its own where what is left to it is a straight line."""

import numpy as np
import pytest

import stickslip as ss
from stickslip.mechanism import AbstractMechanism
from stickslip.systems import BlockOnBeltSetValued, CoulombOscillator, JointedBeam, Motion


class Oscillator(CoulombOscillator):
    """With the guards that follow from its declaration, not the one line of its own."""

    two_sided_contacts = AbstractMechanism.two_sided_contacts
    guards = AbstractMechanism.guards
    guard_scales = None


def test_which_contacts_have_two():
    """Of the block on a belt the load is no straight line: springs of a pendulum."""
    oscillator, beam = Oscillator(1.0, 1.0, 1.0, 0.5, 0.2), JointedBeam.constructed(5e-4)
    assert oscillator.two_sided_contacts == beam.two_sided_contacts == (0,)
    assert oscillator.guard_names == ("belt stops or gives way", "belt gives way forward")
    assert CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2).two_sided_contacts == ()
    assert BlockOnBeltSetValued.constructed(k3=85.0).two_sided_contacts == ()


@pytest.mark.parametrize(("belt_speed", "guard", "name"), [(0.2, 0, "backward"), (-0.2, 1, "forward")])
def test_the_one_that_is_reached_fires(belt_speed, guard, name):
    """The spring pulls back at its limit of 1 N after 5 s, whichever way the belt runs."""
    system = Oscillator(1.0, 1.0, 1.0, 0.5, belt_speed)
    run = ss.simulate(system, 0.0, 8.0, Motion(x=0.0, v=belt_speed), saveat=ss.SaveAt(max_events=9))
    assert int(run.num_events) == 1
    np.testing.assert_allclose(run.events.t[0], 5.0, rtol=1e-12)
    assert int(run.events.guard[0]) == guard
    assert system.mode_names[int(run.mode1)] == f"slip {name}"
    t = 3.0
    expected = np.sign(belt_speed) * (0.5 + 0.5 * np.cos(t) + 0.2 * np.sin(t))
    np.testing.assert_allclose(
        run.y1.x, expected, atol=1e-10
    )  # of a motion of 1 m, as steps are chosen
