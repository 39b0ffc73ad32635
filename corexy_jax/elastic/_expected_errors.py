"""How well a record of the head would tell the belts, before it is taken."""

import jax
import jax.numpy as jnp
import numpy as np

from stickslip.checks import Given, Numeric, check_known, check_type, one_number, refusal, whole_number
from stickslip.hybrid import jit_plainly

from ._fit_belts import HeadRecord, residual_of, windows_of
from ._machine import ElasticCoreXY
from ._stepper import Stepper
from ._trajectory import Trajectory


def expected_errors(
    machine: Given[ElasticCoreXY],
    path: Given[Trajectory],
    rate: Numeric = 3200.0,
    noise: Numeric = 0.1,
    window: int = 8,
) -> dict[str, float]:
    """Standard errors that `fit_belts` would have from a record along a path: which sweep tells most.

    Those of the linearised fit, by the bound of Cramér and Rao, for white noise and an exact model.
    Compare directions, places and ranges of `resonance_sweep` with it before shaking the printer: along
    `x` or `y` of a printer whose belts are alike both are stretched alike, and only their sum is told;
    along a diagonal each.

    **Arguments**

    - `machine`: a guess of it, whose drive is a `Stepper`; friction is kinetic.
    - `path`: the command; `rate` [1/s] of the samples, `noise` [m/s²], the standard deviation of one,
      positive; `window` as of `fit_belts`.

    **Returns** errors of `EA_1`, `EA_2` [N], `retardation` [s] and `mu` by name; infinite where one
    cannot be told. **Raises** `TypeError`, `ValueError` naming the argument. It reads numbers and does
    not work under `jit`.
    """
    check_type("machine", machine, ElasticCoreXY, "an ElasticCoreXY")
    stepper = check_type("machine.drive", machine.drive, Stepper, "a Stepper")
    check_type("path", path, Trajectory, "a Trajectory")
    rate, noise = (
        float(check_known(name, one_number(name, value, "positive")))
        for name, value in (("rate", rate), ("noise", noise))
    )
    seconds = float(path.times[-1] - path.times[0]) + 0.1
    least, most = 16 * whole_number("window", window, 1, 10_000) / seconds, 1e7 / seconds
    if not least <= rate <= most:
        raise refusal("rate", rate, f"from {least:.4g} to {most:.4g}: 16 windows, 10 million samples")
    times = float(path.times[0]) + np.arange(int(rate * seconds) + 1) / rate
    piece = np.searchsorted(np.asarray(path.times), times, side="right") - 1
    inside = piece < len(path.accelerations)
    # Which windows there are, is all that is taken of this record.
    felt = np.where(inside[:, None], np.asarray(path.accelerations)[np.where(inside, piece, 0)], 0.0)
    x, y = felt.T + np.arange(times.size)[None, :] * 1e-12
    p, belts = machine.parameters, machine.belts
    data = (
        p, belts, stepper,
        (windows_of(HeadRecord(path, times, x, y), window),), (noise / window**0.5,),
    )  # fmt: skip
    values = {
        "EA_1": belts.EA_1, "EA_2": belts.EA_2, "retardation": jnp.maximum(belts.retardation, 1e-5),
        "mu": jnp.maximum(jnp.asarray(p.mu_k, jnp.float64), 1e-3), "begin[0]": path.times[0],
    }  # fmt: skip
    values = {name: jnp.asarray(value, jnp.float64) for name, value in values.items()}
    columns = np.stack([np.asarray(row) for row in _slopes(values, data).values()], axis=1)
    size = np.linalg.norm(columns, axis=0)
    _, found, turned = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0))
    seen = np.where(found > 1e-9, found, np.nan)
    errors = np.linalg.norm(turned / seen[:, None], axis=0) / np.where(size > 0.0, size, np.nan)
    told = dict(zip(sorted(values), np.nan_to_num(errors, nan=np.inf), strict=True))
    return {name: float(told[name]) for name in ("EA_1", "EA_2", "retardation", "mu")}


@jit_plainly
def _slopes(values: dict, data: tuple) -> dict:
    """Derivatives of the residuals by the unknowns, by name."""
    return jax.jacfwd(residual_of)(values, data)
