"""Mechanisms with bristles against SciPy: equations of LuGre and Dahl written by hand in NumPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import scipy.integrate

import stickslip as ss
from stickslip.friction import Coulomb, Dahl, LuGre
from stickslip.mechanism import Contact

from ._machines import Arm, Bouncing, Chain, Oscillator, Pushed, Train

END = 4.0


def rates(kind, p, u, z):
    """Coefficient and rate of the bristles; `p` holds the law and the bristles."""
    if kind is Dahl:
        return p["s0"] * z, u * (1.0 - p["s0"] * z / p["k"] * np.sign(u))
    g = p["k"] + (p["s"] - p["k"]) * np.exp(-((u / p["v_s"]) ** 2))
    rate = u - p["s0"] * np.abs(u) / g * z
    return p["s0"] * z + p["s1"] * rate + p["s2"] * u, rate


def block(p, t, q, v, mu):
    return (-p["c"] * q - p["N"] * mu) / p["m"]


def blocks(p, t, q, v, mu):
    force = p["c"] * (0.3 * t - q)
    force[1:] -= 2.0 * (q[1:] - q[:-1])
    force[:-1] -= 2.0 * (q[:-1] - q[1:])
    return (force - mu) / p["m"]


def links(p, t, q, v, mu):
    (a, b), m = q, p["m"]
    c, s = 0.5 * m * np.cos(a - b), 0.5 * m * np.sin(a - b)
    M = np.array([[4.0 / 3.0 * m, c], [c, m / 3.0]])
    one, two = np.sin(1.3 * t), 0.8 * np.sin(2.1 * t + 0.4)
    f = [-s * v[1] ** 2 + p["c"] * one, s * v[0] ** 2 - p["c"] * two]
    J = np.array([[1.0, 0.0], [-1.0, 1.0]])
    return np.linalg.solve(M, f - J.T @ mu)


# Name: accelerations, directions of the contacts, speed of the surface, number of coordinates.
REFERENCES = {
    "block": (block, np.eye(1), 0.25),
    "two blocks": (blocks, np.eye(2), 0.0),
    "chain": (blocks, np.eye(4), 0.0),
    "chain, distances": (blocks, np.eye(4), 0.0),
    "arm": (links, np.array([[1.0, 0.0], [-1.0, 1.0]]), 0.0),
}


def machine(name, p, law):
    count = len(REFERENCES[name][1])
    if name == "block":
        return Oscillator(p["m"], p["c"], law, 0.25, p["N"])
    if name == "arm":
        return Arm(p["m"], p["c"], (law, law))
    kind = Train if "distances" in name else Chain
    return kind(p["m"], p["c"], 2.0, (law,) * count, 0.3, count)


def end_of(name, kind, p, **options):
    law = Coulomb(p["s"] if kind is LuGre else p["k"], p["k"])
    others = {"sigma_1": p["s1"], "sigma_2": p["s2"], "v_s": p["v_s"]} if kind is LuGre else {}
    form = machine(name, p, law).bristles(kind, sigma_0=p["s0"], **others)
    start = form.mechanism.state()
    y = ss.simulate(form, 0.0, END, form.start(start), **options).y1
    q, v = form.mechanism.to_coordinates(y.y)
    rows = jnp.stack([jnp.stack(q), jnp.stack(v)])
    rows = jnp.cumsum(rows, 1) if "distances" in name else rows
    return jnp.concatenate([rows.ravel(), jnp.stack([z for (z,) in y.z])])


def by_scipy(name, kind, p):
    acceleration, J, surface = REFERENCES[name]
    n = len(J)

    def field(t, y):
        q, v, z = y[:n].copy(), y[n : 2 * n], y[2 * n :]
        mu, rate = rates(kind, p, J @ v - surface, z)
        return np.concatenate([v, np.atleast_1d(acceleration(p, t, q, v, mu)), rate])

    run = scipy.integrate.solve_ivp(
        field, (0.0, END), np.zeros(3 * n), method="LSODA", rtol=1e-11, atol=1e-13, max_step=0.01
    )
    return run.y[:, -1]


def parameters(count, seed):
    rng = np.random.default_rng(seed)
    k = rng.uniform(0.3, 1.0, count)
    s0 = 10.0 ** rng.uniform(1.0, 4.0, count)
    return {
        "m": rng.uniform(0.5, 2.0, count),
        "c": rng.uniform(1.0, 4.0, count),
        "N": rng.uniform(0.3, 3.0, count),
        "k": k,
        "s": k * rng.uniform(1.0, 1.6, count),
        "s0": s0,
        "s1": np.sqrt(s0) * rng.uniform(0.0, 1.5, count),
        "s2": rng.uniform(0.0, 0.3, count),
        "v_s": rng.uniform(0.05, 0.3, count),
    }


QUICK = [("block", LuGre), ("block", Dahl), ("two blocks", LuGre), ("arm", Dahl)]
CASES = [
    pytest.param(name, kind, marks=() if (name, kind) in QUICK else pytest.mark.slow)
    for name in REFERENCES
    for kind in (LuGre, Dahl)
    if (name, kind) != ("chain, distances", LuGre)
]


@pytest.mark.more
@pytest.mark.parametrize(("name", "kind"), CASES)
def test_random_machines_with_bristles_are_scipys(name, kind):
    many = parameters(4, len(name))
    lanes = jax.vmap(lambda p: end_of(name, kind, p))(many)
    for i in range(4):
        p = {key: row[i] for key, row in many.items()}
        np.testing.assert_allclose(lanes[i], by_scipy(name, kind, p), rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_slopes_of_a_machine_with_bristles_are_those_of_differences():
    p = {key: row[0] for key, row in parameters(1, 3).items()}

    def end(k):
        return end_of("two blocks", LuGre, {**p, "k": k, "s": 1.3 * k, "s0": 300.0, "s1": 20.0})[0]

    k, h = 0.6, 1e-4
    differences = (end(k + h) - end(k - h)) / (2 * h)
    assert jax.grad(end)(k) == pytest.approx(float(differences), rel=1e-5)
    assert jax.jvp(end, (k,), (1.0,))[1] == pytest.approx(float(differences), rel=1e-5)


def test_bristles_without_a_load_are_free():
    """A normal force of zero leaves the oscillator alone."""
    form = Oscillator(1.0, 4.0, Coulomb(0.5), 0.2, 0.0).bristles(LuGre, sigma_0=1e3, sigma_1=10.0)
    end = ss.simulate(form, 0.0, END, form.start(form.mechanism.state(x=1.0))).y1.y
    np.testing.assert_allclose([end.x, end.v_x], [np.cos(8.0), -2.0 * np.sin(8.0)], atol=1e-9)


@pytest.mark.more
def test_bristles_of_a_contact_that_opens_tend_to_the_event_driven_form():
    machine = Bouncing(5.0, 3.0, 1.7, Coulomb(0.3), 0.2)
    start = machine.state(y=-0.1)
    exact = ss.simulate(machine, 0.0, 6.0, start)
    assert "open" in [machine.mode_names[m] for m in exact.events.mode_after[: int(exact.num_events)]]
    off = []
    for sigma_0 in (1e2, 1e4):
        form = machine.bristles(LuGre, sigma_0=sigma_0, sigma_1=2.0 * sigma_0**0.5)
        end = ss.simulate(form, 0.0, 6.0, form.start(start)).y1.y
        off.append(max(abs(float(a - b)) for a, b in zip(end, exact.y1, strict=True)))
    assert off[1] < 0.2 * off[0] < 0.02


class Lifted(Pushed):
    """The ground lets go at t = 2 s."""

    def contacts(self, t, q, v, args):
        return {"ground": Contact(self.law, 1.0 - 0.5 * t)}


@pytest.mark.more
@pytest.mark.parametrize("form", ["itself", "regularised", "bristles"])
def test_a_contact_that_loses_its_normal_force_ends_the_run_in_every_form(form):
    machine = Lifted(Coulomb(0.5), lambda t: 2.0)
    forms = {
        "itself": lambda: (machine, machine.state()),
        "regularised": lambda: (machine.regularised(1e-2), machine.regularised(1e-2).state()),
        "bristles": lambda: (
            machine.bristles(LuGre, sigma_0=1e2, sigma_1=10.0),
            machine.bristles(LuGre, sigma_0=1e2).start(machine.state()),
        ),
    }
    system, start = forms[form]()
    end = ss.simulate(system, 0.0, 4.0, start, throw=False)
    assert end.result == ss.RESULTS.no_admissible_mode
    assert float(end.t1) == pytest.approx(2.0, abs=1e-9)
    with pytest.raises(ValueError, match="the normal force of contact 'ground' at the start"):
        ss.simulate(system, 2.5, 4.0, start)
