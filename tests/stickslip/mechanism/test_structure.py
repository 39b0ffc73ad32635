"""Structure is what a declaration says for all numbers and `args`, not for those it is asked with.

Every function here vanishes, is constant or symmetric where it might be tried: at 0, at 1, for equal
masses, without `args`.
"""

import functools
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.friction import Coulomb
from stickslip.mechanism import AbstractMechanism, Contact, Stop
from stickslip.mechanism._abstract import traced_with
from stickslip.mechanism._analysis import inertia_forms
from stickslip.mechanism._any_args import Looked, Sealed


class Pair(AbstractMechanism):
    """Two coordinates that only inertia couples, under a spring each."""

    entry: Any = eqx.field(static=True)  # a function of the machine and `q`
    a: Any = 1.0
    b: Any = 1.0
    none: Any = 0.0
    whole: Any = 0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {}

    def mass_matrix(self, q):
        c = self.entry(self, q)
        return [[2.0 * self.a, c], [c, 2.0 * self.b]]

    def forces(self, t, q, v, args):
        return {"x": -2.0 * q.x, "y": -q.y}


ENTRIES = {
    "0 at 0": lambda m, q: 0.5 * q.y,
    "0 at 1": lambda m, q: 0.5 * (q.x - 1.0),
    "0 on both axes": lambda m, q: 0.5 * q.x * q.y,
    "0 at and above 0": lambda m, q: jnp.where(q.x >= 0.0, 0.0, 0.5),
    "0 at 0 of a sine": lambda m, q: 0.5 * jnp.sin(q.y),
    "equal masses": lambda m, q: m.a - m.b,
    "a parameter that is 0": lambda m, q: m.none,
    "a whole parameter that is 0": lambda m, q: m.whole,
    "equal places": lambda m, q: 0.5 * (q.x - q.y),
    "0 whatever the place": lambda m, q: 0.0 * q.y,
    "a difference that is 0": lambda m, q: q.y - q.y,
    "an array": lambda m, q: np.zeros(()),
}


def test_what_couples_velocities_anywhere_couples_them():
    machines = [Pair(entry) for entry in ENTRIES.values()]
    for name, machine in zip(ENTRIES, machines, strict=True):
        assert [group.columns for group in machine.structure.groups] == [(0, 1)], name
    for constant in (0.0, 0, np.float64(0.0), -0.0):
        machine = Pair(lambda m, q, constant=constant: constant)
        assert [group.columns for group in machine.structure.groups] == [(0,), (1,)]

    # At other parameters than those the structure was read at, here and there.
    moved = [
        eqx.tree_at(lambda m: (m.b, m.none), m, (jnp.float64(1.5), jnp.float64(0.3))) for m in machines
    ]
    places = np.array([[0.3, 0.8], [-0.4, -0.7], [0.0, 0.0], [1.0, 1.0], [-0.6, 0.2]])

    @jax.jit
    @jax.vmap
    def accelerations(place):
        y = machines[0].state()._replace(x=place[0], y=place[1])
        slopes = [m.vector_field(0.0, y, jnp.int32(0), None) for m in moved]
        return jnp.stack([jnp.stack([dy.v_x, dy.v_y]) for dy in slopes])

    found = accelerations(places)
    for k, (x, y) in enumerate(places):
        q = machines[0].state()._replace(x=x, y=y)
        for machine, row in zip(moved, found[k], strict=True):
            c = float(machine.entry(machine, q))
            expected = np.linalg.solve([[2.0, c], [c, 3.0]], [-2.0 * x, -y])
            np.testing.assert_allclose(row, expected, rtol=1e-13, atol=1e-15)


def test_numbers_of_python_are_states_too():
    """Without a program: the state (0, 0) of whole numbers has the structure of any other."""
    machine = Pair(ENTRIES["0 at 0"])
    at = machine.instant(0, machine.state()._replace(x=0, y=0), None)
    assert at.mass.full is not None
    assert all(isinstance(x, jax.Array) for x in (*at.q, *at.v))


@pytest.mark.slow
def test_coupled_motion_against_scipy():
    machine = Pair(ENTRIES["0 at 0"])
    run = ss.simulate(machine, 0.0, 3.0, machine.state(x=0.3, y=0.8))

    def rate(t, z):
        c = 0.5 * z[1]
        return [*z[2:], *np.linalg.solve([[2.0, c], [c, 2.0]], [-2.0 * z[0], -z[1]])]

    true = solve_ivp(rate, (0, 3), [0.3, 0.8, 0, 0], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    np.testing.assert_allclose(run.y1, true, rtol=1e-9)


class Wagons(AbstractMechanism):
    """Two wagons in relative coordinates; `joint` is inertia of both."""

    numbers: Any
    joint: Any = eqx.field(static=True)
    coordinates: ClassVar = {"x": "m", "gap": "m"}
    contact_directions: ClassVar = {"first": (1, 0), "second": (1, 1)}

    def mass_matrix(self, q):
        a, b, c = self.numbers
        both = self.joint(a, b, c, q)
        return ((a + b + 2.0 * both, b + both), (b + both, b))

    def forces(self, t, q, v, args):
        return (2.0, 1.0)

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(1.0, 0.5))] * 2


@pytest.mark.parametrize(
    ("shared", "separate"),
    [
        (lambda a, b, c, q: 0.0, True),
        (lambda a, b, c, q: 0.0 * c, True),
        (lambda a, b, c, q: q.x - q.x, True),
        (lambda a, b, c, q: c, False),
        (lambda a, b, c, q: a - b, False),
        (lambda a, b, c, q: q.x, False),
        (lambda a, b, c, q: 1e-15 * c, False),  # of parameters that may be 1e15
        (lambda a, b, c, q: 0.5 * (1.0 - c), False),
        (lambda a, b, c, q: c * (1.0 - c), False),
        (lambda a, b, c, q: jnp.where(q.x > 5.0, 1.0, 0.0), False),
        (lambda a, b, c, q: jnp.maximum(q.x - 5.0, 0.0), False),
    ],
)
def test_inertia_that_vanishes_for_some_numbers_parts_nothing(shared, separate):
    (of,) = Wagons((1.0, 1.0, 0.0), shared).structure.groups
    assert of.separate is separate


def test_forms_of_inertia_are_exact():
    """One matrix of what is constant, one for each number: a proof, whatever the numbers are."""
    machine = Wagons((30.0, 40.0, 5.0), lambda a, b, c, q: 2.0**-60 * c + 7.0 + (a - a))
    parts = traced_with(inertia_forms, machine)
    small = 2.0**-60
    expected = [
        [[14.0, 7.0], [7.0, 0.0]],
        [[1.0, 0.0], [0.0, 0.0]],
        [[1.0, 1.0], [1.0, 1.0]],
        [[2.0 * small, small], [small, 0.0]],
    ]
    np.testing.assert_array_equal(parts, expected)


class Block(AbstractMechanism):
    """A block of 1 kg on a floor; whatever is declared, by functions of time, state and `args`."""

    load: Any = eqx.field(static=True, default=lambda t, q, v, args: 1.0)
    speed: Any = eqx.field(static=True, default=lambda t, q, v, args: 0.0)
    gap: Any = eqx.field(static=True, default=None)
    push: Any = eqx.field(static=True, default=lambda t, q, v, args: 0.0)
    weight: Any = 1.0
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {"floor": {"x": 1.0}}

    @property
    def stops(self):
        return ("wall",) if self.gap else ()

    def mass_matrix(self, q):
        return 1.0

    def forces(self, t, q, v, args):
        return {"x": self.push(t, q, v, args)}

    def contacts(self, t, q, v, args):
        given = t, q, v, args
        return {"floor": Contact(Coulomb(1.0, 0.5), self.load(*given), self.speed(*given))}

    def gaps(self, t, q, args):
        return {"wall": Stop(self.gap(t, q, args), 0.5)}


def tried(read, default, kinds):
    try:
        return read()
    except kinds:
        return default


@functools.cache
def kept(args):
    return 5.0


def matched(args):
    match args:
        case {"N": load}:
            return load
        case [load, *_]:
            return load
    return 5.0


@jax.tree_util.Partial
def ignores(args, number):
    return number


# A value that is 5 without `args`, and may be anything with them.
READS = {
    "None or not": lambda args, t: 5.0 if args is None else 0.8 + jnp.sin(args * t),
    "None or not, not read": lambda args, t: 5.0 if args is None else 0.8 + jnp.sin(t),
    "get": lambda args, t: (args or {}).get("N", 5.0) * 1.0,
    "a key or a default": lambda args, t: tried(lambda: args["N"](t), 5.0, (KeyError, TypeError)),
    "whatever fails": lambda args, t: tried(lambda: args.load * t, 5.0, Exception),
    "whatever fails at all": lambda args, t: tried(lambda: args[0] * t, 5.0, BaseException),
    "getattr": lambda args, t: getattr(args, "N", 5.0),
    "hasattr": lambda args, t: args.N(t) if hasattr(args, "N") else 5.0,
    "isinstance": lambda args, t: args["N"] * t if isinstance(args, dict) else 5.0,
    "a number": lambda args, t: tried(lambda: float(args) * t, 5.0, TypeError),
    "arithmetic": lambda args, t: tried(lambda: 1.0 + args * t, 5.0, TypeError),
    "an array": lambda args, t: tried(lambda: jnp.sum(jnp.asarray(args)) * t, 5.0, Exception),
    "a call": lambda args, t: args(t) if callable(args) else tried(lambda: args(t), 5.0, TypeError),
    "length": lambda args, t: tried(lambda: len(args) * t, 5.0, TypeError),
    "truth": lambda args, t: t if args else 5.0,
    "equality": lambda args, t: 5.0 if args == None else t,  # noqa: E711
    "leaves": lambda args, t: sum((t * x for x in jax.tree.leaves(args)), 5.0),
    "a pattern": lambda args, t: matched(args),
    "kept": lambda args, t: kept(args),
    "text": lambda args, t: t if str(args) == "on" else 5.0,
    "unpacked": lambda args, t: tried(lambda: next(iter(args)), 5.0, TypeError),
    "named": lambda args, t: tried(lambda: dict(**args)["N"], 5.0, TypeError),
}


@pytest.mark.parametrize("read", READS.values(), ids=READS)
def test_what_args_may_change_is_not_constant(read):
    """A normal force and a gap that have a default when there are no `args`."""
    block = Block(load=lambda t, q, v, args: read(args, t))
    assert block.structure.lifting == (0,)
    slopes = Block(gap=lambda t, q, args: q.x - read(args, t)).structure.slopes
    assert np.isnan(slopes[0, -1])


VARYING = {
    "a ramp": lambda t, q, v: t,
    "0 at 0": lambda t, q, v: 1.0 + jnp.sin(t),
    "0 at 0 and 1": lambda t, q, v: 1.0 + t * (t - 1.0),
    "a step": lambda t, q, v: jnp.where(t > 5.0, 1.0, 2.0),
    "flat at 0": lambda t, q, v: 1.0 + q.x**4,
    "0 for q of v": lambda t, q, v: 1.0 + q.x * v.x,
    "a bend": lambda t, q, v: 1.0 + jnp.maximum(q.x - 3.0, 0.0),
    "0 and yet": lambda t, q, v: 1.0 + 0.0 * q.x,
    "a choice": lambda t, q, v: jax.lax.cond(v.x > 2.0, lambda: 2.0, lambda: 1.0),
    "a loop": lambda t, q, v: jax.lax.fori_loop(0, 3, lambda i, n: n * 0.5 + t, 1.0),
}


@pytest.mark.parametrize("load", VARYING.values(), ids=VARYING)
def test_what_varies_somewhere_is_not_constant(load):
    assert Block(load=lambda t, q, v, args: load(t, q, v)).structure.lifting == (0,)


def test_a_force_with_a_default_is_not_known_to_be_affine():
    assert (
        Block(push=lambda t, q, v, args: -q.x if args is None else -(q.x**3)).two_sided_contacts == ()
    )
    assert (
        Block(push=lambda t, q, v, args: -q.x * (1.0 if args is None else args)).two_sided_contacts
        == ()
    )
    assert Block(push=lambda t, q, v, args: -q.x).two_sided_contacts == (0,)


def test_what_is_not_looked_at_stays_what_it_is():
    """`args` that go through a declaration without being read change nothing."""
    block = Block(
        load=lambda t, q, v, args: ignores(args, 2.0) * 3.0,
        speed=lambda t, q, v, args: ignores(args, 0.0),
        push=lambda t, q, v, args: ignores(args, t),
    )
    assert block.structure.lifting == ()
    assert block.two_sided_contacts == (0,)
    walled = Block(gap=lambda t, q, args: 1.0 - q.x + 0.5 * ignores(args, t))
    np.testing.assert_array_equal(walled.structure.slopes, [[-1.0, 0.5]])
    assert Block(load=lambda t, q, v, args: jnp.sqrt(2.0)).structure.lifting == ()


@pytest.mark.parametrize(
    ("gap", "slopes"),
    [
        (lambda t, q, args: 1.0 + q.x * t, (np.nan, np.nan)),
        (lambda t, q, args: 1.0 + q.x**3, (np.nan, 0.0)),
        (lambda t, q, args: jnp.where(q.x > 1.0, q.x, 2.0 * q.x - 1.0), (np.nan, 0.0)),
        (lambda t, q, args: jnp.sin(q.x) + t, (np.nan, 1.0)),
        (lambda t, q, args: 1.0 - q.x if args is None else 1.0 + q.x, (np.nan, 0.0)),
        (lambda t, q, args: 1.0 - q.x if args is None else 1.0 - q.x - 0.1 * t, (-1.0, np.nan)),
    ],
)
def test_slopes_of_gaps(gap, slopes):
    np.testing.assert_array_equal(Block(gap=gap).structure.slopes, [slopes])


def test_which_surfaces_move_is_asked_with_the_args_of_the_run():
    block = Block(speed=lambda t, q, v, args: 0.0 if args is None else jnp.sin(args * t))
    y, names = block.state(v_x=1.0), {"forces", "friction of floor"}
    assert set(jax.eval_shape(lambda: block.powers(0.0, y, 2, None))) == names
    more = {*names, "drive of floor"}
    assert set(jax.eval_shape(lambda: block.powers(0.0, y, 2, 3.0))) == more
    assert set(jax.eval_shape(lambda a: block.powers(0.0, y, 2, a), 3.0)) == more


def test_a_load_with_a_default_ends_the_run_where_it_vanishes():
    block = Block(load=lambda t, q, v, args: 1.0 if args is None else 0.8 + jnp.sin(args * t))
    run = ss.simulate(block, 0.0, 6.0, block.state(v_x=5.0), args=1.0, throw=False)
    assert run.result == ss.RESULTS.no_admissible_mode
    np.testing.assert_allclose(run.t1, np.pi + np.arcsin(0.8), rtol=1e-12)


def test_what_only_the_kind_of_args_says_is_refused_by_name():
    def load(t, q, v, args):
        return args["N"] + t if type(args) is dict else 5.0

    block = Block(load=load)
    with pytest.raises(ss.mechanism.DeclarationError, match="normal force of contact 'floor'"):
        ss.simulate(block, 0.0, 1.0, block.state(), args={"N": 1.0})
    walled = Block(gap=lambda t, q, args: 1.0 - q.x + (t if type(args) is dict else 0.0))
    with pytest.raises(ss.mechanism.DeclarationError, match="slope of the gap of stop 'wall'"):
        ss.simulate(walled, 0.0, 1.0, walled.state(), args={"N": 1.0})


USES = {
    "attribute": lambda a: a.x, "item": lambda a: a[0], "iteration": lambda a: list(a),
    "truth": lambda a: bool(a), "call": lambda a: a(), "comparison": lambda a: a < 1,
    "addition": lambda a: 1 + a, "power": lambda a: a**2, "product": lambda a: jnp.ones(2) * a,
    "array": lambda a: np.asarray(a), "sine": lambda a: jnp.sin(a), "set": lambda a: {a},
    "kind": lambda a: isinstance(a, dict), "leaves": lambda a: jax.tree.map(lambda x: x + 1, a),
    "member": lambda a: 1 in a, "text": lambda a: f"{a}", "format": repr, "names": dir,
    "names and values": vars, "jit": lambda a: jax.jit(lambda x: 1.0)(a),
}  # fmt: skip


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_every_use_of_sealed_args_is_seen(use):
    sealed = Sealed()
    with pytest.raises(Looked):
        use(sealed)
    assert object.__getattribute__(sealed, "looked")


class Rubbing(AbstractMechanism):
    """A mass in the plane with two contacts, whose directions `rows` gives."""

    rows: Any = eqx.field(static=True)
    r: Any = 1.0
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"pad": None, "other pad": None}

    def mass_matrix(self, q):
        return {"x": 1.0, "y": 2.0}

    def forces(self, t, q, v, args):
        return {}

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(0.5, 0.4), direction=row) for row in self.rows(self.r, q)]


@pytest.mark.parametrize(
    ("rows", "fine"),
    [
        (lambda r, q: [{"x": r, "y": 0.3 * r}] * 2, False),
        (lambda r, q: [(r, 1.0), (-2.0 * r, -2.0)], False),
        (lambda r, q: [(jnp.sum(jnp.stack([q.x, r])), q.y), (3.0 * (q.x + r), 3.0 * q.y)], False),
        (lambda r, q: [(jnp.cos(q.y), jnp.sin(q.y)), (r, 0.0)], True),
        (lambda r, q: [(r, q.x), (r, q.y)], True),
    ],
)
def test_directions_that_are_always_equal_are_not_in_general_position(rows, fine):
    """Their friction would be that of a singular matrix, in some runs without a failure."""
    if fine:
        assert Rubbing(rows).structure.groups[0].rows == (0, 1)
    else:
        with pytest.raises(ValueError, match=r"'pad, other pad'.*constant where they depend"):
            Rubbing(rows)


class Tuned(Rubbing):
    """With friction from `args`, without which nothing is known of the directions."""

    def contacts(self, t, q, v, args):
        return [Contact(Coulomb(args), direction=row) for row in self.rows(self.r, q)]


@pytest.mark.more
def test_directions_unknown_without_args_are_judged_when_a_run_brings_them():
    """A start at rest had no multipliers of friction (NaN), and ended at its first instant."""
    tuned = Tuned(lambda r, q: [{"x": r}, {"x": -2.0 * r}])
    with pytest.raises(ValueError, match=r"'pad, other pad'.*constant where they depend"):
        ss.simulate(tuned, 0.0, 1.0, tuned.state(), args=0.5)
    other = Tuned(lambda r, q: [{"x": r}, {"y": -2.0 * r}])
    assert float(ss.simulate(other, 0.0, 1.0, other.state(), args=0.5).y1.x) == 0.0


def test_a_direction_is_given_once():
    class Twice(Block):
        def contacts(self, t, q, v, args):
            return {"floor": Contact(Coulomb(1.0), direction={"x": 2.0})}

    block = Twice()
    with pytest.raises(ValueError, match=r"\['floor'\]\.direction.*left out"):
        block.initial_mode(0.0, block.state(v_x=1.0), None)
