"""A linear structure with rigid contacts and stops at its nodes."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from .._argument_checks import check_arguments, number, parameters
from .._argument_checks import state as some_state
from .._types import Given, Numeric, Row
from .._validation import (
    as_parameter,
    check_known,
    check_mapping,
    check_type,
    one_number,
    one_row,
    refusal,
    shape_refusal,
)
from ..friction import AbstractFrictionLaw
from ..hybrid.accuracy import ACCURACY as ENGINE
from ..mechanism import AbstractMechanism, Contact, Stop
from ._jenkins import as_called
from ._linear_structure import LinearStructure, StructureState, load_time_scale, node_forces

REST = "rest"  # name of the coordinates that no contact touches


class NodeContact(eqx.Module):
    r"""A rigid contact with dry friction on a structure, along a row of nodes.

    Its sliding speed is $u = n\cdot\dot q - w$ [m/s]; friction acts on the nodes with $n\lambda$,
    $-\lambda \in \mu(u)N + d(u)$ [N].

    **Arguments:** `direction` $n$, known numbers, one for each node; `law`, of `stickslip.friction`;
    `normal_force` $N$ [N], 1 if left out, and `surface_speed` $w$ [m/s], 0 if left out: numbers, or
    functions of `(t, q, v, args)` with the rows of all nodes; `normal_direction`, a row too, for a
    contact that opens where its normal force falls to zero: along it that acts on the nodes.
    **Raises** `ValueError`, `TypeError` naming the argument.
    """

    direction: tuple[float, ...] = eqx.field(static=True)
    law: AbstractFrictionLaw
    normal_force: Any
    surface_speed: Any
    normal_direction: tuple[float, ...] | None = eqx.field(static=True)

    def __init__(
        self,
        direction: Row,
        law: Given[AbstractFrictionLaw],
        normal_force: Given[Numeric | Callable | None] = None,
        surface_speed: Given[Numeric | Callable | None] = None,
        normal_direction: Given[Row | None] = None,
    ):
        self.direction = _known_row("direction", direction)
        self.law = check_type("law", law, AbstractFrictionLaw, "a friction law of stickslip.friction")
        self.normal_force = _number_or_function("normal_force", normal_force, "not negative")
        self.surface_speed = _number_or_function("surface_speed", surface_speed, "finite")
        given = normal_direction
        self.normal_direction = None if given is None else _known_row("normal_direction", given)


class NodeStop(eqx.Module):
    """A rigid stop on a structure: `gap` [m] at rest, and `direction`, how it opens with each node.

    **Arguments:** `direction` $n$, known numbers, one for each node; the gap is `gap` $+ n\\cdot q$;
    `restitution` [-] and `rest_speed` [m/s] as of `stickslip.mechanism.Stop`.
    **Raises** `ValueError`, `TypeError` naming the argument.
    """

    direction: tuple[float, ...] = eqx.field(static=True)
    gap: Float[Array, "..."]
    restitution: Float[Array, "..."]
    rest_speed: Float[Array, "..."]

    @parameters(
        gap=number("finite"), restitution=number("not negative"), rest_speed=number("not negative")
    )
    def __init__(self, direction: Row, gap: Numeric, restitution: Numeric, rest_speed: Numeric = 1e-6):
        self.direction = _known_row("direction", direction)


class WithContacts(AbstractMechanism):
    r"""A `LinearStructure` with rigid contacts and stops at its nodes.

    The coordinates are the displacements $u = Nq$ along the rows $N$ of contacts and stops, and
    amplitudes $p$ of modes that these do not touch:

    $$q = A u + Z p, \qquad A = M^{-1}N^T\Lambda, \quad \Lambda = (N M^{-1} N^T)^{-1}, \quad
      N Z = 0, \quad Z^T M Z = 1$$

    Inertia is $\Lambda$ on $u$ and 1 on $p$, so the program has the size of the contacts, not of the
    structure. All else is as of an `AbstractMechanism`: set-valued friction, impacts by Newton's law,
    exact events. Two masses on springs, one of them on a belt:

    >>> import stickslip as ss
    >>> from stickslip.friction import Coulomb
    >>> from stickslip.structure import LinearStructure, NodeContact, WithContacts
    >>> chain = LinearStructure(
    ...     [[1.0, 0.0], [0.0, 1.0]], [[0.1, 0.0], [0.0, 0.1]], [[2.0, -1.0], [-1.0, 2.0]]
    ... )
    >>> pad = NodeContact([1.0, 0.0], Coulomb(0.6, 0.4), normal_force=2.0, surface_speed=0.3)
    >>> rubbed = WithContacts(chain, {"pad": pad})
    >>> run = ss.simulate(rubbed, 0.0, 20.0, rubbed.start(chain.state()))
    >>> print(rubbed.nodes(run.y1).q.round(8))
    [0.38353107 0.1379665 ]

    - State: a field for each contact and stop, its displacement, and `rest`; rates after `v_`.
      `start(y)` makes one from a `StructureState`, `nodes(y)` goes back.
    - Sliders go on it as on any mechanism, with `rubbed.along(row)` as `direction` of a `Jenkins`.

    **Arguments:** `system`, the structure; `contacts`, a mapping from names to `NodeContact` and
    `NodeStop`, whose rows are independent, those of opening contacts with their normal direction;
    `planar` as of `AbstractMechanism`, of two contacts that are one in a plane.
    **Raises** `ValueError`, `TypeError` naming the argument, `DeclarationError` for what
    `AbstractMechanism` does not cover.
    """

    basis: Float[Array, "node coordinate"]
    inertia: Float[Array, "row row"]
    damping: Float[Array, "node node"]
    stiffness: Float[Array, "node node"]
    force: Any
    rows: tuple[NodeContact | NodeStop, ...]
    row_names: tuple[str, ...] = eqx.field(static=True)
    pairs: tuple[tuple[str, str], ...] = eqx.field(static=True)

    def __init__(
        self,
        system: Given[LinearStructure],
        contacts: Given[Mapping[str, NodeContact | NodeStop]],
        planar: Given[Mapping[str, str] | None] = None,
    ):
        check_type("system", system, LinearStructure, "a LinearStructure")
        what = "a mapping from names to NodeContact and NodeStop"
        given = check_mapping("contacts", contacts, what)
        if not given:
            raise refusal("contacts", contacts, f"{what}, one at least")
        for name, one in given.items():
            check_type(
                f"contacts[{name!r}]", one, NodeContact | NodeStop, "a NodeContact or a NodeStop"
            )
        self.pairs = tuple(check_mapping("planar", {} if planar is None else planar).items())
        self.row_names, self.rows = tuple(given), tuple(given.values())
        known = self._directions
        names = [*given, *map(_normal, self.opening)]
        for name, row in known.items():
            if name == REST or names.count(name) > 1:
                allowed = f"other names than {REST!r} and those of normal directions, NAME_normal"
                raise refusal("contacts", name, allowed)
            if len(row) != system.shape[0]:
                allowed = f"a row of {system.shape[0]}, one for each node"
                raise shape_refusal(f"the direction of contacts[{name!r}]", row, allowed)
        N = np.array([*known.values()])
        values, across = np.linalg.svd(N / np.linalg.norm(N, axis=1, keepdims=True))[1:]
        if len(N) > len(across) or values.min() <= ENGINE.zero:
            raise refusal("contacts", N.tolist(), "in directions that are independent of each other")
        self.inertia, self.basis = _coordinates(system.inverse_mass, N, across[len(N) :])
        self.damping, self.stiffness, self.force = system.damping, system.stiffness, system.force

    # -- what a mechanism declares

    @property
    def _directions(self) -> dict[str, tuple[float, ...]]:
        """Rows of nodes by the name of their coordinate."""
        found = {name: one.direction for name, one in zip(self.row_names, self.rows, strict=True)}
        for name, one in self._of(NodeContact).items():
            if one.normal_direction is not None:
                found[_normal(name)] = one.normal_direction
        return found

    @property
    def coordinates(self) -> dict[str, str]:
        """One along each row, in metres, and `rest`, a row of amplitudes of modes."""
        touched, nodes = self._directions, self.stiffness.shape[-1]
        rest = {REST: "m kg^0.5"} if len(touched) < nodes else {}
        return {**dict.fromkeys(touched, "m"), **rest}

    @property
    def contact_directions(self) -> dict[str, dict[str, float]]:
        """Each contact has its own coordinate."""
        return {name: {name: 1.0} for name in self._of(NodeContact)}

    @property
    def opening(self) -> tuple[str, ...]:
        """Contacts that have a normal direction."""
        contacts = self._of(NodeContact)
        return tuple(name for name, one in contacts.items() if one.normal_direction is not None)

    @property
    def stops(self) -> tuple[str, ...]:
        """Names of the stops."""
        return tuple(self._of(NodeStop))

    @property
    def planar(self) -> dict[str, str]:
        """Of two contacts that are the axes of one in a plane, the second."""
        return dict(self.pairs)

    def _of(self, kind: type) -> dict[str, Any]:
        both = zip(self.row_names, self.rows, strict=True)
        return {name: one for name, one in both if isinstance(one, kind)}

    def mass_matrix(self, q):
        names = tuple(self._directions)
        matrix: dict[str, Any] = {
            a: {b: self.inertia[i, j] for j, b in enumerate(names)} for i, a in enumerate(names)
        }
        return {**matrix, REST: {REST: 1.0}} if REST in self.coordinates else matrix

    def forces(self, t, q, v, args):
        load = node_forces(self, t, self._at_nodes(q), self._at_nodes(v), args)
        row, size = self.basis.T @ load, len(self._directions)
        return [*row[:size], row[size:]] if REST in self.coordinates else list(row)

    def contacts(self, t, q, v, args):
        at, found = (t, self._at_nodes(q), self._at_nodes(v), args), {}
        for name, one in self._of(NodeContact).items():
            given = {"normal_force": one.normal_force, "surface_speed": one.surface_speed}
            # A number that was left out is structure, as of any mechanism.
            known = {k: x(*at) if callable(x) else x for k, x in given.items() if x is not None}
            found[name] = Contact(one.law, **known)
            if one.normal_direction is not None:
                found[name] = found[name]._replace(normal_direction={_normal(name): 1.0})
        return found

    def gaps(self, t, q, args):
        return {
            name: Stop(one.gap + getattr(q, name), one.restitution, one.rest_speed)
            for name, one in self._of(NodeStop).items()
        }

    @check_arguments(y=some_state)
    def energy(self, y):
        """Kinetic and elastic energy [J]."""
        q, v = self.to_coordinates(y)
        x, u = self._at_nodes(q), _flat(v)
        size = len(self._directions)
        touched = u[:size] @ self.inertia @ u[:size]
        return 0.5 * (touched + u[size:] @ u[size:] + x @ self.stiffness @ x)

    def declared_power(self, at, states):
        """Power [W] of all forces but friction and the stiffness, whose work is stored."""
        stored = self._at_nodes(at.q) @ self.stiffness @ self._at_nodes(at.v)
        return _flat(at.forces_in(states)) @ _flat(at.v) + stored

    def time_scale(self, args):
        """That of the force, as of the structure."""
        return load_time_scale(self.force, args)

    # -- between nodes and coordinates

    def _at_nodes(self, q: PyTree) -> Float[Array, " node"]:
        return self.basis @ _flat(q)

    @check_arguments(y=some_state)
    def nodes(self, y: PyTree) -> StructureState:
        """Displacements and velocities of all nodes in a state."""
        return StructureState(*map(self._at_nodes, self.to_coordinates(y)))

    def start(self, y: Given[StructureState]) -> Any:
        """The state with these displacements and velocities of the nodes."""
        check_type("y", y, StructureState, "a StructureState, as `state` of the structure makes it")
        N, names = np.array([*self._directions.values()]), self.names
        for name, row in zip(y._fields, y, strict=True):
            if np.shape(row) != N.shape[1:]:
                raise shape_refusal(f"y.{name}", row, f"a row of {N.shape[1]}, one for each node")
        # Along contacts exact, so that a node at rest on a surface starts so.
        rest = jnp.linalg.solve(self.basis, jnp.stack(y, axis=1))[len(N) :].T
        found = [[*(N @ row), *([x] if len(x) else [])] for row, x in zip(y, rest, strict=True)]
        return self._kind((*names.kept, *names.velocities))(*found[0], *found[1])

    def along(self, direction: Row) -> Callable:
        """Elongation along a row of nodes by the coordinates, a `direction` of `Jenkins`."""
        return Elongation(as_parameter(one_row("direction", direction)) @ self.basis)


@jax.jit
def _coordinates(inverse_mass: Any, N: Any, null: Any) -> tuple[Any, Any]:
    """Inertia along the rows `N`, and the basis; `null` are rows at right angles to these."""
    inertia = jnp.linalg.inv(N @ inverse_mass @ N.T)
    inertia = 0.5 * (inertia + inertia.T)
    touched = inverse_mass @ N.T @ inertia
    # Z = null^T L^-T with L L^T = null M null^T.
    root = jnp.linalg.cholesky(null @ jnp.linalg.inv(inverse_mass) @ null.T)
    rest = jnp.linalg.solve(root, null).T
    return inertia, jnp.concatenate([touched, rest], axis=1)


class Elongation(eqx.Module):
    """A linear function of all coordinates."""

    row: Float[Array, " coordinate"]

    def __call__(self, q: PyTree) -> Any:
        return self.row @ _flat(q)


def _flat(parts: Sequence[Any]) -> Float[Array, " coordinate"]:
    return jnp.concatenate([jnp.ravel(jnp.asarray(x, jnp.float64)) for x in parts])


def _normal(name: str) -> str:
    return f"{name}_normal"


def _known_row(name: str, value: Any) -> tuple[float, ...]:
    row = np.asarray(one_row(name, check_known(name, value)), float)
    if not row.any():
        raise refusal(name, value, "numbers of which one at least is not 0")
    return tuple(row.tolist())


def _number_or_function(name: str, value: Any, kind: str) -> Any:
    if callable(value):
        return as_called(name, value, f"{name}(t, q, v, args)", 0, 0, 0, 0)
    return None if value is None else as_parameter(one_number(name, value, kind))
