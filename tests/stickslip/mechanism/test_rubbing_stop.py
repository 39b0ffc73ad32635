"""A stop with friction, whose contact is pressed by what it bears: closed forms, and SciPy."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop

MU_S, MU_K = 0.5, 0.3


class Puck(AbstractMechanism):
    """1 kg over a rough floor: weight less a lift that grows, a push and a spring along it."""

    weight: Any = 10.0
    lift: Any = 0.0
    push: Any = 0.0
    stiffness: Any = 0.0
    e: Any = 0.3
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"sole": {"x": 1.0}}
    stops: ClassVar = ("floor",)
    rubbing: ClassVar = {"sole": "floor"}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 1.0}

    def forces(self, t, q, v, args):
        return {"x": self.push - self.stiffness * q.x, "y": self.lift * t - self.weight}

    def contacts(self, t, q, v, args):
        return {"sole": Contact(Coulomb(MU_S, MU_K))}

    def gaps(self, t, q, args):
        return {"floor": Stop(q.y, self.e, 0.05)}


def changes(machine, run):
    count = int(run.num_events)
    return [machine.mode_names[int(m)] for m in run.events.mode_after[:count]]


@pytest.mark.more
def test_a_puck_falls_bounces_rubs_and_stops():
    """No friction in flight nor at the impacts (2, 0.6, 0.18, 0.054 m/s); on the floor 3 m/s2."""
    puck = Puck()
    run = ss.simulate(puck, 0.0, 2.0, puck.state(y=0.2, v_x=1.5), saveat=ss.SaveAt(max_events=16))
    landing = 0.2 + 0.12 + 0.036 + 0.0108
    stop = landing + 1.5 / (MU_K * 10.0)
    assert changes(puck, run) == [
        *["open / open"] * 3, "slip forward / closed", "stick / closed"
    ]  # fmt: skip
    np.testing.assert_allclose(run.events.t[:5], [0.2, 0.32, 0.356, landing, stop], rtol=1e-9)
    np.testing.assert_allclose(run.y1.x, 1.5 * landing + 1.5**2 / (2.0 * MU_K * 10.0), rtol=1e-9)
    assert float(run.y1.v_x) == float(run.y1.y) == float(run.y1.v_y) == 0.0


@pytest.mark.more
def test_friction_falls_with_what_the_stop_bears():
    """At rest until 0.5 (10 - 2 t) N is 2 N, then under 0.3 (10 - 2 t) N, and free from 5 s on."""
    puck = Puck(lift=2.0, push=2.0)
    run = ss.simulate(puck, 0.0, 6.0, puck.state(), saveat=ss.SaveAt(max_events=8))
    assert changes(puck, run) == ["slip forward / closed", "open / open"]
    np.testing.assert_allclose(run.events.t[:2], [3.0, 5.0], rtol=1e-9)

    def speed(t):  # from 3 s on 2 - 0.3 (10 - 2 t) m/s2
        return -1.0 * (t - 3.0) + 0.3 * (t**2 - 9.0)

    np.testing.assert_allclose(run.y1.v_x, speed(5.0) + 2.0, rtol=1e-9)
    way = -0.5 * 2.0**2 + 0.3 * ((5.0**3 - 27.0) / 3.0 - 9.0 * 2.0)
    np.testing.assert_allclose(run.y1.x, way + speed(5.0) + 1.0, rtol=1e-9)
    np.testing.assert_allclose(run.y1.y, 1.0 / 3.0, rtol=1e-8)  # under 2 (t - 5) m/s2
    t = 4.0
    force = puck.friction_forces(t, puck.state(v_x=1.0), puck.mode_names.index("slip forward / closed"))
    load = puck.normal_forces(t, puck.state(v_x=1.0), puck.mode_names.index("slip forward / closed"))
    np.testing.assert_allclose([force["sole"], load["sole"]], [-0.6, 2.0], rtol=1e-12)


def end(p):
    puck = Puck(weight=p[0], stiffness=p[1], e=p[2])
    run = ss.simulate(puck, 0.0, 3.0, puck.state(x=p[3], y=0.1), throw=False)
    return jnp.stack([run.y1.x, run.y1.v_x]), (run.flags, run.successful)


def marched(p):
    """SciPy with its own events, mode by mode."""
    weight, stiffness, e, x, *_ = p
    t, y, vx, vy, closed, sense = 0.0, 0.1, 0.0, 0.0, False, 0.0
    while t < 3.0:
        held = closed and sense == 0.0
        friction = -sense * MU_K * weight if closed else 0.0

        def slope(t, s, held=held, closed=closed, friction=friction):
            a = 0.0 if held else friction - stiffness * s[0]
            return [s[2], s[3], a, 0.0 if closed else -weight]

        def event(t, s, closed=closed):
            return s[2] if closed else s[1]

        event.terminal, event.direction = True, -sense if closed else -1.0
        found = solve_ivp(slope, (t, 3.0), [x, y, vx, vy], events=None if held else event,
                          rtol=1e-11, atol=1e-13)  # fmt: skip
        t, (x, y, vx, vy) = found.t[-1], found.y[:, -1]
        if t < 3.0 and not closed:
            y, vy = 0.0, -e * vy
            closed = vy <= 0.05
            sense, vy = (np.sign(vx), 0.0) if closed else (sense, vy)
        elif t < 3.0:
            pull = -stiffness * x
            vx, sense = 0.0, np.sign(pull) if abs(pull) > MU_S * weight else 0.0
    return x, vx


@pytest.fixture(scope="module")
def pucks():
    """Ends and their slopes for weight, stiffness, restitution and place of the start."""
    p = np.random.default_rng(2).uniform([4.0, 15.0, 0.1, 0.4], [9.0, 40.0, 0.6, 1.0], (12, 4))
    slopes = jax.jacfwd(lambda p: (end(p)[0], end(p)), has_aux=True)
    return p, jax.jit(jax.vmap(slopes))(jnp.asarray(p))


@pytest.mark.more
def test_random_pucks_on_a_spring_are_those_of_scipy(pucks):
    p, (_, (found, (flags, successful))) = pucks
    assert np.all(successful)
    assert not np.any(flags)
    np.testing.assert_allclose(found, [marched(row) for row in p], atol=1e-8)


@pytest.mark.more
def test_slopes_are_those_of_differences(pucks):
    p, (slopes, _) = pucks
    row, h = p[0], 1e-5
    differences = [
        (np.array(marched(row + h * way)) - marched(row - h * way)) / (2.0 * h) for way in np.eye(4)
    ]
    np.testing.assert_allclose(slopes[0], np.array(differences).T, rtol=1e-4, atol=1e-5)


def test_a_contact_on_the_coordinate_of_its_stop_is_named():
    class Skew(Puck):
        contact_directions: ClassVar = {"sole": {"x": 1.0, "y": 0.1}}

    with pytest.raises(ValueError, match=r"rubbing = .*a contact and a stop of constant directions"):
        Skew()
    with pytest.raises(ValueError, match=r"rubbing = 'wall'.*stops: 'floor'"):
        type("Other", (Puck,), {"rubbing": {"sole": "wall"}})()
