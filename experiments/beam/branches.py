"""Fig. 2.3 with what simulations cannot show: the orbit of stick-slip, where it ends, and how."""

from .._experiment import Experiment
from ._branches import with_branches
from ._diagram import PARAMETERS, QUICK
from ._draw_branches import draw_branches
from ._judge_branches import judge_branches

EXPERIMENT = Experiment(
    name="beam-branches",
    title="Branches of periodic orbits of the jointed beam over the belt speed, with the end of stick",
    parameters={
        **PARAMETERS,
        "speeds": 600,
        "modes": 4,  # the fifth has a node at the joint: nothing moves it, and it never settles
        "variants": "all",
        "follow_from": 1e-3,
        "follow_min": 1e-4,
        "follow_max": 3e-2,
        "step": 0.03,
        "max_orbits": 120,
        "orbit_tolerance": 1e-11,
        "longest_step": 0.25,  # of a radian of the fastest mode
        "damping": 1e-5,
    },
    quick={
        **QUICK,
        "modes": 2,
        "variants": "consistent",
        "follow_from": 2e-3,
        "follow_min": 2e-3,
        "follow_max": 5e-3,
        "max_orbits": 40,
        "orbit_tolerance": 1e-9,
        "damping": 0.0,
    },
    compute=with_branches,
    draw=draw_branches,
    judge=judge_branches,
)
