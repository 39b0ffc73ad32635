"""A block on rough ground under random loads, and a march by hand that knows nothing of events."""

import functools
from typing import Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss
from stickslip.systems import Motion

END = 30.0
KINDS = ("two tones", "tones and pulses", "pulses", "steps", "chirp", "ramp", "all")


class Load(NamedTuple):
    """Two tones, two Gaussian pulses, two steps that last, a chirp and a ramp."""

    tone: Any
    omega: Any
    phase: Any
    pulse: Any
    pulse_at: Any
    pulse_width: Any
    step: Any
    step_at: Any
    step_lasts: Any
    chirp: Any
    chirp_omega: Any
    chirp_rate: Any
    ramp: Any
    ramp_at: Any
    ramp_lasts: Any

    def __call__(self, t):
        """Force [N]."""
        inside = (t >= self.step_at) & (t < self.step_at + self.step_lasts)
        return (
            jnp.sum(self.tone * jnp.sin(self.omega * t + self.phase))
            + jnp.sum(self.pulse * jnp.exp(-(((t - self.pulse_at) / self.pulse_width) ** 2)))
            + jnp.sum(jnp.where(inside, self.step, 0.0))
            + self.chirp * jnp.sin(self.chirp_omega * t + 0.5 * self.chirp_rate * t * t)
            + self.ramp * jnp.clip((t - self.ramp_at) / self.ramp_lasts, 0.0, 1.0)
        )

    @property
    def breaks(self):
        """Times at which the steps jump [s]."""
        return jnp.sort(jnp.concatenate([self.step_at, self.step_at + self.step_lasts]))


class Block(ss.AbstractHybridSystem):
    """1 kg on rough ground: 1 N at rest, 0.5 N in motion."""

    load: Load

    mode_names: ClassVar = ("backward", "rest", "forward")
    guard_names: ClassVar = ("stops", "starts forward", "starts backward")
    units: ClassVar = {"x": "m", "v": "m/s"}

    def vector_field(self, t, y, mode, args):
        sense = jnp.where(mode == 0, -1.0, 1.0)
        return Motion(x=y.v, v=jnp.where(mode == 1, 0.0, self.load(t) - 0.5 * sense))

    def guards(self, t, y, mode, args):
        sense, force = jnp.where(mode == 0, -1.0, 1.0), self.load(t)
        return (
            jnp.where(mode == 1, 1.0, sense * y.v),
            jnp.where(mode == 1, 1.0 - force, 1.0),
            jnp.where(mode == 1, 1.0 + force, 1.0),
        )

    def transition(self, t, y, mode, guard, args):
        stopped = self.initial_mode(t, y, args)
        return Motion(y.x, 0.0 * y.v), jnp.where(guard == 0, stopped, jnp.where(guard == 1, 2, 0))

    def initial_mode(self, t, y, args):
        force = self.load(t)
        return jnp.where(force > 1.0, 2, jnp.where(force < -1.0, 0, 1))


def random_loads(number: int, seed: int) -> tuple[Load, np.ndarray]:
    """Loads, one a row, and their kinds."""
    rng = np.random.default_rng(seed)
    none = np.zeros(2)
    rows, kinds = [], []
    for _ in range(number):
        kind = KINDS[rng.integers(len(KINDS))]
        row: dict[str, Any] = dict.fromkeys(Load._fields, 0.0) | dict.fromkeys(Load._fields[:9], none)
        row |= dict(omega=none + 1, pulse_width=none + 1, chirp_omega=1.0, ramp_lasts=1.0)
        row["step_at"] = np.array([END + 1.0, END + 3.0])
        row["step_lasts"] = none + 1
        if kind in ("two tones", "tones and pulses", "all"):
            row["tone"] = rng.uniform(0.3 if kind == "two tones" else 0.0, 0.9, 2)
        if kind == "ramp":
            row["tone"] = rng.uniform(0, 0.4, 2)
            row |= dict(ramp=rng.uniform(0.5, 1.5), ramp_at=rng.uniform(0, END))
            row["ramp_lasts"] = 10 ** rng.uniform(-1, 1)
        row["omega"], row["phase"] = 10 ** rng.uniform(-0.7, 1.2, 2), rng.uniform(0, 2 * np.pi, 2)
        if kind in ("tones and pulses", "pulses", "all"):
            row |= dict(pulse=rng.uniform(-2, 2, 2), pulse_at=rng.uniform(0, END, 2))
            row["pulse_width"] = 10 ** rng.uniform(-1, 0.5, 2)
        if kind in ("steps", "all"):
            row |= dict(step=rng.uniform(-2, 2, 2), step_at=rng.uniform(0, END, 2))
            row["step_lasts"] = 10 ** rng.uniform(-1, 0.7, 2)
        if kind == "chirp":
            row |= dict(chirp=rng.uniform(0.9, 1.5), chirp_omega=rng.uniform(0.1, 3))
            row["chirp_rate"] = rng.uniform(0, 1)
        rows.append(Load(**row))
        kinds.append(kind)
    stacked = jax.tree.map(lambda *a: jnp.asarray(np.stack([np.asarray(x, float) for x in a])), *rows)
    return stacked, np.array(kinds)


@functools.partial(jax.jit, static_argnums=1)
@functools.partial(jax.vmap, in_axes=(0, None))
def march(load: Load, number: int):
    """x at the end and the number of starts and stops, by `number` steps and some that end at jumps.

    Within a step the load is the parabola through its beginning, middle and end, the speed and the
    way are its integrals, and up to two events are looked for, one after the other, by the sign at the
    end of what is left of the step.
    """
    edges = jnp.linspace(0.0, END, number + 1)
    edges = jnp.sort(jnp.concatenate([edges, jnp.clip(load.breaks, 0.0, END)]))

    def starts(force):
        return jnp.where(force > 1.0, 1.0, jnp.where(force < -1.0, -1.0, 0.0))

    def root(function, slope, low):
        """Where between `low` and 1 a function that changes its sign there is zero."""
        begin, end = function(low), function(1.0)
        s = low + (1.0 - low) * begin / jnp.where(begin == end, 1.0, begin - end)
        for _ in range(4):
            rate = slope(s)
            s = jnp.clip(s - function(s) / jnp.where(rate == 0.0, 1.0, rate), low, 1.0)
        return s

    def step(carry, ends):
        begin, end = ends
        h = end - begin
        inside = 1e-9 * h  # the load of this side of a jump
        f0, f1, f2 = load(begin + inside), load(0.5 * (begin + end)), load(end - inside)
        b, c = 4.0 * f1 - 3.0 * f0 - f2, 2.0 * (f0 + f2) - 4.0 * f1

        def force(s):
            return f0 + s * (b + s * c)

        def gained(s):
            """Integral of the force."""
            return h * s * (f0 + s * (b / 2 + s * c / 3))

        def gone(s):
            """Integral of what was gained."""
            return h * h * s * s * (f0 / 2 + s * (b / 6 + s * c / 12))

        def until(carry, low, last):
            """From `low` to the next event, which the `last` part has none of, or to the end."""
            x, v, sense, events = carry
            rests, friction = sense == 0.0, 0.5 * sense

            def speed(s):
                return v + gained(s) - gained(low) - friction * h * (s - low)

            go = starts(f2)
            loose = root(lambda s: go * force(s) - 1.0, lambda s: go * (b + 2.0 * c * s), low)
            halt = root(speed, lambda s: h * (force(s) - friction), low)
            happens = jnp.where(rests, go != 0.0, speed(1.0) * sense < 0.0) & (not last)
            s = jnp.where(happens, jnp.where(rests, loose, halt), 1.0)
            left = h * (s - low)
            way = v * left + gone(s) - gone(low) - gained(low) * left - friction * left**2 / 2
            return (
                x + jnp.where(rests, 0.0, way),
                jnp.where(happens | rests, 0.0, speed(s)),
                jnp.where(happens, jnp.where(rests, go, starts(force(s))), sense),
                events + happens.astype(jnp.int32),
            ), s

        # A jump of the load may set a resting block in motion at the beginning of the step.
        x, v, sense, events = carry
        at_once = jnp.where(sense == 0.0, starts(f0), 0.0)
        carry = x, v, sense + at_once, events + (at_once != 0.0).astype(jnp.int32)
        low = jnp.zeros(())
        for last in (False, False, True):
            carry, low = until(carry, low, last)
        return carry, None

    begin = load(jnp.zeros(()))
    carry = (jnp.zeros(()), jnp.zeros(()), starts(begin), jnp.zeros((), jnp.int32))
    x, _, _, events = jax.lax.scan(step, carry, (edges[:-1], edges[1:]))[0]
    return x, events
