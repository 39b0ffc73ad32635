"""What is printed: numbers with units, outcomes in words, shapes where there are no numbers."""

from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax
import stickslip as ss
from stickslip import friction, systems
from stickslip.analysis import LyapunovSpectrum, amplitude_spectrum
from stickslip.identification import Fit, Record, Sensitivity, Simulation, least_squares
from stickslip.identification._unknowns import scalars
from stickslip.show import AbstractShown
from stickslip.systems import CoulombOscillator, Motion

BLOCK = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)


@jax.jit
def run(belt_speed):
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)
    saveat = ss.SaveAt(ts=jnp.linspace(0.0, 30.0, 31), max_events=8)
    start = Motion(x=0.0, v=belt_speed)
    return ss.simulate(block, 0.0, 30.0, start, saveat=saveat, throw=False)


@pytest.fixture(scope="module")
def one():
    return run(0.2)


def test_systems_and_laws():
    assert repr(BLOCK) == str(BLOCK) == (
        "CoulombOscillator(mass=1 kg, stiffness=1 N/m, static_force=1 N, kinetic_force=0.5 N, "
        "belt_speed=0.2 m/s)"
    )  # fmt: skip
    lanes = CoulombOscillator(1.0, 1.0, 1.0, 0.5, jnp.linspace(0.2, 0.4, 1001))
    assert "belt_speed=1,001 numbers from 0.2 to 0.4 m/s" in repr(lanes)
    law = friction.LuGre(friction.Coulomb(0.3), sigma_0=1e5)
    assert repr(law) == (
        "LuGre(law=Coulomb(mu_s=0.3, mu_k=0.3), sigma_0=100000 1/m, sigma_1=0 s/m, sigma_2=0 s/m, "
        "v_s=None)"
    )
    assert repr(friction.Regularised(law.law, 1e-3)).startswith("Regularised(law=Coulomb(")
    lines = repr(systems.BlockOnBelt.constructed(85.0)).splitlines()
    assert (lines[0], lines[-1]) == ("BlockOnBelt(", ")")
    assert all(line.startswith("    ") and len(line) <= 104 for line in lines[1:-1])
    assert "exponent=2" in repr(friction.Stribeck(0.5, 0.3, 0.1))
    assert "r_f=0.05 m" in repr(corexy_jax.CoreXYParameters())
    assert repr(corexy_jax.Harmonic(10.0, 5.0)) == "Harmonic(v01=10 V, v02=5 V, frequency=0.5 Hz)"
    beam = systems.JointedBeam.constructed(5e-4)
    assert "k1=0.25, k2=7.6" in repr(beam)
    assert "k1=" in repr(beam.dimensional(systems.BeamScales(2.0, 3.0, 4.0)))
    assert "N/m, k2" in repr(beam.dimensional(systems.BeamScales(2.0, 3.0, 4.0)))
    html = BLOCK._repr_html_()
    assert "<td>stiffness</td><td>1</td><td>N/m</td>" in html


def test_where_there_are_no_numbers_there_are_shapes():
    texts = []

    @jax.jit
    def traced(v):
        block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, v)
        texts.append((repr(block), repr(run(v)), str(run(v).result), repr(run(v).events)))
        return v

    traced(0.2)
    block, solution, result, events = texts[0]
    assert "belt_speed=f64[]" in block
    assert solution == "Solution(traced, of shape ())"
    assert result == "RESULTS(traced)"
    assert events == "EventLog(traced, with room for 8 events)"


def concrete(cls):
    return not cls.__name__.startswith("Abstract") and issubclass(cls, AbstractShown)


CLASSES = [
    cls
    for package in (systems, friction, corexy_jax)
    for cls in vars(package).values()
    if isinstance(cls, type) and concrete(cls)
]


@pytest.mark.parametrize("cls", CLASSES, ids=lambda cls: cls.__name__)
def test_every_number_has_a_unit(cls):
    """Of every class with parameters: those that are arrays are named with units, and nothing else."""
    arrays = {
        name.lstrip("_")
        for name, kind in cls.__annotations__.items()
        if "Float[" in str(kind) or getattr(kind, "array_type", None) is not None
    }
    stated = cls.parameter_units
    if isinstance(stated, property):
        stated = systems._jointed_beam_scales.PARAMETER_UNITS
    known = set(cls.__dataclass_fields__)
    missing = {name for name in arrays - set(stated) if not name.endswith("exponent")}
    assert missing - {"variant"} == set()
    assert {name for name in stated if name not in known} == set()


def test_a_class_of_ones_own():
    class Spring(AbstractShown):
        stiffness: Any
        name: str = "soft"
        parameter_units: ClassVar = {"stiffness": "N/m"}

    assert repr(Spring(jnp.asarray([1.0, 2.0]))) == "Spring(stiffness=[1, 2] N/m, name='soft')"
    # What has lost its leaves, as half of a partition, is shown too.
    assert (
        repr(eqx.filter(Spring(jnp.ones(2)), eqx.is_array)) == "Spring(stiffness=[1, 1] N/m, name=None)"
    )
    assert "&lt;b&gt;" in Spring(1.0, "<b>")._repr_html_()


@pytest.mark.more
def test_outcomes_in_words(one):
    assert str(ss.RESULTS.successful) == "successful"
    assert repr(ss.RESULTS.chattering) == "RESULTS.chattering"
    both = jax.tree.map(lambda a, b: jnp.stack([a, a, b]), one.result, ss.RESULTS.chattering)
    assert str(both) == "2 successful, 1 chattering"
    assert isinstance(both, ss.RESULTS)
    assert "chattering" in ss.RESULTS[ss.RESULTS.chattering]
    assert str(least_squares(lambda p: jnp.stack([p["q"] - 1.0]), {"q": 2.0}).result) == "successful"


def test_solutions(one):
    assert repr(one) == str(one) == (
        "Solution: t = 0 to 30 s, 6 events, 57 steps accepted of 81; successful; derivative flags: none"
    ).replace("57 steps accepted of 81", f"{one.stats.num_accepted} steps accepted of "
              f"{one.stats.num_attempts}")  # fmt: skip
    result = jnp.asarray([0] * 9998 + [int(ss.RESULTS.chattering._value)] * 2)
    many = jax.tree.map(lambda a: jnp.broadcast_to(a, (10_000, *a.shape)), one)
    many = eqx.tree_at(lambda s: s.result._value, many, result)
    many = eqx.tree_at(lambda s: s.flags, many, jnp.asarray(result != 0, jnp.int32))
    assert str(many) == (
        "Solution: 10,000 runs, 9,998 successful, 2 chattering; t = 0 to 30 s, 6 events; derivative "
        "flags: 2 of the runs"
    )
    assert "<td>9,998</td><td>successful</td>" in many._repr_html_()
    assert "<td>outcome</td><td>successful</td>" in one._repr_html_()
    assert repr(many.events) == "EventLog: 10,000 runs of 6 events"
    assert repr(one.events) == "EventLog: 6 events, t = 5 to 26.7078 s: modes 1 > 0 > 1 > 0 > 1 > 0 > 1"
    assert repr(one.outputs) == "StateLog: 31 rows, t = 0 to 30 s: x, v"
    assert one.events._repr_html_().count("<tr>") == 7


@pytest.mark.more
def test_spectra_and_fits(one):
    local = jnp.asarray([[1.0, -jnp.inf], [3.0, -jnp.inf]])
    found = LyapunovSpectrum(
        jnp.asarray([2.0, -jnp.inf]), jnp.asarray([0.25, jnp.nan]), local, jnp.arange(1.0, 3.0),
        jnp.zeros(2, jnp.int32), 2.0, (), status=jnp.asarray([0, 1], jnp.int32),
    )  # fmt: skip
    assert str(found).splitlines() == [
        "LyapunovSpectrum of 2 segments, to 2 s:", "  +2 +- 0.25 1/s", "  -inf (lost)",
    ]  # fmt: skip
    sine = amplitude_spectrum(3.0 + np.sin(2 * np.pi * np.arange(100) / 10), 0.1)
    assert repr(sine) == (
        "Spectrum: 51 frequencies from 0 to 5 Hz, mean 3, the greatest amplitude 1 at 1 Hz"
    )
    values = {"k": jnp.asarray(2.0)}
    sensitivity = Sensitivity(("k",), jnp.ones((4, 1)))
    space, three = scalars("start", values)[0], jnp.asarray(3, jnp.int32)
    fit = Fit(values, jnp.ones(4), sensitivity, three, space, jnp.asarray(0, jnp.int32))
    assert repr(fit) == str(fit)
    assert "k = 2 +- 1" in repr(fit)
    assert "<td>k</td><td>2</td><td>1</td>" in fit._repr_html_()
    assert repr(sensitivity) == "Sensitivity of 4 residuals to k; singular values 2"
    record = Record(
        np.arange(4.0), {"x": [0.0, np.nan, 1.0, 2.0]}, missing="nan", units={"x": "m"}, name="a"
    )
    assert repr(record) == "Record 'a': 4 samples, t = 0 to 3 s; x [m], 1 missing"
    simulation = Simulation(one.outputs.t, {"x": one.outputs.y.x}, one)
    assert repr(simulation).startswith("Simulation: x at 31 times; Solution: t = 0 to 30 s, 6 events")


def test_the_machine():
    empty = jnp.zeros((1, 2))
    voltage = corexy_jax.Ramps(*[[0.0, 1.0]] * 5)
    plan = corexy_jax.Feedforward(
        corexy_jax.CoreXYParameters(), jnp.zeros((3, 2)), voltage, jnp.asarray([0.0, 1.5]), empty,
        empty, empty, empty, jnp.zeros(3),
    )  # fmt: skip
    assert repr(plan) == "Feedforward: 3 points in 1.5 s, 1 piece of constant acceleration"
