"""How far the stage is from its records: commands under the controller, positions open loop."""

from typing import Any

import jax.numpy as jnp
import numpy as np

from ._record import Record
from ._stage import command, position

SIGMA = 0.05  # of a mean command [V]: what the residuals show
SIGMA_Q = 1e-3  # of a position, open loop [m]


def blocks(row: Any, kept: int) -> Any:
    """Means over `kept` samples at a time, of what is measured and of what is computed alike."""
    whole = row.shape[0] // kept * kept
    return row[:whole].reshape(-1, kept).mean(axis=1)


def commands(values: dict[str, Any], records: list[Record], kept: int) -> Any:
    """Mean commands under the controller [V], of one record after the other."""
    return jnp.concatenate([blocks(command(values, record, 1), kept) for record in records])


def by_command(records: list[Record], measured: Any, kept: int):
    """Residuals of the command under the controller, in standard deviations."""

    def residual(values):
        return (commands(values, records, kept) - measured) / SIGMA

    return residual


def by_position(records: list[Record], every: int):
    """Residuals of the position open loop, in standard deviations."""

    def residual(values):
        rows = [position(values, record, every) - record.q[::every] for record in records]
        return jnp.concatenate(rows) / SIGMA_Q

    return residual


def joined(records: list[Record], row: Any) -> np.ndarray:
    """One row of numbers of all records."""
    return np.concatenate([row(record) for record in records])
