"""A sweep before it is computed: how each block is evaluated, what is kept, and what identifies it."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from .._validation import refusal
from ._labels import Variable
from ._layout import Layout
from ._manifest import FORMAT, as_json, code_revision, digest, versions
from ._programs import Identity
from .evaluate import Evaluate, output_names
from .grid import Block, blocks
from .lanes import map_lanes
from .settings import Settings


@dataclasses.dataclass(frozen=True)
class Described:
    """All that is known of a sweep once its function is traced."""

    evaluate: Evaluate
    layout: Layout
    manifest: dict[str, Any]
    program: Identity

    def pieces(self, sides: tuple[int, ...]) -> list[Block]:
        """Blocks of these sides in the order of computation."""
        evaluate = self.evaluate
        return blocks(self.layout.shape, sides, evaluate.axis if evaluate.backward else None)

    @property
    def units(self) -> list[Block]:
        """Pieces that are written at a time: blocks, or shards of them."""
        return self.pieces(self.layout.shard)


def describe(
    function: Callable,
    coords: Mapping[str, np.ndarray],
    settings: Settings,
    *,
    sides: tuple[int, ...],
    shards: tuple[int, ...],
    inputs: Mapping[str, PyTree],
    carry: PyTree = None,
    axis: int | None = None,
    backward: bool = False,
    refine: Mapping[str, Any] | None = None,
    step: Mapping[str, Any] | None = None,
    program: Identity | None = None,
) -> Described:
    """Trace the function and say which sweep it is.

    - `refine`: what the sweep is refined by, which its own numbers do not depend on.
    - `step`: which points of a refinement these are, where they are not those of a grid.
    - `program`: of the same function, where it was traced before.
    """
    labels: Any = settings.labels  # all of whose fields are mappings once it is made
    evaluate = Evaluate(
        function, coords, inputs, sides, carry, axis, backward, settings.compute.executor,
        settings.compute.threads,
    )  # fmt: skip
    outputs = _labelled_outputs(evaluate.output_shapes(), coords, labels.variables)
    layout = Layout(
        coords=coords,
        outputs=outputs,
        sides=sides,
        shard=shards,
        labels=labels.variables,
        attrs={"title": settings.name, **as_json(labels.attrs)},
        refine=refine,
    )
    program = evaluate.program() if program is None else program
    manifest = {
        "format": FORMAT,
        # In this order: blocks of a square grid look alike in any.
        "coordinates": list(coords),
        "grid": {
            key: {
                "size": values.size,
                "first": float(values[0]),
                "last": float(values[-1]),
                "sha256": digest(values),
            }
            for key, values in coords.items()
        },
        "block": list(sides),
        "shard": list(shards),
        "carried": None
        if axis is None
        else {
            "along": list(coords)[axis],
            "backward": backward,
            "start": as_json(carry),
            "sha256": digest(*map(np.asarray, jax.tree.leaves(carry))),
        },
        "inputs": {key: digest(*jax.tree.leaves(value)) for key, value in inputs.items()},
        "outputs": {
            key: {"shape": list(tail), "dtype": str(dtype), "dims": list(label.dims)}
            for key, (tail, dtype, label) in outputs.items()
        },
        "settings": as_json(labels.settings),
        "program": program.digest,
        "host_code": list(program.unknown),
        "computed_with": computed_with(evaluate.lanes),
        **({} if settings.storage.hosts == "alike" else {"hosts": settings.storage.hosts}),
        **({} if step is None else {"refine": dict(step)}),
        "attributes": layout.attributes(),
        "information": {"versions": versions(), "code_revision": code_revision()},
    }
    return Described(evaluate, layout, manifest, program)


def computed_with(lanes: map_lanes) -> dict[str, str]:
    """Software that the numbers of these lanes go through on this host."""
    return {
        "executor": lanes.executor,
        "backend": jax.default_backend(),
        **{key: versions()[key] for key in ("jax", "jaxlib")},
    }


def _labelled_outputs(shapes, coords, variables):
    outputs = {}
    for key, struct in output_names(shapes).items():
        label = variables.get(key, Variable())
        dims = label.dims or tuple(f"{key}_{i}" for i in range(len(struct.shape)))
        if len(dims) != len(struct.shape):
            named = f"names of the {len(struct.shape)} axes of a result of shape {struct.shape}"
            raise refusal(f"variables[{key!r}].dims", dims, named)
        if key in coords:
            raise refusal("function", key, "one whose results are not named like a coordinate")
        label = Variable(dims, label.units, label.long_name, label.attrs)
        outputs[key] = (tuple(struct.shape), np.dtype(struct.dtype), label)
    unknown = set(variables) - set(outputs) - set(coords)
    if unknown:
        key = sorted(unknown)[0]
        known = ", ".join(map(repr, [*coords, *outputs]))
        raise refusal(f"variables[{key!r}]", variables[key], f"a label of one of {known}")
    return outputs
