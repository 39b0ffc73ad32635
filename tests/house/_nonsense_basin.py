"""Right arguments of maps of basins."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from stickslip import basin, plot
from stickslip.systems import Motion
from tests.house._nonsense_continuation import ORBIT
from tests.house._nonsense_engine import ARGS, INTEGRATOR, STATE, SYSTEM
from tests.house._nonsense_target import Target, arg

BOX = arg({"x": (0.0, 1.0), "v": (0.0, 1.0)})
SETTLE = arg(basin.Settle(1.0))
ATTRACTORS = tuple(basin.Attractor(f"rest {n}", "rest", Motion(0.0, 0.0), 0) for n in (1, 2))
FOUND = basin.Basins(
    ATTRACTORS, BOX.value, Motion(np.ones((2, 2)), np.ones((2, 2))), np.array([[0, 1], [1, 1]]),
    np.ones((2, 2)), np.full((2, 2), ""),
)  # fmt: skip
OVER = basin.BasinsOver("stiffness", np.array([1.0, 2.0]), (FOUND, FOUND))
JUDGE = basin.Judge(SYSTEM.value, FOUND, SETTLE.value)
CYCLE = eqx.tree_at(lambda orbit: orbit.repeats, ORBIT, jnp.ones((), jnp.int32))
POINTS = arg((2, 2))
TARGETS = [
    Target(
        basin.Settle,
        {
            "duration": arg(1.0, "positive", "float32"), "forcing_period": arg(None, "none", "float32"),
            "limits": arg({}, "mapping", "none"),
        },
    ),
    Target(
        basin.basins,
        {
            "system": SYSTEM, "y0": STATE, "box": BOX, "settle": SETTLE, "points": POINTS,
            "integrator": INTEGRATOR, "args": ARGS, "known": arg((), "none of them"),
        },
    ),
    Target(
        basin.basins_over,
        {
            "system": SYSTEM, "parameter": arg("stiffness"), "values": arg([1.0, 2.0], "row"),
            "y0": STATE, "box": BOX, "settle": SETTLE, "points": POINTS, "integrator": INTEGRATOR,
            "args": ARGS,
        },
    ),
    Target(
        basin.Judge,
        {
            "system": SYSTEM, "found": arg(FOUND), "settle": SETTLE, "integrator": INTEGRATOR,
            "args": ARGS,
        },
    ),
    Target(basin.Judge.grid, {"points": POINTS}, JUDGE.grid),
    Target(basin.Judge.spread, {"points": arg(4, "positive")}, JUDGE.spread),
    Target(
        basin.Judge.__call__, {"place": arg(0.5, "finite", "float32")},
        lambda place: JUDGE(x=place, v=0.5),
    ),
    Target(
        basin.border_motion,
        {
            "system": SYSTEM, "found": arg(FOUND), "between": arg(("rest 1", "rest 2")),
            "settle": SETTLE, "integrator": INTEGRATOR, "args": ARGS,
        },
    ),
    Target(
        basin.smallest_kick,
        {
            "system": SYSTEM, "found": arg(FOUND), "y0": STATE, "by": arg({"v": 1.0}),
            "settle": SETTLE, "integrator": INTEGRATOR, "args": ARGS,
        },
    ),
    Target(
        basin.border_shares,
        {
            "system": SYSTEM, "found": arg(FOUND), "settle": SETTLE, "integrator": INTEGRATOR,
            "args": ARGS,
        },
    ),
    Target(basin.Basins.to_dataset, {"system": SYSTEM}, FOUND.to_dataset),
    Target(
        plot.basins,
        {
            "found": arg(FOUND), "system": SYSTEM, "axes": arg(None, "none"), "ax": arg(None, "none"),
        },
    ),
    Target(plot.shares, {"found": arg(OVER), "ax": arg(None, "none")}),
]  # fmt: skip
