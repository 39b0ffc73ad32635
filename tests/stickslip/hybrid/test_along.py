"""The readings of a derivative: y = c x^2 for rows of numbers stands for a run, in closed form."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip._jaxpr import equations
from stickslip.hybrid._along import along
from stickslip.systems import CoulombOscillator, Motion

X = np.array([1.0, 2.0, 3.0])
SLOPES = np.diag(2.0 * X)


def reader(asked):
    """The map with its readings; `asked` notes which of them are traced."""

    def slopes(directions, operands, found=None):
        asked.append("slopes")
        (dx, dc), (x, c) = directions, operands
        return 2.0 * c * x * dx + x**2 * dc

    def pull(wanted, bars, operands, found):
        asked.append("pull")
        x, c = operands
        return [2.0 * c * x * bars if wanted[0] else None, jnp.sum(x**2 * bars) if wanted[1] else None]

    def both(directions, operands):
        asked.append("both")
        return operands[1] * operands[0] ** 2, slopes(directions, operands)

    def results(operands):
        asked.append("results")
        return operands[1] * operands[0] ** 2

    @jax.custom_jvp
    def of_two(x, c):
        return c * x**2

    @of_two.defjvp
    def _(primals, tangents):
        like = jax.eval_shape(results, primals)
        asked.clear()
        return along([*tangents], [*primals], (like, like), both, results, slopes, pull)

    return lambda x, c=1.0: of_two(x, c)


ROWS = np.stack([X, -X, 2.0 * X, 0.5 * X])
OF_ROWS = np.stack([np.diag(2.0 * x) for x in ROWS])


def test_forward_mode_takes_both_from_one_pass():
    asked = []
    np.testing.assert_array_equal(jax.jit(jax.jacfwd(reader(asked)))(X), SLOPES)
    assert asked == ["both", "slopes"]


def test_reverse_mode_takes_the_results_first():
    asked = []
    run = reader(asked)
    value, slopes = jax.jit(jax.value_and_grad(lambda x: jnp.sum(run(x))))(X)
    assert {"results", "pull"} <= set(asked)
    assert value == 14.0
    np.testing.assert_array_equal(slopes, 2.0 * X)


@pytest.mark.parametrize("order", ["lanes outside", "lanes inside", "lanes of lanes", "reverse"])
def test_lanes_and_directions_in_any_order(order):
    run = reader([])
    found = jax.jit(
        {
            "lanes outside": jax.vmap(jax.jacfwd(run)),
            "lanes inside": lambda rows: jnp.einsum("ijik->ijk", jax.jacfwd(jax.vmap(run))(rows)),
            "lanes of lanes": lambda rows: jnp.concatenate(
                jax.vmap(jax.vmap(jax.jacfwd(run)))(rows.reshape(2, 2, 3))
            ),
            "reverse": jax.vmap(jax.jacrev(run)),
        }[order]
    )(ROWS)
    np.testing.assert_array_equal(found, OF_ROWS)


def test_lanes_lie_side_by_side():
    run = reader([])

    def slopes(c):
        return jax.jacfwd(lambda p: run(p[0] + p[1] + c, p[2]))(np.ones(3))

    text = jax.jit(jax.vmap(slopes)).lower(np.ones(5)).as_text()
    products = [line.split()[-1] for line in text.splitlines() if "stablehlo.multiply" in line]
    assert "tensor<3x5xf64>" in products
    assert "tensor<5x3xf64>" not in products


def test_a_walk_sees_the_program():
    """Loops of LAPACK and of many motions must be found where they are differentiated, too."""
    closed = jax.make_jaxpr(jax.vmap(jax.jacfwd(reader([]))))(ROWS)
    assert "mul" in {eqn.primitive.name for eqn in equations(closed.jaxpr)}


def test_results_have_no_directions():
    run = reader([])

    @jax.jit
    @jax.vmap
    def value_and_slopes(x):
        along_x = jax.vmap(lambda d: jax.jvp(run, (x,), (d,)), out_axes=(None, 0))
        return along_x(np.eye(3))

    value, slopes = value_and_slopes(ROWS)
    np.testing.assert_array_equal(value, ROWS**2)
    np.testing.assert_array_equal(slopes, OF_ROWS)


def test_a_linear_map_has_directions_of_directions_and_a_transpose():
    run = reader([])

    @jax.jit
    def of(x):
        value, linear = jax.linearize(run, x)
        many = jax.vmap(jax.vmap(linear))(np.stack([np.eye(3), 2.0 * np.eye(3)], 1))
        return value, many, jax.linear_transpose(jax.vmap(linear), np.eye(3))(np.eye(3))[0]

    value, many, back = of(X)
    np.testing.assert_array_equal(value, X**2)
    np.testing.assert_array_equal(many[:, 1], 2.0 * SLOPES)
    np.testing.assert_array_equal(back, SLOPES)


def test_directions_of_lanes_have_a_transpose():
    run = reader([])

    @jax.jit
    def back(rows):
        linear = jax.linearize(jax.vmap(run), rows)[1]
        many = np.stack([ROWS, 2.0 * ROWS, 3.0 * ROWS])
        return jax.linear_transpose(jax.vmap(linear), many)(many)[0]

    np.testing.assert_array_equal(back(ROWS), 2.0 * ROWS * np.stack([ROWS, 2.0 * ROWS, 3.0 * ROWS]))


def test_lanes_that_share_a_parameter_sum_its_slopes():
    run, c = reader([]), np.array([1.0, 2.0, 3.0, 4.0])

    def total(x, c):
        return jnp.sum(jax.vmap(run, (None, 0))(x, c))

    of_x, of_c = jax.jit(jax.grad(total, (0, 1)))(X, c)
    np.testing.assert_allclose(of_x, 20.0 * X)
    np.testing.assert_allclose(of_c, 14.0)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(total))(X, c), 20.0 * X)


@pytest.mark.parametrize("around", [jax.checkpoint, lambda f: jax.checkpoint(jax.vmap(f))])
def test_a_program_may_be_cut_in_two(around):
    run = around(reader([]))
    slopes = jax.jit(jax.grad(lambda x: jnp.sum(jnp.sin(run(x)))))(ROWS)
    np.testing.assert_allclose(slopes, 2.0 * ROWS * np.cos(ROWS**2), rtol=1e-13)

    def added(x):
        return jax.lax.scan(lambda sum, row: (sum + jnp.sum(run(row[None])), None), 0.0, x)[0]

    np.testing.assert_allclose(jax.jit(jax.grad(added))(ROWS), 2.0 * ROWS)


@pytest.mark.parametrize("outer", [jax.jacfwd, jax.jacrev])
def test_second_derivatives_are_refused(outer):
    with pytest.raises(NotImplementedError, match="second derivatives"):
        jax.jit(outer(jax.jacfwd(reader([])))).trace(X)


@functools.cache
def loops(derivative):
    """While loops in the program of a stick-slip motion; "jacfwd", "grad", or "" for the run alone."""

    def end(friction):
        block = CoulombOscillator(1.0, 1.0, friction, 0.5, 0.2)
        saveat = ss.SaveAt(max_events=None)
        return ss.simulate(block, 0.0, 30.0, Motion(0.0, 0.2), "stick", saveat=saveat, throw=False).y1.x

    function = getattr(jax, derivative)(end) if derivative else end
    return str(jax.jit(function).lower(1.0).as_text()).count("stablehlo.while")


def test_a_forward_derivative_runs_the_motion_once():
    assert loops("jacfwd") == loops("")


@pytest.mark.more
def test_no_parameters_have_no_slopes():
    def end(p, speed):
        block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, speed + p.sum())
        return ss.simulate(block, 0.0, 3.0, Motion(0.0, speed), "stick").y1.x

    none, speeds = jnp.zeros(0), jnp.array([0.2, 0.3])
    slopes, found = jax.jacfwd(lambda p, v: (end(p, v),) * 2, has_aux=True)(none, 0.2)
    assert slopes.shape == (0,)
    assert float(found) == pytest.approx(0.6, abs=1e-12)  # stuck until t = 5
    assert ss.map_lanes(lambda v: jax.jacfwd(end)(none, v))(speeds).shape == (2, 0)
