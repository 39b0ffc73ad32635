"""Derivatives through events: closed forms, both modes, saltation, refusal where there is none."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from tests.stickslip.hybrid._systems import (
    Circle,
    Flight,
    Parabola,
    Pendulum,
    State,
    StickSlip,
    fixed,
    stick_slip_motion,
)


def end_of_stick_slip(parameters, t=30.0, h=0.25, **kwargs):
    v, fs, fk = parameters
    return ss.simulate(
        StickSlip(v, fs, fk),
        0.0,
        t,
        State(0.0 * v, v),
        0,
        integrator=fixed(h),
        saveat=ss.SaveAt(max_events=None),
        **kwargs,
    )


def value_and_jacobians(function, p):
    """`function(p)` and its Jacobian, forward and reverse, from two programs."""

    def twice(p):
        value = function(p)
        return value, value

    forward, value = jax.jit(jax.jacfwd(twice, has_aux=True))(p)
    return value, forward, jax.jit(jax.jacrev(function))(p)


def test_forward_and_reverse_equal_the_closed_form():
    p = jnp.array([0.2, 1.0, 0.5])
    expected = [16.2232182593, -5.1724137931, 5.1724137931]

    def x(p):
        return end_of_stick_slip(p).y1.x

    _, forward, reverse = value_and_jacobians(x, p)
    np.testing.assert_allclose(forward, expected, rtol=1e-9)
    np.testing.assert_allclose(reverse, expected, rtol=1e-9)


@pytest.mark.more
def test_derivatives_of_event_times():
    """The first release is at F_s/v, the first return where the slip phase of the cosine ends."""
    p = jnp.array([0.25, 1.1, 0.4])

    def times(p):
        v, fs, fk = p
        run = ss.simulate(
            StickSlip(v, fs, fk),
            0.0,
            12.0,
            State(0.0 * v, v),
            0,
            integrator=fixed(0.25),
            saveat=ss.SaveAt(max_events=4),
        )
        return run.events.t[:2]

    def exact(p):
        v, fs, fk = p
        release = fs / v
        return jnp.stack([release, release + 2 * jnp.pi - 2 * jnp.arctan((fs - fk) / v)])

    value, forward, reverse = value_and_jacobians(times, p)
    expected, slopes = jax.jit(lambda p: (exact(p), jax.jacfwd(exact)(p)))(p)
    np.testing.assert_allclose(value, expected, atol=1e-11)
    np.testing.assert_allclose(forward, slopes, atol=1e-8)
    np.testing.assert_allclose(reverse, slopes, atol=1e-8)


@pytest.mark.more
def test_curved_guard_and_explicit_time():
    """Ball on a floor that moves as s t + c t^2/2: impact where the parabolas meet.

    It starts at a time of its own, on which the impact depends by way of the floor.
    """

    def times(p):
        slope, curvature, x0, v0, t0 = p
        run = ss.simulate(
            Flight(-1.0, 0.5, slope, curvature), t0, 2.0, State(x0, v0), 0,
            integrator=fixed(0.5, "rk4"), saveat=ss.SaveAt(max_events=1),
        )  # fmt: skip
        return jnp.stack([run.events.t[0], run.y1.x, run.y1.v])

    def exact(p):
        slope, curvature, x0, v0, t0 = p
        height = x0 - slope * t0 - 0.5 * curvature * t0 * t0
        b, a = v0 - slope - curvature * t0, 0.5 * (-1.0 - curvature)
        t = (-b - jnp.sqrt(b * b - 4 * a * height)) / (2 * a)
        v = -0.5 * (v0 - t)
        x, rest = x0 + v0 * t - 0.5 * t * t, 2.0 - t0 - t
        return jnp.stack([t0 + t, x + v * rest - 0.5 * rest * rest, v - rest])

    p = jnp.array([-0.2, 0.3, 1.0, 0.1, 0.15])
    value, forward, reverse = value_and_jacobians(times, p)
    expected, slopes = jax.jit(lambda p: (exact(p), jax.jacfwd(exact)(p)))(p)
    np.testing.assert_allclose(value, expected, atol=1e-13)
    np.testing.assert_allclose(forward, slopes, atol=1e-12)
    np.testing.assert_allclose(reverse, slopes, atol=1e-12)


def everything(q, ts):
    """All kinds of results of one run as one vector."""
    v, fs, x0, t0, t1 = q
    run = ss.simulate(
        StickSlip(v, fs, 0.5), t0, t1, State(x0, v), 0, integrator=fixed(0.3, "tsit5"),
        saveat=ss.SaveAt(
            ts=ts, max_events=4, max_crossings=4,
            sections=(
                ss.Section(lambda system, t, y, dy, mode, args: y.x - 0.3, "both"),
                ss.Section(lambda system, t, y, dy, mode, args: dy.v + 0.2, "rising"),
            ),
        ),
    )  # fmt: skip
    pieces = [
        run.y1, run.outputs.y, run.outputs.dy, run.crossings[0].t, run.crossings[1].y,
        run.crossings[1].dy, run.events.t, run.events.y_before, run.events.y_after,
    ]  # fmt: skip
    flat = jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(pieces)])
    return jnp.where(jnp.isnan(flat), 0.0, flat)


@pytest.mark.more
def test_every_kind_of_result_forward_reverse_and_finite_differences():
    q, ts = jnp.array([0.3, 1.0, 0.1, 0.05, 9.3]), jnp.array([1.0, 4.1, 7.7])
    forward, by_time = jax.jit(jax.jacfwd(everything, argnums=(0, 1)))(q, ts)
    reverse, reverse_by_time = jax.jit(jax.jacrev(everything, argnums=(0, 1)))(q, ts)
    np.testing.assert_allclose(forward, reverse, rtol=0, atol=1e-11)
    value = jax.jit(everything)
    step = 1e-5
    # The grid of fixed steps moves with the events, so compare to the truncation error of Tsit5.
    for i in range(5):
        e = jnp.zeros(5).at[i].set(step)
        difference = (value(q + e, ts) - value(q - e, ts)) / (2 * step)
        np.testing.assert_allclose(forward[:, i], difference, rtol=0, atol=2e-6)
    difference = (value(q, ts + 1e-5) - value(q, ts - 1e-5)) / 2e-5
    np.testing.assert_allclose(by_time.sum(1), difference, rtol=0, atol=2e-6)
    np.testing.assert_allclose(reverse_by_time, by_time, atol=1e-12)


def test_saltation_matrix_against_its_closed_form():
    """Slip to stick: v is set to v_b, x is kept: rank one. Stick to slip: the field jumps."""
    system, v = StickSlip(0.2), 0.2
    release = ss.saltation_matrix(system, 5.0, State(1.0, v), 0, 0)
    np.testing.assert_allclose(release, [[1.0, 0.0], [-0.5 / v, 0.0]], atol=1e-14)
    sticks = ss.saltation_matrix(system, 8.9, State(0.0, v), 1, 1)
    np.testing.assert_allclose(sticks, [[1.0, 0.0], [0.0, 0.0]], atol=1e-14)


class Carried(Flight):
    """Where it lands it is put on a belt that has gone 3 t."""

    def transition(self, t, y, mode, guard, args):
        return State(y.x + 3.0 * t, y.v), mode


def test_saltation_matrix_of_a_jump_that_depends_on_time():
    """x = x0 + v (t - t0) lands on x = 0 at t0 - x0/v, and the later the farther it is put."""
    matrix = ss.saltation_matrix(Carried(acceleration=0.0), 1.0, State(0.0, -2.0), 0, 0)
    np.testing.assert_allclose(matrix, [[1.0 + 3.0 / 2.0, 0.0], [0.0, 1.0]], atol=1e-14)


@pytest.mark.more
def test_monodromy_of_the_stick_slip_cycle():
    """Start inside slip on the cycle: multipliers 1 (along the motion) and exactly 0 (stick)."""
    v, a = 0.2, 0.5
    stick, slip = 1.0 / v, 2 * np.pi - 2 * np.arctan(a / v)
    period, angle = stick + slip, 1.0
    z0 = jnp.array(
        [0.5 + a * np.cos(angle) + v * np.sin(angle), -a * np.sin(angle) + v * np.cos(angle)]
    )

    @jax.jit
    def after_period(z):
        run = ss.simulate(StickSlip(v), 0.0, period, State(z[0], z[1]), 1, integrator=fixed(0.2))
        return jnp.stack([run.y1.x, run.y1.v])

    np.testing.assert_allclose(after_period(z0), z0, atol=1e-11)
    monodromy = np.asarray(jax.jit(jax.jacfwd(after_period))(z0))
    multipliers = np.sort(np.abs(np.linalg.eigvals(monodromy)))
    np.testing.assert_allclose(multipliers, [0.0, 1.0], atol=1e-9)
    assert abs(np.linalg.det(monodromy)) < 1e-12
    # Closed form: rotation to the return, projection, stick, release, rotation back to the start.
    rotation = lambda t: np.array([[np.cos(t), np.sin(t)], [-np.sin(t), np.cos(t)]])  # noqa: E731
    release = np.array([[1.0, 0.0], [-a / v, 0.0]])
    closed = rotation(angle) @ release @ np.diag([1.0, 0.0]) @ rotation(slip - angle)
    np.testing.assert_allclose(monodromy, closed, atol=1e-9)
    e = 1e-6
    columns = [(after_period(z0 + e * d) - after_period(z0 - e * d)) / (2 * e) for d in np.eye(2)]
    np.testing.assert_allclose(monodromy, np.stack(columns, 1), atol=1e-7)
    np.testing.assert_allclose(jax.jit(jax.jacrev(after_period))(z0), monodromy, atol=1e-12)


@pytest.mark.more
def test_adaptive_steps_and_smooth_systems_too():
    @jax.jit
    def end(z):
        y1 = ss.simulate(Pendulum(), 0.0, 3.0, State(z[0], z[1])).y1
        return jnp.stack([y1.x, y1.v])

    z = jnp.array([1.0, 0.3])
    forward = jax.jit(jax.jacfwd(end))(z)
    np.testing.assert_allclose(jax.jit(jax.jacrev(end))(z), forward, atol=1e-12)
    assert abs(np.linalg.det(forward) - 1.0) < 1e-8  # Liouville: no friction, no contraction
    e = 1e-6
    difference = [(end(z + e * d) - end(z - e * d)) / (2 * e) for d in np.eye(2)]
    np.testing.assert_allclose(forward, np.stack(difference, 1), atol=1e-8)


@pytest.mark.slow
def test_derivatives_in_chunks_with_both_executors():
    speeds = jnp.linspace(0.2, 0.4, 6)

    def slopes(v):
        def x(v):
            return end_of_stick_slip((v, 1.0 + 0 * v, 0.5 + 0 * v), 20.0).y1.x

        return jax.jvp(x, (v,), (1.0,))[1], jax.grad(x)(v)

    def difference(v, e=1e-6):
        return (stick_slip_motion(20.0, v + e)[0] - stick_slip_motion(20.0, v - e)[0]) / (2 * e)

    expected = [difference(float(v)) for v in speeds]
    for executor in ("portable", "fused"):
        forward, reverse = ss.map_lanes(slopes, executor=executor, chunk_size=4)(speeds)
        np.testing.assert_allclose(forward, expected, atol=2e-7, rtol=0)
        np.testing.assert_allclose(forward, reverse, atol=1e-9, rtol=0)


@pytest.mark.more
def test_second_derivatives_are_refused():
    def x(v):
        return end_of_stick_slip((v, 1.0, 0.5), 6.0).y1.x

    with pytest.raises(NotImplementedError, match="second derivatives"):
        jax.jacfwd(jax.jacfwd(x))(0.2)
    with pytest.raises(Exception, match="second derivatives"):
        jax.jacfwd(jax.grad(x))(0.2)


@pytest.mark.parametrize(("depth", "flag"), [(1e-10, 1), (1e-3, 0)])
def test_grazing_is_flagged(depth, flag):
    """A parabola that touches the level with next to no slope: no derivative of its event times."""
    run = ss.simulate(
        Parabola(0.0), 0.0, 4.0, State(1.0 - depth, -(2.0**0.5)), integrator=fixed(1.1, "rk4")
    )
    assert run.num_events == 2
    assert (run.flags & 1) == flag
    assert bool(run.differentiable) == (flag == 0)


def test_coincident_guards_are_flagged():
    class Corner(Circle):
        guard_names = ("falls", "also falls")

        def guards(self, t, y, mode, args):
            above = mode == 0
            return jnp.where(above, y.x - self.level, 1.0), jnp.where(
                above, 2 * (y.x - self.level), 1.0
            )

        def transition(self, t, y, mode, guard, args):
            return y, 1

    run = ss.simulate(Corner(0.3), 0.0, 2.0, State(1.0, 0.0), integrator=fixed(0.4))
    assert run.flags & 2
    assert run.num_events == 1


def test_changed_mode_sequence_is_seen_by_the_hash():
    ends = [end_of_stick_slip((v, 1.0, 0.5), 16.0) for v in (0.2, 0.2001, 0.3)]
    assert ss.same_mode_sequence(ends[0], ends[1])
    assert not ss.same_mode_sequence(ends[0], ends[2])


@pytest.mark.more
@pytest.mark.parametrize("of", ["ends", "speeds", "outputs"])
def test_a_parameter_that_lanes_share_has_the_sum_of_their_slopes(of):
    """In reverse and forward; lanes differ in a parameter, the end time, or the time of an output."""
    rows = jnp.array([10.0, 12.0, 30.0]) if of != "speeds" else jnp.array([0.2, 0.25, 0.4])

    def x(p, row):
        if of == "speeds":
            return end_of_stick_slip(p.at[0].set(row)).y1.x
        if of == "ends":
            return end_of_stick_slip(p, row).y1.x
        saved = ss.SaveAt(ts=row[None], max_events=None)
        run = ss.simulate(StickSlip(*p), 0.0, 30.0, State(0.0, p[0]), 0, integrator=fixed(0.25),
                          saveat=saved, throw=False)  # fmt: skip
        return run.outputs.y.x[0]

    def total(p):
        return jnp.sum(jax.vmap(lambda row: x(p, row))(rows))

    p = jnp.array([0.2, 1.0, 0.5])
    alone = jax.jit(jax.grad(x))
    expected = sum(alone(p, row) for row in rows)
    assert float(jnp.max(jnp.abs(expected))) > 1.0
    np.testing.assert_allclose(jax.jit(jax.grad(total))(p), expected, rtol=1e-9)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(total))(p), expected, rtol=1e-9)
