"""Designs against those that are known in closed form."""

import functools

import jax
import jax.monitoring
import jax.numpy as jnp
import numpy as np
import pytest

from stickslip.identification import CMAES, Normal, Unknown, sensitivities, sensitivity
from stickslip.identification import design_input as design_on

design_input = functools.partial(design_on, executor="portable", criterion="D")
HERE = {"a": 1.0, "b": 1.0}


def plane(values, u):
    """Rows of two factors: the sensitivities are the coefficients."""
    return u @ jnp.stack([values["a"], values["b"]])


def shared_out(values, u):
    """A part of the time for one quantity, the rest for another that is measured twice as well."""
    return jnp.stack([jnp.sqrt(u[0]) * values["a"], 2.0 * jnp.sqrt(1.0 - u[0]) * values["b"]])


def line(values, u):
    return values["a"] * u + values["b"]


def test_d_optimal_rows_are_those_of_hadamard():
    """For four rows with entries in [-1, 1] det S'S is at most 4^2, with orthogonal columns."""
    found = design_input(plane, HERE, -np.ones((4, 2)), 1.0, search=CMAES(40, 16))
    assert float(found.value) == pytest.approx(np.log(16.0), abs=1e-9)
    rows = np.asarray(found.coefficients)
    np.testing.assert_allclose(rows.T @ rows, 4.0 * np.eye(2), atol=1e-6)
    np.testing.assert_allclose(found.sensitivity.singular_values, 2.0, rtol=1e-9)
    assert np.all(np.diff(found.history) >= 0.0)
    assert float(found.first) < float(found.value)


@pytest.mark.parametrize(("criterion", "part"), [("D", 1.0 / 2.0), ("A", 2.0 / 3.0)])
def test_time_is_shared_out_as_each_criterion_wants(criterion, part):
    """det = 4 u (1 - u) is greatest at 1/2; the trace 1/u + 1/(4 (1 - u)) is least at 2/3."""
    found = design_input(shared_out, HERE, [0.01], [0.99], criterion=criterion, search=CMAES(30, 8))
    assert float(found.coefficients[0]) == pytest.approx(part, abs=1e-4)
    u = part
    value = {"D": np.log(4.0 * u * (1.0 - u)), "A": -np.log(1.0 / u + 0.25 / (1.0 - u))}[criterion]
    assert float(found.value) == pytest.approx(value, abs=1e-8)


def test_what_is_not_asked_for_is_unknown_all_the_same():
    """The slope of a line with an unknown offset needs both ends; with a known one only the far one."""
    with_offset = design_input(line, HERE, np.zeros(2), 1.0, about=["a"], search=CMAES(25, 12))
    np.testing.assert_allclose(np.sort(with_offset.coefficients), [0.0, 1.0], atol=1e-6)
    assert float(with_offset.value) == pytest.approx(np.log(0.5), abs=1e-9)
    known = {"a": 1.0, "b": Unknown(1.0, bounds=(0.0, None), prior=Normal(1.0, 1e-6))}
    without = design_input(line, known, np.zeros(2), 1.0, about=["a"], search=CMAES(25, 12))
    np.testing.assert_allclose(without.coefficients, 1.0, atol=1e-6)
    assert float(without.value) == pytest.approx(np.log(2.0), abs=1e-5)


def test_inputs_under_which_a_run_fails_are_left_out_and_a_start_is_kept():
    def fails(values, u):
        return jnp.where(u > 0.7, jnp.nan, 1.0) * plane(values, jnp.diag(u))

    begin = np.array([0.2, 0.3])
    found = design_input(fails, HERE, np.zeros(2), 1.0, search=CMAES(30, 12, start=begin))
    assert float(found.first) == pytest.approx(2.0 * np.log(0.06))
    assert np.all((np.asarray(found.coefficients) <= 0.7) & (np.asarray(found.coefficients) > 0.68))
    there = sensitivity(lambda p: fails(p, found.coefficients), HERE)
    np.testing.assert_allclose(found.sensitivity.matrix, there.matrix)


def test_what_cannot_be_designed_is_refused():
    with pytest.raises(ValueError, match="about = 'a, b': it must be unknowns that the data of"):
        design_input(
            lambda p, u: u * p["a"] * p["b"], HERE, np.zeros(3), 1.0, search=CMAES(population=4)
        )
    with pytest.raises(ValueError, match=r"low\[\(1,\)\] = 1.0: it must be below high, 1.0"):
        design_input(plane, HERE, [0.0, 1.0], 1.0)
    with pytest.raises(ValueError, match=r"start = .*: it must be within the limits"):
        design_input(plane, HERE, np.zeros(2), 1.0, search=CMAES(start=[0.5, 1.5]))
    with pytest.raises(ValueError, match=r"about = .*: it must be names among a, b"):
        design_input(plane, HERE, np.zeros(2), 1.0, about=["c"])


def test_chunks_of_one_size_are_one_program_for_any_number_of_inputs():
    """Of a machine each program takes ten seconds to trace and lower, whatever is kept on disk."""
    lowered = []

    def hear(event, seconds, fun_name="", **_):
        if event.endswith("jaxpr_to_mlir_module_duration") and fun_name == "jit(run)":
            lowered.append(event)

    def residual(values, u):
        return line(values, u)

    options = {"chunk_size": 4, "executor": "portable"}
    jax.monitoring.register_event_duration_secs_listener(hear)
    try:
        for count in (5, 3):
            rows = {name: np.ones(count) for name in HERE}
            inputs = np.linspace(0.0, 1.0, count)[:, None] * np.array([0.0, 1.0])
            found = sensitivities(residual, rows, inputs, **options)
            np.testing.assert_allclose(found.matrix[..., 0], inputs, atol=1e-15)
        design_on(residual, HERE, np.zeros(2), 1.0, search=CMAES(2, 6), **options)
    finally:
        jax.monitoring.unregister_event_duration_listener(hear)
    assert len(lowered) == 1
