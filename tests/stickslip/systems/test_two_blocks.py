"""Two blocks on one belt: exact piecewise linear motion, uncoupled limit, simultaneous events."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.systems import PairMotion, TwoBlocksOnBelt
from tests.stickslip.systems._closed_forms import BeltCycle, derivatives, two_blocks
from tests.stickslip.systems._systems import PAIR

STEPS = ss.Integrator(step=ss.FixedStep(0.1))
T1 = 20.0
CHANGED = ("mass_2", "coupling", "static_force_1", "kinetic_force_2", "belt_speed")

SENSES = {-1: "slip backward", 0: "stick", 1: "slip forward"}


def names_of(modes):
    names = TwoBlocksOnBelt(**PAIR).mode_names
    return [names[int(mode)] for mode in modes]


def simulated(x_2=0.1, **changes):
    p = {**PAIR, **changes}
    y0 = PairMotion(0.0, p["belt_speed"], x_2, p["belt_speed"])
    return ss.simulate(
        TwoBlocksOnBelt(**p), 0.0, T1, y0, integrator=STEPS, saveat=ss.SaveAt(max_events=32)
    )


def exact(x_2=0.1, **changes):
    p = {**PAIR, **changes}
    return two_blocks(
        T1,
        *((p[f"{name}_1"], p[f"{name}_2"]) for name in ("mass", "stiffness")),
        p["coupling"],
        *((p[f"{name}_1"], p[f"{name}_2"]) for name in ("static_force", "kinetic_force")),
        p["belt_speed"],
        x=(0.0, x_2),
    )


@jax.jit
def program(values, x_2):
    """Run and its slopes in forward mode, compiled once for all tests."""

    def end(values):
        solution = simulated(x_2, **values)
        return jnp.stack(solution.y1), solution

    slopes, solution = jax.jacfwd(end, has_aux=True)(values)
    return solution, slopes


def values_of(**changes):
    return {name: jnp.asarray({**PAIR, **changes}[name]) for name in PAIR}


@pytest.mark.more
def test_motion_and_events():
    solution, _ = program(values_of(), 0.1)
    end, events = exact()
    np.testing.assert_allclose(solution.y1, np.real(end), atol=1e-10)
    assert int(solution.num_events) == len(events) >= 8
    times = [np.real(event.t) for event in events]
    np.testing.assert_allclose(solution.events.t[: len(events)], times, atol=1e-11)
    modes = [" / ".join(SENSES[sense] for sense in event.after) for event in events]
    assert names_of(solution.events.mode_after[: len(events)]) == modes
    assert len(set(modes)) >= 4


@pytest.mark.more
def test_derivatives():
    _, slopes = program(values_of(), 0.1)
    expected = derivatives(lambda **p: exact(**p)[0], {name: PAIR[name] for name in CHANGED})
    for name in CHANGED:
        scale = np.max(np.abs(expected[name]))
        np.testing.assert_allclose(slopes[name], expected[name], atol=1e-8 * scale)


@pytest.mark.slow
def test_reverse_mode():
    slopes = jax.jit(jax.grad(lambda values: simulated(0.1, **values).y1.x_1))(values_of())
    expected = derivatives(lambda **p: exact(**p)[0][:1], {name: PAIR[name] for name in CHANGED})
    for name in CHANGED:
        scale = np.max(np.abs(expected[name]))
        np.testing.assert_allclose(slopes[name], expected[name][0], atol=1e-8 * scale)


@pytest.mark.more
def test_without_coupling_two_oscillators():
    solution, slopes = program(values_of(coupling=0.0), 0.0)
    for i in (1, 2):
        p = {k: PAIR[f"{k}_{i}"] for k in ("mass", "stiffness", "static_force", "kinetic_force")}
        p["belt_speed"] = PAIR["belt_speed"]
        x = float(getattr(solution.y1, f"x_{i}"))
        assert abs(x - BeltCycle(**p).position(T1)) <= 1e-11
        for name, slope in derivatives(lambda **q: BeltCycle(**q).position(T1), p).items():
            key = name if name in PAIR else f"{name}_{i}"
            assert abs(float(slopes[key][2 * i - 2]) - slope) <= 1e-8 * max(1.0, abs(slope))


@pytest.mark.more
def test_simultaneous_events_of_equal_blocks():
    """Alike and alike started, the coupling spring stays unloaded and all events come in pairs."""
    alike = {name: PAIR[name.replace("_2", "_1")] for name in PAIR}
    solution, _ = program(values_of(**alike), 0.0)
    cycle = BeltCycle(*(PAIR[f"{k}_1"] for k in ("mass", "stiffness", "static_force", "kinetic_force")),
                      PAIR["belt_speed"])  # fmt: skip
    # Compilers may contract the products of one block and not those of the other.
    assert abs(float(solution.y1.x_1 - solution.y1.x_2)) <= 1e-13
    assert abs(float(solution.y1.x_1) - cycle.position(T1)) <= 1e-11
    count = int(solution.num_events)
    assert count % 2 == 0
    times = np.asarray(solution.events.t[:count]).reshape(-1, 2)
    np.testing.assert_allclose(times, cycle.events(count // 2)[:, None] * np.ones(2), atol=1e-11)
    together = ("slip backward / slip backward", "stick / stick")
    after = names_of(solution.events.mode_after[1:count:2])
    assert after == [together[i % 2] for i in range(count // 2)]
    # No derivative exists where two events are one: which comes first depends on the parameter.
    assert not bool(solution.differentiable)
