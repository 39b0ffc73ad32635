"""Figs. 2 and 3 with what simulations cannot show: branches of periodic orbits, stable or not."""

from .._experiment import Experiment
from .._thresholds import Block
from ._branches import with_branches
from ._diagram import MODELS, PROTOCOL, QUICK
from ._draw_branches import draw_branches
from ._judge import judge_branches


def compute(parameters, context):
    """Diagrams of the models, with branches."""
    models = MODELS if parameters["models"] == "all" else MODELS[:1]
    return with_branches(models, parameters, context)


EXPERIMENT = Experiment(
    name="block-branches",
    title="Branches of periodic orbits of the block on a belt over k3, with period doublings",
    parameters={
        "models": "all",
        "k3_min": Block.K3_LOW,
        "k3_max": Block.K3_HIGH,
        **PROTOCOL,
        "k3_step": 0.01,
        "exponents": 0,
        "follow_min": 50.0,
        "follow_max": 100.0,
        "step": 0.03,
        "max_orbits": 200,
        "doublings": 1,
        "segments": 8,
        "orbit_tolerance": 1e-11,
    },
    quick={
        **QUICK,
        "models": "simplified",
        "k3_step": 1.0,
        "exponents": 0,
        "follow_min": 70.0,
        "step": 0.1,
        "max_orbits": 20,
        "doublings": 0,
    },
    compute=compute,
    draw=draw_branches,
    judge=judge_branches,
)
