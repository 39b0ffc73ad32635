"""How well a set of parameters does what the paper says, from a few belt speeds."""

import numpy as np

from ._judge import SINGLE
from ._model import SLIP_ABOVE, STICK_SLIP_BELOW

# Within the ranges of the text, up to near their borders.
SPEEDS = np.array(
    [3e-4, 1e-3, 1.8e-3, 2.3e-3, 2.8e-3, 4.5e-3, 6.3e-3, 8.3e-3, 1e-2, 1.5e-2, 2e-2, 2.9e-2]
)
ITEMS = ("C2", "C3", "C4a", "C4b", "C5")


def items(
    y_width: np.ndarray, w_width: np.ndarray, w_size: np.ndarray, per_contact: np.ndarray
) -> np.ndarray:
    """Share of the speeds `SPEEDS` at which each claim holds, `[..., item]`; inputs `[..., speed]`.

    C2 counts half for w being a single curve and half for its growth from speed to speed.
    """
    slow, fast = SPEEDS < STICK_SLIP_BELOW, SPEEDS > SLIP_ABOVE
    middle = ~slow & ~fast
    free = per_contact == 0
    grows = np.diff(w_size, axis=-1) > 0
    claims = (
        0.5 * (w_width < SINGLE).mean(axis=-1) + 0.5 * grows.mean(axis=-1),
        (per_contact[..., slow] > 0.98).mean(axis=-1),
        (y_width[..., middle] > SINGLE).mean(axis=-1),
        free[..., middle].mean(axis=-1),
        (free & (y_width < SINGLE))[..., fast].mean(axis=-1),
    )
    return np.stack(claims, axis=-1)
