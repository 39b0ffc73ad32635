"""How near a toothed belt comes to jumping a tooth of its motor pulley."""

from typing import NamedTuple

import numpy as np

from stickslip.checks import Given, Numeric, check_known, numbers, one_number

from .._arguments import named
from ._belts import Spans


class ToothJump(NamedTuple):
    """The nearest to a jump in a run.

    - `margin`: least part of the limit that is left, negative beyond it; `pulley`: that of motor 1 or
      2 at which it is; `row`: the output in which it is.
    - `tension` [N]: the least of all spans, `span` its name: 0 where a span is slack, which jumps with
      hardly a torque.
    """

    margin: float
    pulley: int
    row: int
    tension: float
    span: str


def tooth_jump(tensions: Given[Spans], limit: Numeric) -> ToothJump:
    r"""Least margin $1 - |T_a - T_b|/F$ of both motor pulleys.

    It is a result: the motion goes on as if no tooth were jumped. A belt rides up on the teeth where
    the torque is too great for its tension.

    **Arguments**

    - `tensions` [N]: those of a run, `jax.vmap(machine.tensions)(solution.outputs.y)`, rows of the
      same length or numbers.
    - `limit` $F$ [N], positive: the ratcheting torque of the pulley by its radius. It grows with the
      tension of the belt and the teeth in mesh, and is measured, or that of a data sheet.

    **Returns** a `ToothJump`. **Raises** `TypeError`, `ValueError` naming the argument. It reads
    numbers and does not work under `jit`.

    ??? cite "Reference"

        D. Collins, *What is ratcheting in synchronous belt drives?*, Linear Motion Tips, 2017.
    """
    limit = float(check_known("limit", one_number("limit", limit, "positive")))
    known = check_known("tensions", named("tensions", tensions, Spans))
    rows = np.stack([np.atleast_1d(numbers("tensions", span)) for span in known])
    margins = 1.0 - np.abs(rows[0::2] - rows[1::2]) / limit
    pulley, row = np.unravel_index(np.argmin(margins), margins.shape)
    span = int(np.argmin(rows.min(axis=1)))
    return ToothJump(
        float(margins[pulley, row]), int(pulley) + 1, int(row),
        float(rows[span].min()), Spans._fields[span],
    )  # fmt: skip
