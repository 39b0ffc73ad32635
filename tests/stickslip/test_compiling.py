"""No call of a public function compiles anything the second time; counted from JAX's own events."""

import os

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import corexy_jax
import stickslip as ss
from stickslip.analysis import (
    Maximum,
    Recording,
    Segments,
    lyapunov_spectrum,
    lyapunov_spectrum_of_map,
    orbit_diagram,
    two_trajectory_exponent,
)
from stickslip.identification import GradientDescent, least_squares
from stickslip.systems import CoulombOscillator, Motion


def block(belt_speed=0.2):
    return CoulombOscillator(1.0, 1.0, 1.0, 0.5, belt_speed)


def simulate(belt_speed=0.2, t1=8.0, **options):
    return ss.simulate(block(belt_speed), 0.0, t1, Motion(x=0.0, v=belt_speed), **options).y1.x


class Searching(CoulombOscillator):
    """Its initial mode comes out of a loop and a branch, as that of a machine with many contacts."""

    def initial_mode(self, t, y, args):
        number = jax.lax.while_loop(lambda n: n < 3, lambda n: n + 1, jnp.zeros((), jnp.int32))
        return jax.lax.cond(number > 2, lambda: self.mode_index("stick"), lambda: jnp.int32(0))

    def mode_index(self, name):
        return jnp.asarray(self.mode_names.index(name), jnp.int32)


def search(belt_speed=0.2):
    system = Searching(1.0, 1.0, 1.0, 0.5, belt_speed)
    return ss.simulate(system, 0.0, 4.0, Motion(x=0.0, v=belt_speed)).y1.x


def spectrum(belt_speed=0.2, segment=1.0):
    start = Motion(x=0.0, v=belt_speed)
    return lyapunov_spectrum(block(belt_speed), start, Segments(segment, 20, 2.0))


def separation(belt_speed=0.2):
    return two_trajectory_exponent(block(belt_speed), Motion(x=0.5, v=0.1), Segments(1.0, 20))


def of_map(a=1.4):
    def henon(z):
        return 1.0 - a * z[0] * z[0] + z[1], 0.3 * z[0]

    return lyapunov_spectrum_of_map(henon, (0.1, 0.1), Segments(1, 100))


def fit(rate=2.0, method=None):
    t = jnp.linspace(0.0, 1.0, 20)
    data = 3.0 * jnp.exp(-rate * t)
    return least_squares(
        lambda p: (p["size"] * jnp.exp(-p["rate"] * t) - data) / 0.01, {"size": 1.0, "rate": 1.0},
        method,
    )  # fmt: skip


def diagram(last=0.3):
    return orbit_diagram(
        block(), {"belt_speed": np.linspace(0.2, last, 4)}, Motion(x=0.0, v=0.2),
        Recording(5.0, 10.0, Maximum("x"), "x", check=0),
    )  # fmt: skip


def machine(way, t1=0.1, gain=1.0, **options):
    parameters, voltage = corexy_jax.scenario(1)
    parameters = jax.tree.map(lambda a: a * gain, parameters)
    return corexy_jax.simulate(parameters, voltage, t1, method=way, rows=11, **options).y.x


# What is called first, then again, then with other numbers.
CALLS = {
    "simulate": (simulate, lambda: simulate(0.25), lambda: simulate(0.2, 5.0)),
    "args": (lambda: simulate(args={"a": 1.0}), lambda: simulate(args={"a": 2.0})),
    "initial mode": (search, lambda: search(0.25)),
    "lyapunov_spectrum": (spectrum, lambda: spectrum(0.25), lambda: spectrum(0.2, 0.9)),
    "two_trajectory_exponent": (separation, lambda: separation(0.25)),
    "lyapunov_spectrum_of_map": (of_map,),
    "least_squares": (fit, lambda: fit(1.9)),
    "GradientDescent": (lambda: fit(method=GradientDescent()),),
    "orbit_diagram": (diagram, lambda: diagram(0.35)),
    "corexy_jax consistent": (
        lambda: machine("consistent"),
        lambda: machine("consistent", 0.09, 1.01),
    ),
    "corexy_jax as printed": (lambda: machine("as_printed"), lambda: machine("as_printed", 0.2)),
    "corexy_jax smoothed": (
        lambda: machine("smoothed", width=0.1),
        lambda: machine("smoothed", 0.09, 1.01, width=0.11),
    ),
}


def nothing_more_is_compiled(calls, compiled):
    first, *others = calls
    jax.block_until_ready(first())
    assert compiled
    for call in (first, *others):
        compiled.clear()
        jax.block_until_ready(call())
        assert not compiled


@pytest.mark.more
@pytest.mark.parametrize("name", CALLS)
def test_second_call_compiles_nothing(name, compiled, standard_dtype_promotion):
    jax.clear_caches()
    nothing_more_is_compiled(CALLS[name], compiled)


@pytest.mark.more
def test_a_first_call_compiles_one_program(compiled):
    """Whatever is computed outside of it is compiled, and later called, on its own."""
    parameters, voltage = corexy_jax.scenario(1)
    jax.clear_caches()
    simulate()  # which shares with all that follows how a number becomes an array
    for call in (
        search,
        lambda: simulate(saveat=ss.SaveAt(max_events=9)),
        lambda: corexy_jax.simulate(parameters, voltage, 0.1, rows=11),
    ):
        compiled.clear()
        jax.block_until_ready(call())
        assert len(compiled) == 1


@pytest.mark.more
def test_the_program_of_the_consistent_machine_is_small():
    """9,665 lines lowered; 14,153 instructions as the quick suite compiles, 14,282 as users do.

    9,976 and 13,525 with modes written by hand.
    """
    parameters, voltage = corexy_jax.scenario(1)

    def run(parameters, voltage):
        found = corexy_jax.simulate(parameters, voltage, 6.0, throw=False)
        return found.y, found.events.t

    lowered = jax.jit(run).lower(parameters, voltage)
    assert len(lowered.as_text().splitlines()) < 10_000
    quick = "fusion_emitters=false" in os.environ.get("XLA_FLAGS", "")
    assert lowered.compile().as_text().count(" = ") < (14_200 if quick else 14_300)


def test_least_squares_sees_data_that_changed():
    """Not those of the program compiled before, although the function is the same object."""
    data = {"rate": 2.0, "t": np.linspace(0.0, 1.0, 20)}

    def residual(p):
        return jnp.exp(-p["rate"] * data["t"]) - jnp.exp(-data["rate"] * data["t"])

    for rate in (2.0, 1.5):
        data["rate"] = rate
        found = least_squares(residual, {"rate": 1.0})
        np.testing.assert_allclose(found.values["rate"], rate, rtol=1e-6)


def test_least_squares_names_its_results_as_asked():
    """One program, two names."""
    for name in ("rate", "speed"):
        found = least_squares(lambda p, name=name: p[name] - jnp.arange(1.0, 4.0), {name: 1.0})
        assert list(found.values) == [name]
        np.testing.assert_allclose(found.values[name], 2.0, rtol=1e-3)


def test_least_squares_with_traced_data():
    t = jnp.linspace(0.0, 1.0, 20)

    @jax.jit
    def fitted(rate):
        return least_squares(
            lambda p: jnp.exp(-p["rate"] * t) - jnp.exp(-rate * t), {"rate": 1.0}
        ).values

    np.testing.assert_allclose(fitted(2.0)["rate"], 2.0, rtol=1e-6)
    np.testing.assert_allclose(jax.vmap(fitted)(jnp.array([2.0, 3.0]))["rate"], [2.0, 3.0], rtol=1e-6)


def test_initial_mode_may_ask_in_python():
    class Asking(CoulombOscillator):
        def initial_mode(self, t, y, args):
            return self.mode_names.index("stick") if y.x < 1.0 else 0

    system = Asking(1.0, 1.0, 1.0, 0.5, 0.2)
    assert float(ss.simulate(system, 0.0, 4.0, Motion(x=0.0, v=0.2)).y1.x) == pytest.approx(0.8)
