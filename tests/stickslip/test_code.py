"""The key of the code behind a pytree: it changes with what a function would compute, and else not."""

import dataclasses
import functools
import types
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip._code import code_key
from stickslip._one_function import first_alike
from stickslip.friction import Coulomb
from stickslip.hybrid import jit_by_code
from stickslip.mechanism import AbstractMechanism, Contact
from stickslip.systems import Motion

CELL = """
import functools
K = 1.0
UNUSED = 1.0
TABLE = np.array([1.0, 2.0])
SETTINGS = {"gain": [1.0, 2.0]}
held = types.SimpleNamespace(gain=1.0)

def helper(x):
    return K * x

def deeper(x, power=2):
    return helper(x) ** power

jitted = jax.jit(helper)

@functools.lru_cache
def kept(x):
    return helper(x)

def made(gain):
    return lambda x: gain * x

closure = made(2.0)

def by_import(x):
    import edited_module
    return edited_module.factor * x

class Base:
    rate = 1.0
    @property
    def twice(self):
        return 2.0 * helper(self.rate)

class Held(Base):
    @staticmethod
    def of(x):
        return helper(x)

def even(n):
    return n == 0 or odd(n - 1)

def odd(n):
    return n > K and even(n - 1)
"""
OTHER_HELPER = "def helper(x):\n    return K + x\n"
SAME_HELPER = "def helper(x):  # now with words\n\n    return K * x\n"


@pytest.fixture
def cell():
    """What a user has typed, to be typed again in parts."""
    module = types.ModuleType("__main__")
    module.__dict__.update(np=np, jax=jax, types=types, module=types.ModuleType("edited_module"))
    module.__dict__["module"].factor = 1.0
    exec(CELL, module.__dict__)
    return module.__dict__


@pytest.mark.more
@pytest.mark.parametrize("name", ["helper", "deeper", "jitted", "kept", "Held", "even", "odd"])
@pytest.mark.parametrize("edit", ["K = 2.0", "K = 1", OTHER_HELPER])
def test_an_edit_of_what_is_reached_changes_the_key(cell, name, edit):
    if edit is OTHER_HELPER and name in ("helper", "jitted", "kept", "even", "odd"):
        edit = "K = float('nan')"  # these are objects of their own, or do not call it
    before = code_key(cell[name])
    exec(edit, cell)
    assert code_key(cell[name]) != before
    assert code_key(cell[name]) == code_key(cell[name])


@pytest.mark.parametrize("name", ["deeper", "jitted", "Held", "even", "closure"])
@pytest.mark.parametrize("edit", ["K = 1.0", "UNUSED = 2.0", SAME_HELPER, "x = power = rate = 3.0"])
def test_what_computes_the_same_keeps_the_key(cell, name, edit):
    before = code_key(cell[name])
    exec(edit, cell)
    assert code_key(cell[name]) == before


@pytest.mark.parametrize(
    ("read", "edit"),
    [
        ("TABLE.sum()", "TABLE[0] = 3.0"),
        ("SETTINGS['gain'][1]", "SETTINGS['gain'][1] = 3.0"),
        ("SETTINGS['gain'][-1]", "SETTINGS['gain'].append(3.0)"),
        ("held.gain", "held.gain = 3.0"),
        ("closure(x)", "closure = made(3.0)"),
        ("closure(x)", "closure.__closure__[0].cell_contents = 3.0"),
        ("deeper(x)", "deeper.__code__ = helper.__code__"),
        ("deeper(x)", "def deeper(x, power=3):\n    return helper(x) ** power"),
        ("Held().twice", "Held.rate = 3.0"),
        ("Held().twice", "Base.twice = property(lambda self: 3.0)"),
        ("Held().more", "Held.more = 3.0"),
        ("module.factor", "module.factor = 3.0"),
        ("abs(x)", "def abs(x):\n    return x"),
        ("[K for _ in range(3)][0]", "K = 3.0"),
        ("(lambda: helper(x))()", OTHER_HELPER),
        ("sorted({1.0, 2.0, K})", "K = 3.0"),
    ],
)
def test_what_a_function_reads_is_looked_at_again(cell, read, edit, monkeypatch):
    # To drop all programs of a worker takes it seconds.
    monkeypatch.setattr(jax, "clear_caches", lambda: None)
    exec(f"def function(x):\n    return {read}", cell)
    before = code_key(cell["function"])
    assert code_key(cell["function"]) == before
    exec(edit, cell)
    assert code_key(cell["function"]) != before


def test_a_module_that_is_imported_within_a_function_is_read(cell, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "edited_module", cell["module"])
    before = code_key(cell["by_import"])
    cell["module"].factor = 3.0
    assert code_key(cell["by_import"]) != before


@dataclasses.dataclass(frozen=True)
class Settings:
    gain: float = 1.0


class Spring(ss.AbstractSmoothSystem):
    """x'' = -x."""

    def vector_field(self, t, y, mode, args):
        return Motion(y.v, -y.x)


class Point(NamedTuple):
    x: Any


def test_operands_and_libraries_have_no_key():
    block = ss.AdaptiveStep(1e-3)
    assert code_key(block, 1.0, np.ones(3), {"x": jnp.ones(2)}, [None, "word"]) == ""
    assert code_key(jnp.sin, functools.partial(jnp.add, 1.0), jax.jit(jnp.cos)) == ""
    assert code_key(Point(1.0)) == code_key(Point(np.zeros(4))) != ""
    assert code_key(Settings(1.0)) == code_key(Settings(2.0))  # a number of a pytree is an operand


def test_what_cannot_be_read_is_said_once(cell):
    cell.update(form=jax.tree.structure((1, 2)), kind=np.dtype(float))
    exec("def function(x):\n    return form, kind", cell)
    before = code_key(cell["function"])  # these are known by what they hold
    cell["form"] = jax.tree.structure((1, (2, 3)))
    assert code_key(cell["function"]) != before
    cell["generator"] = np.random.default_rng(0)
    exec("def function(x):\n    return generator.normal()", cell)
    with pytest.warns(UserWarning, match=r"Generator holds cannot be read"):
        before = code_key(cell["function"])
    cell["generator"] = np.random.default_rng(0)
    assert code_key(cell["function"]) != before  # no warning is an error here


LOOPS = """
def push(t):
    return 1.0
def body(_, x):
    return x + push(x)
def branch(x):
    return push(x)
jitted = jax.jit(branch)
class Body(AbstractMechanism):
    mass: float
    coordinates: ClassVar = {"x": "m"}
    contact_directions: ClassVar = {}
    def mass_matrix(self, q):
        return {"x": self.mass}
    def forces(self, t, q, v, args):
        looped = jax.lax.fori_loop(0, 3, body, 0.0 * q.x)
        chosen = jax.lax.cond(t < 1e9, branch, branch, q.x)
        return {"x": push(t) + looped + chosen + jitted(q.x)}
"""


@pytest.mark.more
def test_an_edited_helper_function_of_a_mechanism_is_used(compiled):
    names = {"jax": jax, "AbstractMechanism": AbstractMechanism, "ClassVar": ClassVar}
    cell: dict[str, Any] = {**names, "__name__": "__main__"}
    exec(LOOPS, cell)

    def end():
        body = cell["Body"](1.0)
        return float(ss.simulate(body, 0.0, 2.0, body.state()).y1.x)

    assert end() == pytest.approx(12.0, rel=1e-9)  # half of a force of 6 N on 1 kg, times 2 s squared
    exec("def push(t):\n    return 3.0", cell)
    assert end() == end() == pytest.approx(36.0, rel=1e-9)
    programs = len(compiled)
    exec("def push(t):\n    return 3.0", cell)
    assert end() == pytest.approx(36.0, rel=1e-9)
    assert len(compiled) == programs


PARTS = """
coupling = 0.0
def load(t):
    return 10.0
class Sledges(AbstractMechanism):
    coordinates: ClassVar = {"x": "m", "y": "m"}
    contact_directions: ClassVar = {"floor": {"x": 1.0}}
    def mass_matrix(self, q):
        return [[1.0, coupling], [coupling, 1.0]]
    def forces(self, t, q, v, args):
        return {}
    def contacts(self, t, q, v, args):
        return {"floor": Contact(Coulomb(0.5), load(t))}
"""


def test_structure_follows_an_edit():
    """What inertia couples, whether a normal force may vanish, and what a start is checked by."""
    names = {"AbstractMechanism": AbstractMechanism, "ClassVar": ClassVar, "Contact": Contact}
    cell: dict[str, Any] = {**names, "Coulomb": Coulomb, "jnp": jnp, "__name__": "__main__"}
    exec(PARTS, cell)
    machine = cell["Sledges"]()
    machine.check_start(0.0, machine.state(), None, None)
    assert [group.columns for group in machine.structure.groups] == [(0,), (1,)]
    assert machine.structure.lifting == ()
    exec("coupling = 0.5\ndef load(t):\n    return jnp.sin(t)", cell)
    assert [group.columns for group in machine.structure.groups] == [(0, 1)]
    assert machine.structure.lifting == (0,)
    exec("def load(t):\n    return -1.0", cell)
    with pytest.raises(ValueError, match=r"normal force of contact .floor. at the start = -1"):
        machine.check_start(0.0, machine.state(), None, None)


def test_a_kept_map_and_a_kept_program_see_the_edit(cell):
    exec("def lane(x):\n    return {'y': helper(x)}", cell)
    lanes, twice = ss.map_lanes(cell["lane"]), jit_by_code(lambda f, x: 2.0 * f(x))
    x = jnp.arange(3.0)
    assert lanes(x)["y"].tolist() == [0.0, 1.0, 2.0]
    assert float(twice(cell["deeper"], 3.0)) == 18.0
    exec("K = 5.0", cell)
    assert lanes(x)["y"].tolist() == [0.0, 5.0, 10.0]
    assert float(twice(cell["deeper"], 3.0)) == 450.0


def test_constants_that_python_takes_for_equal_are_other_programs():
    """1, 1.0 and True; 0.0 and -0.0: the program of the first was used for all."""

    @jit_by_code
    def which(x, n):
        return x * (2.0 if n is True else 3.0 if isinstance(n, int) else 5.0 * np.copysign(1.0, n))

    found = [float(which(jnp.ones(()), n)) for n in (1, True, 1.0, 0.0, -0.0, 0, 1)]
    assert found == [3.0, 2.0, 5.0, 5.0, -5.0, 3.0, 3.0]


def test_an_error_of_equinox_has_its_words():
    @jit_by_code
    def root(x):
        return jnp.sqrt(eqx.error_if(x, x < 0.0, "below the table"))

    assert float(root(jnp.asarray(4.0))) == 2.0
    for _ in range(2):
        with pytest.raises(eqx.EquinoxRuntimeError, match="below the table"):
            root(jnp.asarray(-4.0))


def test_a_function_that_is_written_again_has_the_program_of_the_first():
    """As a lambda in a loop, or in a cell that is run again. One that holds something has its own."""

    def section():
        return ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "both")

    def below(level):
        return ss.Section(lambda system, t, y, dy, mode, args: y.x - level, "both")

    assert section() == section()
    assert below(0.1) != below(0.1)
    source = "def alike(x):\n    return x + {}\n"
    first, again, other, real = ({} for _ in range(4))
    namespace: dict = {}
    for found, number in ((first, "1"), (again, "1"), (other, "2"), (real, "1.0")):
        exec(source.format(number), namespace)
        found["it"] = first_alike(namespace["alike"])
    assert again["it"] is first["it"]
    assert other["it"] is not first["it"]
    assert real["it"] is not first["it"]
    elsewhere: dict = {}
    exec(source.format("1"), elsewhere)
    assert first_alike(elsewhere["alike"]) is elsewhere["alike"]


@pytest.mark.more
@pytest.mark.parametrize("where", ["function", "class"])
@pytest.mark.parametrize("outer", [jax.jit, lambda f: f], ids=["jit", "plain"])
def test_a_derivative_by_a_number_that_is_closed_over_is_refused(where, outer):
    """It would be zero, in silence: a program knows nothing of it. Its value counts all the same."""

    def end(stiffness):
        if where == "function":
            section = ss.Section(lambda system, t, y, dy, mode, args: y.x - stiffness, "falling")
            found = ss.simulate(
                Spring(), 0.0, 3.0, Motion(1.0, 0.0), saveat=ss.SaveAt(sections=section)
            )
            return found.crossings[0].t[0]

        class Stiff(Spring):
            def vector_field(self, t, y, mode, args):
                return Motion(y.v, -stiffness * y.x)

        return ss.simulate(Stiff(), 0.0, 1.0, Motion(1.0, 0.0)).y1.x

    known = jnp.arccos(0.5) if where == "function" else jnp.cos(jnp.sqrt(0.5))
    np.testing.assert_allclose(outer(end)(0.5), known, rtol=1e-9)
    for derivative in (jax.grad(outer(end)), outer(jax.grad(end)), outer(jax.jacfwd(end))):
        with pytest.raises(RuntimeError, match="closes over a number that is differentiated"):
            derivative(0.5)
