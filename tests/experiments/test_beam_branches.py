"""The beam's branches of periodic orbits: the bounce, their judgement, the command against SciPy."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import stickslip as ss
from experiments._experiment import chosen, load
from experiments.beam._branches import as_table, followed
from experiments.beam._judge_branches import judge_branches
from experiments.beam._model import VARIANTS, accurate, system_of
from experiments.beam._pressed import PressedBeamState, pressed
from stickslip.systems import JointedBeamState

END = 2.4672137604e-3  # of stick, and where a mode of the beam leaves the circle: SciPy, below
LEAVES = 2.4075701077e-3
MASS, JOINT, SPRING, CONTACT, MU, GAMMA, PLACE, DEPTH = 0.1, 0.25, 7.6, 22.8, 0.3, 10.0, 0.4, 9.2e-4


def test_bounce_solves_its_equation():
    system = pressed(system_of("consistent", 1e-3, 2))
    period = float(system.period())
    assert period == pytest.approx(
        np.pi * np.sqrt(0.1) * (1 / np.sqrt(30.4) + 1 / np.sqrt(7.6)), rel=1e-14
    )
    t = jnp.linspace(-0.7, 1.3, 40)
    rate = jax.grad(system.x)
    x, v, a = (jax.vmap(f)(t) for f in (system.x, rate, jax.grad(rate)))
    assert bool(jnp.any(x > 0)) and bool(jnp.any(x < 0))  # noqa: PT018
    force = SPRING * x + CONTACT * jnp.maximum(x, 0.0)
    np.testing.assert_allclose(MASS * a, -force, atol=1e-14)
    energy = 0.5 * (MASS * v**2 + SPRING * x**2 + CONTACT * jnp.maximum(x, 0.0) ** 2)
    np.testing.assert_allclose(energy, 0.5 * (SPRING + CONTACT) * DEPTH**2, rtol=1e-12)
    assert float(system.x(0.0)) == pytest.approx(DEPTH, rel=1e-14)
    np.testing.assert_allclose(jax.vmap(system.x)(t + period), x, atol=1e-15)


def whole(system, t, y):
    """The state of the beam that belongs to a state of the forced one."""
    return JointedBeamState(system.x(t), jax.grad(system.x)(t), y.y, y.vy, y.q, y.p)


@pytest.mark.parametrize("variant", VARIANTS)
def test_field_and_guards_are_those_of_the_beam(variant):
    beam = system_of(variant, 1e-3, 2, damping=0.01)
    system = pressed(beam)
    y = PressedBeamState(2e-3, 3e-4, jnp.array([1e-5, -2e-6]), jnp.array([3e-5, 1e-4]))
    for t, modes in ((0.03, (0, 1, 2)), (0.25, (3,))):
        full = whole(system, t, y)
        for mode in modes:
            slope = beam.vector_field(t, full, mode, None)
            found = system.vector_field(t, y, mode, None)
            for name in PressedBeamState._fields:
                np.testing.assert_allclose(getattr(found, name), getattr(slope, name), rtol=1e-13)
            one, two = (s.guards(t, z, mode, None) for s, z in ((system, y), (beam, full)))
            sides = two[:2] if mode == 1 else two[:1]
            assert float(one[0]) == pytest.approx(float(min(sides)), rel=1e-12)
            assert float(one[-1]) == pytest.approx(float(two[-1]), rel=1e-12)


@pytest.mark.slow
def test_motion_is_that_of_the_beam():
    beam = system_of("consistent", 3e-3, 2)
    system = pressed(beam)
    one = ss.simulate(
        system, 0.0, 10.0, system.start(), integrator=accurate(), saveat=ss.SaveAt(max_events=None)
    )
    two = ss.simulate(
        beam, 0.0, 10.0, beam.start(), integrator=accurate(), saveat=ss.SaveAt(max_events=None)
    )
    for name, size in (("y", 1e-3), ("vy", 1e-3), ("q", 1e-5), ("p", 1e-4)):
        a, b = np.asarray(getattr(one.y1, name)), np.asarray(getattr(two.y1, name))
        np.testing.assert_allclose(a, b, atol=1e-5 * size)


def made_up(**faults):
    """A branch that ends its stick at 2.5e-3 and slips stably beyond, unless a fault is planted."""
    v = faults.get("v", np.linspace(1e-4, 3e-2, 299))
    stick = np.where(v < 2.5e-3, 0.1, 0.0)
    size = np.stack([np.where(stick > 0, 0.5, 0.9), np.where(stick > 0, 0.0, 0.9)], axis=1)
    size = faults.get("size", lambda v, size: size)(v, size)
    turn = np.where(stick[:, None] > 0, 0.0, 0.25) * np.ones(2)
    marks = faults.get("marks", [(2.5e-3, "GR", "grazing-sliding, 4 events, 2 beyond")])
    ends = [(v.min(), "EP", "bounds"), (v.max(), "EP", "bounds")]
    at, label, words = zip(*marks, *ends, strict=True)
    count = len(at)
    return xr.Dataset(
        {
            "orbit_variant": ("orbit", ["consistent"] * v.size),
            "orbit_damping": ("orbit", np.zeros(v.size)),
            "orbit_v": ("orbit", v),
            "orbit_stick": ("orbit", stick),
            "orbit_size": (("orbit", "multiplier"), size),
            "orbit_turn": (("orbit", "multiplier"), turn),
            "special_variant": ("special", ["consistent"] * count),
            "special_damping": ("special", np.zeros(count)),
            "special_v": ("special", np.array(at)),
            "special_label": ("special", list(label)),
            "special_words": ("special", list(words)),
            "special_size": (("special", "multiplier"), np.tile([0.5, 0.0], (count, 1))),
            "special_turn": (("special", "multiplier"), np.zeros((count, 2))),
        },
        {"variant": ["consistent"]},
        {"damping": 0.0},
    )


def verdicts(data):
    return {s.id: s.holds for s in judge_branches(data)}


GRAZES = (2.5e-3, "GR", "grazing-sliding, 4 events, 2 beyond")


def test_branches_are_judged():
    assert verdicts(made_up()) == {"C3b": True, "C4c": False, "C5b": True}
    text = judge_branches(made_up())[0].measured
    assert "v = 0.002500000 (grazing-sliding)" in text
    assert "0.500 and 0 before" in text
    assert "0.9000 and frequency 0.2500" in text
    doubled = made_up(marks=[GRAZES, (4e-3, "PD", "")])
    assert verdicts(doubled)["C4c"] is True
    assert verdicts(made_up(marks=[GRAZES, (2e-2, "PD", "")]))["C4c"] is False
    # One orbit that repels is enough; one on the circle, to rounding, does not.
    repels = made_up(size=lambda v, size: np.where(v[:, None] > 0.029, 1.001, size))
    assert verdicts(repels) == {"C3b": True, "C4c": False, "C5b": False}
    neutral = made_up(size=lambda v, size: np.where(v[:, None] > 0.029, 1.0 + 1e-11, size))
    assert verdicts(neutral)["C5b"] is True


def test_modes_of_the_beam_that_grow_are_told():
    weak = made_up(
        marks=[(2.4e-3, "NS", ""), GRAZES],
        size=lambda v, size: np.where((v > 2.4e-3) & (v < 2.5e-3), 1.0 + 3e-6, 0.9)[:, None] + 0 * size,
    )
    assert "leaves the unit circle at v = 0.002400000, by 3.0e-06" in judge_branches(weak)[0].measured


def test_branches_that_do_not_tell():
    short = made_up(v=np.linspace(1e-4, 2e-3, 60), marks=[])
    assert verdicts(short) == {"C3b": None, "C4c": None, "C5b": None}
    assert verdicts(made_up(marks=[]))["C3b"] is None
    twice = made_up(marks=[GRAZES, (4e-3, "GR", "grazing-sliding")])
    assert verdicts(twice)["C3b"] is None
    elsewhere = made_up(marks=[(4e-3, "GR", "grazing-sliding")])  # orbits between slip already
    assert verdicts(elsewhere)["C3b"] is None


class Shooting:
    """Orbits of Eqs. (2.10) to (2.16) with four modes, written here by themselves, and monodromy."""

    def __init__(self, tolerance, modes=4):
        self.tolerance, self.n = tolerance, modes
        i = np.arange(1, modes + 1)
        self.shapes = np.sqrt(2.0) * np.sin(i * np.pi * PLACE)
        self.size = size = 2 + 2 * modes
        self.touching, free = np.sqrt((SPRING + CONTACT) / MASS), np.sqrt(SPRING / MASS)
        self.leaves, self.flight = 0.5 * np.pi / self.touching, np.pi / free
        self.period = 2.0 * self.leaves + self.flight
        self.free = free = np.zeros((size, size))  # rows y, y', q, q'
        free[0, 1], free[1, 0], free[1, 2 : 2 + modes] = 1.0, -JOINT / MASS, JOINT / MASS * self.shapes
        free[2 : 2 + modes, 2 + modes :] = np.eye(modes)
        free[2 + modes :, 0] = JOINT * self.shapes
        free[2 + modes :, 2 : 2 + modes] = -np.diag((i * np.pi) ** 4) - JOINT * np.outer(
            self.shapes, self.shapes
        )
        self.held = free.copy()
        self.held[1] = 0.0

    def normal(self, t):
        return CONTACT * DEPTH * np.cos(self.touching * t)

    def slope(self, t, z, v, kind):
        y, deviations = z[: self.size], z[self.size :].reshape(self.size, self.size)
        matrix = (self.held if kind == "stick" else self.free).copy()
        rate = matrix @ y
        if kind == "slip":  # backward: it lags behind the belt
            low = 1.0 + GAMMA * abs(y[1] - v)
            rate[1] += MU * self.normal(t) / low / MASS
            matrix[1, 1] += MU * self.normal(t) * GAMMA / low**2 / MASS
        return np.concatenate([rate, (matrix @ deviations).ravel()])

    def run(self, begin, end, z, v, kind, event=None):
        if event is not None:
            event.terminal = kind == "stick" or event.direction == 1.0
        found = solve_ivp(
            self.slope, (begin, end), z, "DOP853", args=(v, kind), events=event, max_step=0.02,
            rtol=self.tolerance, atol=1e-6 * self.tolerance,
        )  # fmt: skip
        hit = event is not None and found.t_events[0].size
        return (found.t_events[0][-1], found.y_events[0][-1]) if hit else (end, found.y[:, -1])

    def once_round(self, y, v, sticks):
        """State after a period from touch-down, monodromy; the stick, or the greatest sliding speed."""
        z, t, left = np.concatenate([y, np.eye(self.size).ravel()]), -self.leaves, self.leaves

        def lag(t, z, *_):
            return z[1] - v

        def reserve(t, z, *_):
            return MU * self.normal(t) - JOINT * abs(z[0] - self.shapes @ z[2 : 2 + self.n])

        def turns(t, z, *_):  # the speed is greatest
            return self.slope(t, z, v, "slip")[1]

        if sticks:
            lag.direction, reserve.direction = 1.0, -1.0
            begin, z = self.run(t, left, z, v, "slip", lag)
            z[1], deviations = v, z[self.size :].reshape(self.size, self.size)
            deviations[1] = 0.0  # what the belt takes away
            t, z = self.run(begin, left, z, v, "stick", reserve)
            told = t - begin
            z = self.run(t, left, z, v, "slip")[1]
        else:
            turns.direction = -1.0
            told = self.run(t, left, z, v, "slip", turns)[1][1] - v
            z = self.run(t, left, z, v, "slip")[1]
        z = self.run(left, left + self.flight, z, v, "free")[1]
        return z[: self.size], z[self.size :].reshape(self.size, self.size), told

    def orbit(self, y, v, sticks):
        for _ in range(12):
            end, monodromy, told = self.once_round(y, v, sticks)
            move = np.linalg.solve(np.eye(self.size) - monodromy, end - y)
            y = y + move
            if np.abs(move).max() < 1e-13:
                break
        return y, monodromy, told

    def end_of_stick(self):
        """Speed at which the orbit that slips touches the speed of the belt."""
        y = np.append(5.2e-3, np.zeros(self.size - 1))
        return brentq(lambda v: self.orbit(y, v, False)[2], 2.4e-3, 2.6e-3, xtol=1e-15, rtol=1e-12)

    def leaving(self, turn):
        """Speed at which the pair with this angle is on the unit circle, of the orbit that sticks."""
        y = np.append(5.2e-3, np.zeros(self.size - 1))

        def outside(v):
            found = np.linalg.eigvals(self.orbit(y, v, True)[1])
            return abs(found[np.argmin(np.abs(np.angle(found) - turn))]) - 1.0

        return brentq(outside, 2.35e-3, 2.45e-3, xtol=1e-14, rtol=1e-11)


@pytest.mark.slow
def test_the_end_of_stick_is_that_of_shooting_with_scipy():
    parameters = chosen(load()["beam-branches"], False, []) | {
        "follow_from": 2.3e-3, "follow_min": 2.3e-3, "follow_max": 2.6e-3, "step": 3.0,
    }  # fmt: skip
    branch = followed("consistent", 0.0, parameters)
    (border,) = branch["GR"]
    torus = max(branch["NS"], key=lambda point: point.value)
    assert border.words.startswith("grazing-sliding")
    assert [e.words for e in branch["EP"]] == ["bounds", "bounds"]
    coarse, fine = Shooting(1e-10), Shooting(1e-12)
    end = fine.end_of_stick()
    assert coarse.end_of_stick() == pytest.approx(end, abs=1e-13)
    assert end == pytest.approx(END, abs=1e-12)
    assert border.value == pytest.approx(end, abs=3e-11)
    leaves = fine.leaving(float(np.abs(np.angle(torus.orbit.multipliers[0]))))
    assert coarse.leaving(0.935) == pytest.approx(leaves, abs=1e-10)
    assert leaves == pytest.approx(LEAVES, abs=1e-12)
    assert torus.value == pytest.approx(leaves, abs=1e-10)
    # A point between the last orbit and a bound's other side is none of the branch.
    before = followed("consistent", 0.0, parameters | {"follow_max": LEAVES - 1e-8})
    assert max(e.value for e in before.specials) == pytest.approx(LEAVES - 1e-8, abs=1e-15)
    # Beyond it the orbit that slips repels: its pairs are those of SciPy, the beam's too.
    table = as_table([("consistent", 0.0, branch)]).sortby("orbit_v")
    first = table.isel(orbit=int(np.flatnonzero(table.orbit_v > border.value)[0]))
    assert float(first.orbit_stick) == 0.0
    y = np.append(5.2e-3, np.zeros(fine.size - 1))
    wanted = np.abs(np.linalg.eigvals(fine.orbit(y, float(first.orbit_v), False)[1]))
    np.testing.assert_allclose(first.orbit_size, np.sort(wanted)[::-1], atol=1e-9)
    assert float(first.orbit_size[0]) > 1.03
    assert float(first.orbit_turn[0]) == pytest.approx(0.2509, abs=1e-4)
