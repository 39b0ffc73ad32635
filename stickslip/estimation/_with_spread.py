"""A hybrid system together with the spread of its states: how a covariance moves."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from ..analysis.held_directions import held_directions
from ..derived import WithDeviations
from ..hybrid import AbstractHybridSystem, AbstractSystemWrapper


class Spread(NamedTuple):
    """State, transition matrix and covariance of the noise since the start, intensity of the noise."""

    y: PyTree
    transition: Float[Array, "n n"]
    noise: Float[Array, "n n"]
    intensity: Float[Array, "n n"]


class WithSpread(AbstractSystemWrapper):
    r"""The same system with its transition matrix $\Phi$ and the covariance $W$ of a noise.

    Inside a mode $\dot\Phi = f_y\Phi$ and $\dot W = f_yW + Wf_y^T + Q_m$, at an event $\Phi^+ = S\Phi$
    and $W^+ = SWS^T$ with the saltation matrix $S$. `density`: square roots of the intensities of
    white noise in the rates of the flattened state, of which a mode keeps what it allows,
    $Q_m = \Pi\,\mathrm{diag}(d^2)\,\Pi$.
    """

    system: AbstractHybridSystem
    density: Float[Array, " n"]

    def inner(self, y, args):
        return y.y, args

    def start(self, t, y, mode, args) -> Spread:
        still = jnp.zeros((self.density.size, self.density.size))
        intensity = self._intensity(self.held(t, y, mode, args))
        return Spread(y, jnp.eye(self.density.size), still, intensity)

    def held(self, t, y, mode, args) -> Float[Array, "n n"]:
        """Projection on the deviations that the mode allows."""
        ones = jnp.ones(self.density.size)
        return held_directions(self.system, t, y, mode, args, ones, ones)

    def _intensity(self, held):
        columns = held * self.density[None, :]
        return columns @ columns.T

    def _tangent(self, y):
        tangent = WithDeviations(self.system)
        return tangent, tangent.start(y, jnp.eye(self.density.size))

    def vector_field(self, t, y, mode, args):
        tangent, state = self._tangent(y.y)
        rates = tangent.vector_field(t, state, mode, args)
        slope = tangent.columns(rates)
        noise = slope @ y.noise
        still = jnp.zeros_like(y.intensity)
        return Spread(rates.y, slope @ y.transition, noise + noise.T + y.intensity, still)

    def transition(self, t, y, mode, guard, args):
        tangent, state = self._tangent(y.y)
        after, mode = tangent.transition(t, state, mode, guard, args)
        # The saltation matrix keeps to what the mode allows, but for its last digit.
        held = self.held(t, after.y, mode, args)
        saltation = held @ tangent.columns(after)
        noise = saltation @ y.noise @ saltation.T
        return Spread(after.y, saltation @ y.transition, noise, self._intensity(held)), mode
