"""Friction in a plane: ellipses, joined inertia, curved coordinates, lift-off, slopes, errors."""

from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Asymmetric, Coulomb, Stribeck
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from tests.stickslip.mechanism._planar import G, Puck, Pulled, Turntable, moreau, slide_to_rest
from tests.stickslip.mechanism.test_planar import MU, array, log


def elliptic(limits, u):
    """Friction of greatest dissipation for an ellipse with these semi-axes."""
    used = limits * u
    return -limits * used / np.hypot(*used)


@pytest.mark.more
def test_an_ellipse_of_two_coefficients():
    """SciPy while it slides; along an axis it is a line; at rest it bears an ellipse."""
    first, second = Coulomb(0.4, 0.35), Coulomb(0.2, 0.15)
    puck = Puck(first, 0.3, -0.2, across=second)
    limits = np.array([0.35, 0.15]) * G

    def field(t, y):
        return [*y[2:], *(np.array([0.3, -0.2]) + elliptic(limits, y[2:]))]

    run = ss.simulate(puck, 0.0, 0.9, puck.state(v_x=3.0, v_y=2.0))
    exact = solve_ivp(field, (0.0, 0.9), [0.0, 0.0, 3.0, 2.0], method="DOP853", rtol=1e-13, atol=1e-15)
    np.testing.assert_allclose(array(run.y1), exact.y[:, -1], atol=1e-10)
    for v, limit in (([2.0, 0.0], limits[0]), ([0.0, -2.0], limits[1])):
        puck = Puck(first, across=second)
        run = ss.simulate(puck, 0.0, 2.0, puck.state(v_x=v[0], v_y=v[1]))
        np.testing.assert_allclose(array(run.y1)[:2], np.sign(v) * 2.0 / limit, atol=1e-12)
    for angle in (0.3, 1.2, 2.5):
        edge = np.array([0.4 * np.cos(angle), 0.2 * np.sin(angle)]) * G
        for share, holds in ((0.99999, True), (1.00001, False)):
            puck = Puck(first, *(share * edge), across=second)
            run = ss.simulate(puck, 0.0, 0.5, puck.state())
            assert (not array(run.y1).any()) == holds


@pytest.mark.more
def test_a_slide_on_an_ellipse_ends_to_the_stated_accuracy():
    """Its time is right to a part of the speed of rest over the deceleration, its place far better."""
    limits = np.array([0.35, 0.15]) * G
    load = np.array([0.5, 0.4])
    puck = Puck(Coulomb(0.35), *load, across=Coulomb(0.15))
    run = ss.simulate(puck, 0.0, 4.0, puck.state(v_x=2.0, v_y=-1.0))

    def field(tau, y):  # in the logarithm of the speed: s = exp(-tau)
        s, e = np.exp(-tau), np.array([np.cos(y[2]), np.sin(y[2])])
        force = load + elliptic(limits, e)
        slower = -force @ e
        return [*(s * s / slower * e), (force[1] * e[0] - force[0] * e[1]) / slower, s / slower]

    start = [0.0, 0.0, np.arctan2(-1.0, 2.0), 0.0]
    exact = solve_ivp(
        field, (-np.log(np.sqrt(5.0)), 30.0), start, method="DOP853", rtol=1e-12, atol=1e-14
    ).y[:, -1]
    np.testing.assert_allclose(array(run.y1)[:2], exact[:2], atol=1e-9)
    np.testing.assert_allclose(log(puck, run)[1][-1], exact[3], atol=1e-7)


class Loaded(AbstractMechanism):
    """A frame that rubs on a table in the plane, and a mass that slides on it along a line."""

    law: Any
    coordinates: ClassVar = {"x": "m", "y": "m", "r": "m"}
    contact_directions: ClassVar = {"along": {"x": 1.0}, "across": {"y": 1.0}}
    planar: ClassVar = {"along": "across"}

    def mass_matrix(self, q):
        return [[1.5, 0.0, 0.3], [0.0, 1.5, 0.4], [0.3, 0.4, 0.5]]

    def forces(self, t, q, v, args):
        return {"x": 1.0, "y": 0.5 * jnp.sin(t), "r": -6.0 * q.r}

    def contacts(self, t, q, v, args):
        return {"along": Contact(self.law, 1.5 * G), "across": Contact(self.law)}

    def time_scale(self, args):
        return 1.0


@pytest.mark.more
def test_inertia_that_joins_it_with_others():
    """SciPy while it slides; then it sticks with the mass swinging on it, and gives way again."""
    machine = Loaded(Coulomb(0.12, 0.1))
    M = np.array(machine.mass_matrix(None))
    y0 = [0.0, 0.0, 0.6, 1.0, -0.5, 0.0]

    def field(t, y):
        s = np.hypot(*y[3:5])
        friction = -0.1 * 1.5 * G * y[3:5] / s
        force = [1.0 + friction[0], 0.5 * np.sin(t) + friction[1], -6.0 * y[2]]
        return [*y[3:], *np.linalg.solve(M, force)]

    start = machine.state(r=0.6, v_x=1.0, v_y=-0.5)
    run = ss.simulate(machine, 0.0, 0.7, start)
    exact = solve_ivp(field, (0.0, 0.7), y0, method="DOP853", rtol=1e-13, atol=1e-15).y[:, -1]
    assert np.hypot(*exact[3:5]) > 0.1
    np.testing.assert_allclose(array(run.y1), exact, atol=1e-9)

    def stepped(steps):
        """Moreau's stepping, with the disc solved by iteration: the mobility is no multiple of 1."""
        h, y, W = 6.0 / steps, np.array(y0), np.linalg.inv(M)
        D, impulse = W[:2, :2], np.zeros(2)
        most, rho = 0.12 * 1.5 * G * h, 1.0 / np.linalg.eigvalsh(D).max()
        for k in range(steps):
            q = y[:3] + 0.5 * h * y[3:]
            free = y[3:] + h * W @ [1.0, 0.5 * np.sin((k + 0.5) * h), -6.0 * q[2]]
            for _ in range(200):
                aim = impulse - rho * (free[:2] + D @ impulse)
                new = aim * min(1.0, most / max(np.hypot(*aim), 1e-300))
                if np.abs(new - impulse).max() < 1e-14:
                    break
                impulse = new
            v = free + W[:, :2] @ impulse
            y = np.concatenate([q + 0.5 * h * v, v])
        return y

    machine = Loaded(Coulomb(0.12))
    run = ss.simulate(machine, 0.0, 6.0, start)
    assert len({*log(machine, run)[0]}) == 3
    errors = [np.abs(stepped(n) - array(run.y1)).max() for n in (1500, 12000)]
    assert errors[1] < 2e-3
    assert errors[0] > 3.0 * errors[1]


class Polar(AbstractMechanism):
    """A puck in polar coordinates: its inertia and the axes of its contact vary."""

    law: Any
    turn: Any = 0.0
    coordinates: ClassVar = {"r": "m", "phi": "rad"}
    contact_directions: ClassVar = {"outwards": {"r": 1.0}, "round": None}
    planar: ClassVar = {"outwards": "round"}

    def mass_matrix(self, q):
        return {"r": 1.0, "phi": q.r * q.r}

    def forces(self, t, q, v, args):
        return {"r": q.r * v.phi * v.phi, "phi": -2.0 * q.r * v.r * v.phi}

    def contacts(self, t, q, v, args):
        spin = Contact(self.law, surface_speed=self.turn * q.r, direction={"phi": q.r})
        return {"outwards": Contact(self.law, G), "round": spin}

    def time_scale(self, args):
        return 1.0


@pytest.mark.more
def test_directions_that_vary():
    """In polar coordinates a straight slide is straight, and a turntable takes the puck along."""
    polar = Polar(Coulomb(MU))
    run = ss.simulate(polar, 0.0, 3.0, polar.state(r=1.0, v_r=1.2, v_phi=1.6))
    r, phi = array(run.y1)[:2]
    way = 2.0**2 / (2.0 * MU * G)
    np.testing.assert_allclose(
        [r * np.cos(phi), r * np.sin(phi)], [1.0 + 0.6 * way, 0.8 * way], atol=1e-10
    )
    np.testing.assert_allclose(log(polar, run)[1][-1], 2.0 / (MU * G), rtol=1e-10)
    polar, table = Polar(Coulomb(0.6, 0.5), 2.0), Turntable(Coulomb(0.6, 0.5), turn=2.0)
    run = ss.simulate(polar, 0.0, 5.0, polar.state(r=0.7))
    other = ss.simulate(table, 0.0, 5.0, table.state(x=0.7))
    assert log(polar, run)[0][-1] == log(table, other)[0][-1] == "stick / stick"
    r, phi, _, spin = array(run.y1)
    x = r * np.array([np.cos(phi), np.sin(phi)])
    np.testing.assert_allclose(array(other.y1), [*x, -spin * x[1], spin * x[0]], atol=1e-9)


@pytest.mark.more
def test_neither_axes_nor_their_order_matter():
    """Axes at 30 degrees to the coordinates, the second of them as the one with the normal force."""
    c, s = np.cos(np.pi / 6.0), np.sin(np.pi / 6.0)

    class Turned(Puck):
        contact_directions: ClassVar = {"along": {"x": c, "y": s}, "across": {"x": -s, "y": c}}
        planar: ClassVar = {"across": "along"}

        def contacts(self, t, q, v, args):
            along = Contact(self.law, surface_speed=0.3 * c + 0.2 * s)
            return {"across": Contact(self.law, G, 0.2 * c - 0.3 * s), "along": along}

    plain, turned = Puck(Coulomb(MU), 1.0, -0.4, 0.3, 0.2), Turned(Coulomb(MU), 1.0, -0.4)
    runs = [ss.simulate(p, 0.0, 3.0, p.state(v_x=1.0, v_y=2.0)) for p in (plain, turned)]
    np.testing.assert_allclose(array(runs[1].y1), array(runs[0].y1), atol=1e-10)
    np.testing.assert_allclose(runs[1].events.t[1], runs[0].events.t[1], atol=1e-10)
    assert [int(run.num_events) for run in runs] == [2, 2]


class Hopping(Puck):
    """Its normal force swings through zero: it opens, flies, and closes again."""

    opening: ClassVar = ("along",)

    def load(self, t, q):
        return G * jnp.cos(3.0 * t)

    def time_scale(self, args):
        return 0.3


@pytest.mark.more
def test_it_opens_and_closes():
    puck = Hopping(Coulomb(MU), 0.5, 0.2, 0.1, 0.0)
    run = ss.simulate(puck, 0.0, 3.0, puck.state(v_x=1.0, v_y=-0.5))
    names, times = log(puck, run)
    assert names.count("open / open") == 2
    assert "stick / stick" in names
    opens = [t for n, t in zip(names, times, strict=True) if n == "open / open"]
    for name, load in (("open / open", 0.0), ("stick / stick", G)):
        mode = puck.mode_names.index(name)
        found = puck.normal_forces(0.0, puck.state(), mode)
        assert {key: float(x) for key, x in found.items()} == {"along": load, "across": load}
        assert float(puck.friction_forces(0.0, puck.state(), mode)["along"]) == -0.5 * (load > 0.0)
    np.testing.assert_allclose(opens, np.array([1.0, 5.0]) * np.pi / 6.0, rtol=1e-12)

    def stepped(steps):
        return moreau(
            [1.0], lambda t: max(0.0, MU * G * np.cos(3.0 * t)), lambda t, q: np.array([[0.5, 0.2]]),
            lambda t, q: np.array([[0.1, 0.0]]), np.zeros((1, 2)), np.array([[1.0, -0.5]]), 3.0, steps,
        )  # fmt: skip

    errors = [np.abs(stepped(n) - array(run.y1)).max() for n in (3000, 24000)]
    assert errors[1] < 2e-4
    assert errors[0] > 4.0 * errors[1]


@pytest.mark.more
def test_at_rest_it_opens_and_closes_without_a_motion():
    puck = Hopping(Coulomb(MU))
    run = ss.simulate(puck, 0.0, 3.0, puck.state())
    assert log(puck, run)[0] == ["open / open", "stick / stick", "open / open"]
    assert not array(run.y1).any()

    class Fixed(Hopping):
        opening: ClassVar = ()

    fixed = Fixed(Coulomb(MU))
    run = ss.simulate(fixed, 0.0, 3.0, fixed.state(), throw=False)
    assert run.result == ss.RESULTS.no_admissible_mode
    np.testing.assert_allclose(run.t1, np.pi / 6.0, rtol=1e-9)


@pytest.mark.more
def test_without_friction_it_is_free():
    for load in (0.0, 0.5):
        puck = Puck(Coulomb(0.0), load, 0.0)
        for v in (0.0, 1e-9, 2.0):
            run = ss.simulate(puck, 0.0, 1.0, puck.state(v_y=v))
            np.testing.assert_allclose(array(run.y1), [0.5 * load, v, load, v], atol=1e-12)


@pytest.mark.parametrize("size", [1e-12, 1e-6, 1e-3, 1e3])
def test_of_any_size(size):
    puck = Puck(Coulomb(MU), 1.0, -0.5)
    time, way = slide_to_rest((0.6 * size, 0.8 * size), (1.0, -0.5), MU * G)
    start = puck.state(v_x=0.6 * size, v_y=0.8 * size)
    run = ss.simulate(puck, 0.0, 2.0 * time, start)
    np.testing.assert_allclose(array(run.y1)[:2], way, rtol=1e-9)
    np.testing.assert_allclose(log(puck, run)[1][-1], time, rtol=1e-9)


# -- slopes


def _differences(function, p, h=1e-4):
    rows = []
    for i in range(len(p)):
        f = [np.array(function(p.at[i].add(k * h))) for k in (1.0, -1.0, 2.0, -2.0)]
        rows.append((8.0 * (f[0] - f[1]) - (f[2] - f[3])) / (12.0 * h))
    return np.stack(rows, 1)


@pytest.mark.more
def test_slopes_through_a_stop():
    """Of where and when it stops, by friction, load and speeds; of a straight slide in closed form."""

    @jax.jit
    def end(p):
        puck = Puck(Coulomb(p[0]), p[1], p[2])
        start = puck.state()._replace(v_x=p[3], v_y=p[4])
        run = ss.simulate(puck, 0.0, 6.0, start, throw=False)
        return jnp.stack([run.y1.x, run.y1.y, run.events.t[1]])

    slopes = jax.jit(jax.jacfwd(end))
    p = jnp.array([MU, 1.0, -0.4, 3.0, 4.0])
    np.testing.assert_allclose(slopes(p), _differences(end, p), atol=2e-8)
    straight = slopes(jnp.array([MU, 0.0, 0.0, 3.0, 4.0]))
    a = MU * G
    exact = [
        [-2.548419979612640 / MU, (9.0 / 5.0 + 5.0) / (2.0 * a), 12.0 / 5.0 / (2.0 * a)],
        [-3.397893306150187 / MU, 12.0 / 5.0 / (2.0 * a), (16.0 / 5.0 + 5.0) / (2.0 * a)],
        [-5.0 / a / MU, 0.6 / a, 0.8 / a],
    ]
    np.testing.assert_allclose(straight[:, jnp.array([0, 3, 4])], exact, atol=1e-8)


@pytest.mark.more
def test_slopes_through_the_onset_of_a_slide():
    @jax.jit
    def end(p):
        pucks = Pulled(Coulomb(p[0], 0.25), p[1], speed=(p[2], p[3]))
        run = ss.simulate(pucks, 0.0, 3.0, pucks.state(), throw=False)
        return jnp.stack([*jax.tree.leaves(run.y1), run.events.t[0]]), run.num_events

    p = jnp.array([0.35, 4.0, 0.5, 0.2])
    slopes, _ = jax.jit(jax.jacfwd(end, has_aux=True))(p)
    assert int(end(p)[1]) > 1
    np.testing.assert_allclose(slopes, _differences(lambda x: end(x)[0], p, 1e-5), rtol=1e-5, atol=1e-5)


# -- declarations


def _declares(match, kind=ss.mechanism.DeclarationError, base=Puck, law=None, **attributes):
    def run():
        machine = type("Other", (base,), attributes)(Coulomb(MU) if law is None else law)
        ss.simulate(machine, 0.0, 1.0, machine.state())

    with pytest.raises(kind, match=match):
        run()


def test_wrong_declarations_are_named():
    _declares("planar = 'up'.*names of contacts.*'along', 'across'", ValueError, planar={"along": "up"})
    _declares("planar = 'along'.*at most once", ValueError, planar={"along": "along"})
    _declares("planar = .*a mapping", TypeError, planar=("along", "across"))
    _declares("opening = 'across'.*'along', which opens both", ValueError, opening=("across",))
    both = {"along": {"x": 1.0}, "across": {"x": 2.0}}
    _declares("planar = 'along and across'.*independent", contact_directions=both)
    third = {**Puck.contact_directions, "wall": {"x": 1.0}}
    contacts = lambda self, t, q, v, args: {  # noqa: E731
        **Puck.contacts(self, t, q, v, args),
        "wall": Contact(self.law),
    }
    _declares("planar = 'along and across and wall'", contact_directions=third, contacts=contacts)
    gaps = lambda self, t, q, args: {"end": Stop(1.0 - q.x, 0.5)}  # noqa: E731
    _declares("planar = 'along and across and end'", stops=("end",), gaps=gaps)
    twice = lambda self, t, q, v, args: [Contact(self.law, G), Contact(self.law, G)]  # noqa: E731
    _declares("the normal force of contact 'across' = 9.81.*'along' has that of both", contacts=twice)
    one_way = Asymmetric(Coulomb(0.3), Coulomb(0.2))
    _declares("the law of contact 'along' = Asymmetric.*in both senses", law=one_way)
    vector = {"along": ([1.0, 0.0], [0.0, 1.0])}
    named = "two contacts, which `planar` names"
    _declares(named, ValueError, contact_directions=vector, planar={})


@pytest.mark.more
def test_lanes_are_those_alone_and_compile_once():
    laws = Stribeck(0.4, 0.3, 0.5)
    loads = np.linspace(-1.0, 4.5, 12)

    def end(load):
        puck = Puck(laws, load, 0.3)
        run = ss.simulate(puck, 0.0, 3.0, puck.state()._replace(v_x=1.0, v_y=-2.0), throw=False)
        return jnp.stack(jax.tree.leaves(run.y1)), run.result == ss.RESULTS.successful

    together, fine = jax.jit(jax.vmap(end))(loads)
    assert np.all(fine)
    alone = jax.jit(end)
    np.testing.assert_allclose(together, [alone(x)[0] for x in loads], rtol=1e-9, atol=1e-9)
    mapped = ss.map_lanes(end)(loads)
    np.testing.assert_allclose(mapped[0], together, rtol=1e-9, atol=1e-9)


@pytest.mark.more
def test_two_crossed_contacts_are_a_square():
    """A newcomer's two lines with one normal force: 0.6 of the way, and off it. `planar` is right."""

    class Crossed(Puck):
        planar: ClassVar = {}

        def contacts(self, t, q, v, args):
            return [Contact(self.law, G), Contact(self.law, G)]

    crossed, puck = Crossed(Coulomb(MU)), Puck(Coulomb(MU))
    ends = [array(ss.simulate(m, 0.0, 4.0, m.state(v_x=3.0, v_y=4.0)).y1)[:2] for m in (crossed, puck)]
    np.testing.assert_allclose(ends[0], np.array([9.0, 16.0]) / (2.0 * MU * G), rtol=1e-9)
    np.testing.assert_allclose(ends[1], 25.0 / (2.0 * MU * G) * np.array([0.6, 0.8]), rtol=1e-9)
