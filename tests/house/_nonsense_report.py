"""Right arguments of what is asked of a fit afterwards."""

import jax.numpy as jnp
import numpy as np

from stickslip import identification
from stickslip.identification._unknowns import scalars
from tests.house._nonsense_identification import RESIDUAL
from tests.house._nonsense_target import Target, arg

ONE = identification.Fit(
    {"a": jnp.ones(())}, jnp.ones(3), identification.Sensitivity(("a",), jnp.ones((3, 1))),
    jnp.ones((), jnp.int32), scalars("start", {"a": 1.0})[0], jnp.zeros((), jnp.int32),
)  # fmt: skip
SIDES, WHOLE = {"a": jnp.zeros((2, 3))}, {"a": jnp.ones(2, jnp.int32)}
PROFILE = identification.Profile(
    jnp.asarray(0.95), *({"a": jnp.ones(())},) * 5, WHOLE, {"a": jnp.zeros((), jnp.int32)}, SIDES,
    SIDES, {"a": SIDES}, jnp.zeros(()), WHOLE,
)  # fmt: skip
POSTERIOR = identification.Posterior(
    {"a": jnp.ones((2, 4))}, jnp.zeros((2, 4), bool), {"a": jnp.ones(())}, {"a": jnp.ones(())},
    ONE.space,
)  # fmt: skip
COMPARISON = identification.compare({"one": ONE})
REPORT = identification.report(ONE)
SERIES = arg(np.arange(30.0))
ROWS = arg(None, "none", "mapping")
TARGETS = [
    Target(
        identification.profile,
        {
            "residual": RESIDUAL, "fit": arg(ONE), "names": arg(None, "none"),
            "limits": arg(None, "none", "mapping"), "level": arg(0.95, "float32"), "points": arg(4),
            "max_steps": arg(40),
        },
    ),
    Target(
        identification.posterior,
        {
            "residual": RESIDUAL, "fit": arg(ONE), "draws": arg(4), "warmup": arg(60), "chains": arg(2),
            "seed": arg(0, "count"), "max_doublings": arg(3),
        },
    ),
    Target(
        identification.unseen,
        {"fit": arg(ONE)},
    ),
    Target(identification.autocorrelation, {"series": SERIES, "lags": arg(3)}),
    Target(
        identification.cross_correlation,
        {"series": SERIES, "other": SERIES, "lags": arg(3)},
    ),
    Target(
        identification.ljung_box, {"series": SERIES, "lags": arg(3), "unknowns": arg(0, "count")}
    ),
    Target(
        identification.in_even_steps,
        {"times": arg([0.0, 1.0, 2.0]), "series": arg([1.0, 2.0, 3.0])},
    ),
    Target(
        identification.compare,
        {
            "fits": arg({"one": ONE}), "held_out": ROWS, "sigma": arg(1.0, "positive", "float32"),
            "noise_known": arg(True, "flag"),
        },
    ),
    Target(
        identification.WhitenessTest,
        {"lags": arg(3), "inputs": ROWS, "past_data": arg(False, "flag")},
    ),
    Target(
        identification.report,
        {
            "fit": arg(ONE), "profile": arg(None, "none"), "series": ROWS,
            "whiteness": arg(None, "none"), "held_out": ROWS, "comparison": arg(None, "none"),
            "runs": ROWS, "other_runs": ROWS,
            "title": arg("title", "text"),
        },
    ),
]  # fmt: skip
