"""Fig. 4: diagrams of both models overlaid, from the data of Figs. 2 and 3."""

from .._experiment import Experiment
from .._thresholds import Block
from ._diagram import MODELS, PROTOCOL, QUICK, diagrams
from ._draw import draw_overlay
from ._judge import judge_models


def compute(parameters, context):
    """Diagrams of all models; those of Figs. 2 and 3 are taken from their stores."""
    return diagrams(MODELS, parameters["k3_min"], parameters["k3_max"], parameters, context)


EXPERIMENT = Experiment(
    name="block-fig04",
    title="Bifurcation diagrams of the block on a belt, simplified and full model overlaid",
    parameters={"k3_min": Block.K3_LOW, "k3_max": Block.K3_HIGH, **PROTOCOL},
    quick=QUICK,
    compute=compute,
    draw=draw_overlay,
    judge=judge_models,
)
