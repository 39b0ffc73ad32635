"""The modes of the machine: every way in which its eight contacts can rest or slide together.

The signs of the eight sliding speeds are not independent: the speeds are eight linear functions of
four velocities. The sign vectors that occur are the faces of the arrangement of the eight planes
`n_c · q = 0`: 17 for the carriage, and for each motor 3 or 5, by whether its virtual pulley turns.
Together there are 369.
"""

from typing import Any

import jax.numpy as jnp
import numpy as np

from stickslip.hybrid import current_executor

from ._contact_motion import NumberRow
from ._contacts import BELT_1, BELT_2, NORMALS, NUM_CONTACTS

DMN_NAMES = ("RR", "SR", "RS", "SS")


def dynamic_model_number(sign_1: Any, sign_2: Any) -> Any:
    """1 RR, 2 SR, 3 RS, 4 SS from the senses of slip of the two belts, of integer kind."""
    return 1 + (sign_1 != 0) + 2 * (sign_2 != 0)


def _faces() -> np.ndarray:
    """All sign vectors, the ones with more rest first within each dynamic model."""
    found = {(0,) * NUM_CONTACTS}
    angles = np.arange(16) * np.pi / 8
    carriage = np.vstack([[0.0, 0.0], np.column_stack([np.cos(angles), np.sin(angles)])])
    for vx, vy in np.where(np.abs(carriage) < 1e-9, 0.0, carriage):
        motors = []
        for turn in (vx + vy, vx - vy):
            turn = 0.0 if abs(turn) < 1e-9 else turn
            motors.append({0.0, turn, 0.5 * turn, min(0.0, turn) - 1.0, max(0.0, turn) + 1.0})
        for one in motors[0]:
            for two in motors[1]:
                speeds = NORMALS @ np.array([vx, vy, one, two])
                found.add(tuple(int(s) for s in np.sign(np.where(np.abs(speeds) < 1e-9, 0, speeds))))

    def order(signs):
        model = dynamic_model_number(signs[BELT_1], signs[BELT_2])
        return int(model), sum(s != 0 for s in signs), signs

    return np.array(sorted(found, key=order), np.int8)


SIGNS = _faces()  # [mode, contact]: -1, 0 or 1
NUM_MODES = len(SIGNS)
MODE_DMN = np.array([dynamic_model_number(s[BELT_1], s[BELT_2]) for s in SIGNS], np.int32)
MODE_NAMES = tuple(
    f"{DMN_NAMES[dmn - 1]} {''.join('-0+'[s + 1] for s in signs)}"
    for dmn, signs in zip(MODE_DMN, SIGNS, strict=True)
)

# Two bits a contact; one look-up a decode.
_PACKED = np.sum((SIGNS.astype(np.int64) + 1) << (2 * np.arange(NUM_CONTACTS)), axis=1).astype(np.int32)
_NUMBER = np.full(3**NUM_CONTACTS, -1, np.int32)
_NUMBER[np.sum((SIGNS.astype(np.int64) + 1) * 3 ** np.arange(NUM_CONTACTS), axis=1)] = np.arange(
    NUM_MODES
)


def mode_signs(mode: Any) -> NumberRow:
    """Sense of every contact in a mode: -1, 0 (at rest) or 1, as floats."""
    if not current_executor().fused:
        return jnp.asarray(SIGNS.T, jnp.float64)[:, mode]
    packed = jnp.asarray(_PACKED)[mode]
    return tuple(
        ((packed >> jnp.int32(2 * c)) & jnp.int32(3)).astype(jnp.float64) - 1.0
        for c in range(NUM_CONTACTS)
    )


def mode_number(signs: NumberRow) -> Any:
    """Mode with these senses (floats); -1 if the geometry does not admit them."""
    if isinstance(signs, tuple):
        index = jnp.zeros(jnp.shape(signs[0]), jnp.int32)
        for c in range(NUM_CONTACTS):
            index = index + jnp.int32(3**c) * (signs[c].astype(jnp.int32) + 1)
    else:
        weights = jnp.asarray(3 ** np.arange(NUM_CONTACTS), jnp.float64)
        index = jnp.sum(weights * (signs + 1.0)).astype(jnp.int32)
    return jnp.asarray(_NUMBER)[index]


def mode_dmn(mode: Any) -> Any:
    """Dynamic model number 1 to 4 of a mode."""
    return jnp.asarray(MODE_DMN)[mode]
