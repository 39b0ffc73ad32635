"""The program of multiple shooting: segments between knots, each from a state of its own."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Bool, Float, Int

from ..hybrid import jit_plainly
from ._losses import AbstractLoss
from ._methods import AbstractIterativeMethod
from ._run import Data, Run
from ._unknowns import NamedValues, Space


class Segments(eqx.Module):
    """Stamps between knots, one row a segment, made equally long by repeating the last.

    - `record`, `first`: number of the record, and whether the segment begins with it.
    - `begin`: time of the knot. `times`: the last of each row is the next knot.
    - `values`, `keep`: as in `Data`. `inner`: the segments that begin at a knot.
    """

    record: Int[Array | np.ndarray, " segment"]
    first: Bool[Array | np.ndarray, " segment"]
    begin: Float[Array | np.ndarray, " segment"]
    times: Float[Array | np.ndarray, "segment time"]
    values: Float[Array | np.ndarray, "segment observed time"]
    keep: Int[Array | np.ndarray, " row"]
    inner: Int[Array | np.ndarray, " knot"]


def segments_of(data: Data, count: int) -> Segments:
    """The records cut at stamps, each into `count` segments of as many stamps, to one."""
    rows = []
    for r, n in enumerate(data.lengths):
        ends = np.unique(np.round(np.linspace(0, n - 1, count + 1)).astype(int))[1:]
        begins = np.concatenate([[-1], ends[:-1]])
        rows += [(r, i + 1, j + 1) for i, j in zip(begins, ends, strict=True)]
    longest = max(j - i for _, i, j in rows)
    observed = data.values.shape[1]
    values = np.zeros((len(rows), observed, longest))
    kept = np.zeros(values.shape, bool)
    times = np.zeros((len(rows), longest))
    for g, (r, i, j) in enumerate(rows):
        times[g] = np.pad(data.times[r, i:j], (0, longest - (j - i)), mode="edge")
        values[g, :, : j - i] = data.values[r, :, i:j]
        kept[g, :, : j - i] = data.present[r, :, i:j]
    first = np.array([i == 0 for _, i, _ in rows])
    begin = [data.begin[r] if i == 0 else data.times[r, i - 1] for r, i, _ in rows]
    return Segments(
        record=np.array([r for r, _, _ in rows]),
        first=first,
        begin=np.array(begin),
        times=times,
        values=values,
        keep=np.flatnonzero(kept),
        inner=np.flatnonzero(~first),
    )


class Shooting(eqx.Module):
    """Residual and Jacobian of segments: deviations from the data, and jumps of the state at knots.

    `scales` of the components of the state; `weight` $w$: a jump counts in units of $w$ times those.
    """

    run: Run = eqx.field(static=True)
    space: Space
    data: Data
    segments: Segments
    scales: Float[Array, " component"]
    weight: Float[Array, ""]
    loss: AbstractLoss | None

    def segment(self, z: Array, state: Array, row: tuple) -> tuple[Array, Array]:
        """Observations of one segment, and the state at its end."""
        record, first, begin, times = row
        values, inputs = self.run.of_record(self.space.values(z), self.data, record)
        flat, unravel = ravel_pytree(self.run.start(values, inputs))
        y0 = unravel(jnp.where(first, flat, state))
        ts = self.run.times_of(values, times, self.data.begin_of(record))
        begin = jnp.where(first, begin, self.run.times_of(values, begin, self.data.begin_of(record)))
        system, breaks = self.run.system_of(values, inputs)
        states, _ = self.run.motion(system, breaks, y0, begin, ts)
        last = jax.tree.map(lambda a: a[-1], states)
        return self.run.observe(system, ts, states), ravel_pytree(last)[0]

    def __call__(self, unknown: Float[Array, " unknown"]) -> tuple[Array, Array]:
        """Row of residuals, its Jacobian by coordinates of the unknowns and states of the knots."""
        segments, p, n = self.segments, len(self.space.names), self.scales.shape[0]
        z, inner = unknown[:p], jnp.asarray(segments.inner)
        count, knots = segments.first.shape[0], inner.shape[0]
        scales = self.scales[None, :]
        states = jnp.zeros((count, n)).at[inner].set(unknown[p:].reshape(knots, n) * scales)
        rows = (segments.record, segments.first, segments.begin, segments.times)

        def one(row):
            state, rest = row

            def twice(both):
                out = self.segment(both[:p], both[p:] * self.scales, rest)
                return out, out

            slopes, out = jax.jacfwd(twice, has_aux=True)(jnp.concatenate([z, state / self.scales]))
            return out, slopes

        (model, ends), (d_model, d_ends) = jax.lax.map(one, (states, jax.tree.map(jnp.asarray, rows)))
        # Data: the columns of the unknowns, then those of the segment's own state.
        sd = self.data.deviations[None, :, None]
        off = ((model - segments.values) / sd).reshape(-1)
        d_off = d_model / sd[..., None]
        own = jnp.zeros((count, knots)).at[inner, jnp.arange(knots)].set(1.0)
        by_state = jnp.einsum("gotn,gk->gotkn", d_off[..., p:], own)
        wide = jnp.concatenate([d_off[..., :p], by_state.reshape(*model.shape, knots * n)], axis=-1)
        data, d_data = off[segments.keep], wide.reshape(off.size, -1)[segments.keep]
        if self.loss is not None:
            data, d_data = _weigh(self.loss, data, d_data)
        # Jumps: the end of the segment before a knot, less the state of the knot.
        before = inner - 1
        jump = (ends[before] / scales - unknown[p:].reshape(knots, n)) / self.weight
        d_jump = d_ends[before] / self.scales[None, :, None] / self.weight
        by_before = jnp.einsum("kmn,kj->kmjn", d_jump[..., p:], own[before])
        by_itself = jnp.einsum("mn,kj->kmjn", jnp.eye(n), jnp.eye(knots)) / self.weight
        d_state = (by_before - by_itself).reshape(knots * n, knots * n)
        d_jumps = jnp.concatenate([d_jump[..., :p].reshape(knots * n, p), d_state], axis=-1)

        def priors(z):
            return self.space.prior_rows(self.space.values(z))

        prior = priors(z)
        d_prior = jnp.pad(jax.jacfwd(priors)(z), ((0, 0), (0, knots * n)))
        return (
            jnp.concatenate([data, jump.reshape(-1), prior]),
            jnp.concatenate([d_data, d_jumps, d_prior]),
        )


def _weigh(loss: AbstractLoss, row: Array, matrix: Array) -> tuple[Array, Array]:
    weighed, slope = jax.jvp(lambda r: r * loss.weight(r), (row,), (jnp.ones_like(row),))
    return weighed, slope[:, None] * matrix


@jit_plainly
def minimise(
    method: AbstractIterativeMethod, shooting: Shooting, unknown: Array
) -> tuple[Array, Array, Array]:
    """`method` on the segments: unknowns, cost, and steps taken."""
    once = jax.jit(lambda unknown: shooting(unknown))
    rows = jax.eval_shape(once, unknown)[0].shape[0]

    def step(now):
        return method.advance(now, *once(now.z))

    start = method.begin(unknown, rows, shooting.space)
    end = jax.lax.while_loop(lambda now: ~now.done, step, start)
    z, residual = end.kept[:2]
    return z, 0.5 * jnp.sum(residual**2), end.steps


@jit_plainly
def residual_and_jacobian(shooting: Shooting, unknown: Array) -> tuple[Array, Array]:
    """`shooting(unknown)`, compiled."""
    return shooting(unknown)


@jit_plainly
def states_at(run: Run, values: NamedValues, data: Data, segments: Segments) -> Array:
    """States at the knots of runs from the beginning, one row a knot."""
    common, local = run.split(values)

    def states(row):
        mine, known, (times, begin, inputs) = row
        here = {**known, **common, **mine}
        ts = run.times_of(here, times, begin)
        system, breaks = run.system_of(here, inputs)
        states, _ = run.motion(system, breaks, run.start(here, inputs), begin, ts)
        return jax.vmap(lambda y: ravel_pytree(y)[0])(states)

    every = jax.lax.map(states, (local, data.known, (data.times, data.begin, data.inputs)))
    record = jnp.asarray(segments.record)[segments.inner]
    times = jnp.asarray(data.times)[record]
    knots = jnp.asarray(segments.begin)[segments.inner]
    return every[record, jnp.argmax(times >= knots[:, None], axis=1)]
