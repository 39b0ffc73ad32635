"""A linear structure by its matrices, as a finite-element model gives them, under any load."""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import OBSERVABLE, check_arguments, parameters
from .._argument_checks import state as some_state
from .._types import Given, Numeric, Row, Rows
from .._validation import as_parameter, check_finite, is_concrete, refusal, shape_refusal
from ..hybrid import AbstractSmoothSystem
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..mechanism import AbstractMechanicalSystem
from ._jenkins import as_called


class StructureState(NamedTuple):
    """Displacements `q` [m] of all nodes and their velocities `v` [m/s], each a row."""

    q: Any
    v: Any


class HarmonicForce(eqx.Module):
    r"""A force $F\cos(\omega t + \varphi)$ on the nodes of a structure.

    **Arguments:** `amplitude` $F$ [N], a row with a number for each node; `frequency` $\omega$ [rad/s],
    positive; `phase` $\varphi$ [rad], one number or a row. All are parameters.
    **Raises** `ValueError`, `TypeError` naming the argument.
    """

    amplitude: Float[Array, "..."]
    frequency: Float[Array, "..."]
    phase: Float[Array, "..."]

    @parameters(amplitude="finite", frequency="positive", phase="finite")
    def __init__(self, amplitude: Row, frequency: Numeric, phase: Numeric = 0.0):
        if not np.shape(amplitude):
            raise shape_refusal("amplitude", amplitude, "a row, a number for each node")

    def __call__(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Float[Array, " node"]:
        return self.amplitude * jnp.cos(self.frequency * t + self.phase)

    def time_scale(self, args: PyTree) -> Any:
        """Time in which the force changes by its own size [s]."""
        return 1.0 / self.frequency


class LinearStructure(AbstractSmoothSystem, AbstractMechanicalSystem):
    r"""A linear structure, $M\ddot q + C\dot q + K q = f(t, q, \dot q)$, in arrays.

    Its matrices are those of an assembled or reduced model (`craig_bampton`); friction comes from
    `WithSliders` and `WithContacts`. Two masses on springs, the second one pulled:

    >>> import stickslip as ss
    >>> from stickslip.structure import HarmonicForce, LinearStructure
    >>> chain = LinearStructure(
    ...     [[1.0, 0.0], [0.0, 2.0]], [[0.0, 0.0], [0.0, 0.0]], [[2.0, -1.0], [-1.0, 1.0]],
    ...     HarmonicForce([0.0, 0.5], 0.3),
    ... )
    >>> run = ss.simulate(chain, 0.0, 10.0, chain.state())
    >>> chain.frequencies().round(6).tolist()
    [0.468213, 1.510224]

    - State `StructureState(q, v)`, rows; `state(q, v)` makes one, at rest if left out.
    - `mass`, `damping`, `stiffness`: square matrices `[node, node]` [kg, N s/m, N/m]. Mass and
      stiffness are symmetric, the mass positive definite. Damping may be gyroscopic; `modal_damping`
      makes it from ratios.
    - `force`: a function `force(t, q, v, args)` that returns a row [N], None for none. An
      `equinox.Module` with that `__call__`, as `HarmonicForce`, has parameters; its method
      `time_scale(args)`, if it has one, is that of the structure.

    **Raises** `ValueError`, `TypeError` naming the argument.
    """

    inverse_mass: Float[Array, "node node"]
    damping: Float[Array, "node node"]
    stiffness: Float[Array, "node node"]
    force: Any

    units: ClassVar = {"q": "m", "v": "m/s"}
    parameter_units: ClassVar = {"inverse_mass": "1/kg", "damping": "N s/m", "stiffness": "N/m"}

    def __init__(
        self, mass: Rows, damping: Rows, stiffness: Rows, force: Given[Callable | None] = None
    ):
        M = square("mass", mass)
        self.damping = square("damping", damping, M.shape)
        self.stiffness = symmetric("stiffness", square("stiffness", stiffness, M.shape))
        symmetric("mass", M)
        if is_concrete(M) and np.linalg.eigvalsh(np.asarray(M)).min() <= 0.0:
            raise refusal("mass", np.asarray(M).tolist(), "positive definite")
        self.inverse_mass = jnp.linalg.inv(M)
        call = "force(t, q, v, args)"
        self.force = None if force is None else as_called("force", force, call, 0, 0, 0, 0)

    @property
    def mass(self) -> Float[Array, "node node"]:
        """Mass matrix [kg]."""
        return jnp.linalg.inv(self.inverse_mass)

    @property
    def shape(self) -> tuple[int]:
        """Shape of a row: the number of nodes."""
        return (self.stiffness.shape[-1],)

    def frequencies(self) -> np.ndarray:
        """Angular frequencies of the undamped structure without forces [rad/s], lowest first."""
        root = np.linalg.cholesky(np.asarray(self.inverse_mass))
        squares = np.linalg.eigvalsh(root.T @ np.asarray(self.stiffness) @ root)
        return np.sqrt(np.maximum(squares, 0.0))

    def state(self, q: Row | None = None, v: Row | None = None) -> StructureState:
        """A state by its rows; what is left out is 0.

        **Raises** `ValueError`, `TypeError` for rows of another length or numbers that are not finite.
        """
        rows = []
        for name, given in (("q", q), ("v", v)):
            row: Any = np.zeros(self.shape) if given is None else given
            if np.shape(check_finite(name, row)) != self.shape:
                raise shape_refusal(name, row, f"a row of {self.shape[0]}, one for each node")
            rows.append(as_parameter(row))
        return StructureState(*rows)

    def to_coordinates(self, y: StructureState) -> tuple[Any, Any]:
        """Displacements and velocities of a state."""
        return y.q, y.v

    def time_scale(self, args):
        """That of the force, where it says one; infinity without a force."""
        return load_time_scale(self.force, args)

    def forces(self, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Float[Array, " node"]:
        """All forces but those of inertia [N]."""
        return node_forces(self, t, q, v, args)

    def check_start(self, t, y, mode, args):
        """Raise `TypeError`, `ValueError` for what is not a state of this structure."""
        for name in ("q", "v"):
            row: Any = getattr(y, name, None)
            if np.shape(row) != self.shape:
                allowed = f"a StructureState with rows of {self.shape[0]}, as `state` makes it"
                raise refusal("y0", y, allowed, TypeError)

    def vector_field(self, t, y, mode, args):
        return StructureState(y.v, self.inverse_mass @ self.forces(t, y.q, y.v, args))

    def constraints(self, t, y, mode, args):
        """None of the motion is held."""
        return ()

    @check_arguments(y=some_state)
    def energy(self, y):
        """Kinetic and elastic energy [J]."""
        return 0.5 * (y.v @ self.mass @ y.v + y.q @ self.stiffness @ y.q)

    @check_arguments(**OBSERVABLE)
    def powers(self, t, y, mode, args):
        """Powers into the energy [W]: of the `forces`, and of the `damping`."""
        lost = y.v @ self.damping @ y.v
        stored = y.v @ self.stiffness @ y.q
        return {"forces": self.forces(t, y.q, y.v, args) @ y.v + stored + lost, "damping": -lost}


def node_forces(of: Any, t: Numeric, q: PyTree, v: PyTree, args: PyTree) -> Float[Array, " node"]:
    """Forces of what has a `stiffness`, a `damping` and a `force` of nodes."""
    inner = of.stiffness @ q + of.damping @ v
    if of.force is None:
        return -inner
    load = jnp.asarray(of.force(t, q, v, args), jnp.float64)
    if load.shape != inner.shape:
        raise shape_refusal("force(t, q, v, args)", load, f"a row of {inner.size}")
    return load - inner


def load_time_scale(force: Any, args: PyTree) -> Any:
    """Time scale that a force says, None if it does not; infinity without a force."""
    if force is None:
        return jnp.inf
    known = getattr(force, "time_scale", None)
    return None if known is None else known(args)


def square(name: str, value: Any, shape: Any = None) -> Any:
    """A square matrix of finite numbers, of a shape if it is given."""
    matrix = as_parameter(check_finite(name, value))
    if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
        raise shape_refusal(name, value, "a square matrix")
    if shape is not None and matrix.shape != shape:
        raise shape_refusal(name, value, f"of shape {shape}, that of the mass")
    return matrix


def symmetric(name: str, matrix: Any) -> Any:
    """A matrix that is symmetric, where it is known."""
    if is_concrete(matrix):
        numbers = np.asarray(matrix)
        if np.abs(numbers - numbers.T).max() > ENGINE.zero * np.abs(numbers).max():
            raise refusal(name, numbers.tolist(), "symmetric")
    return matrix
