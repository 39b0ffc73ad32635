"""Right arguments of structures and sliders."""

import numpy as np

from stickslip import structure
from stickslip.friction import Coulomb
from tests.house._nonsense_laws import NOT_NEGATIVE, POSITIVE
from tests.house._nonsense_target import Target, arg

PAIR = structure.LinearStructure(np.eye(2), np.eye(2), np.eye(2))
ELEMENT = structure.Jenkins([1.0, -1.0], 1.0, 0.1)
DAMPED = structure.WithSliders(PAIR, {"damper": ELEMENT})
PAD = structure.NodeContact([1.0, 0.0], Coulomb(0.5, 0.3))
RUBBED = structure.WithContacts(PAIR, {"pad": PAD})
SLID = DAMPED.start(PAIR.state())
MATRIX = arg(np.eye(2))
DIRECTION = arg([1.0, -1.0], "row", "function", "entries")
TARGETS = [
    Target(
        structure.Jenkins,
        {
            "direction": DIRECTION, "stiffness": arg(1.0, "positive", "float32", "row"),
            "bound": arg(0.1, "not negative", "float32", "row", "function"),
        },
    ),
    Target(
        structure.iwan,
        {
            "direction": DIRECTION, "slip_force": arg(1.0, "positive", "float32"),
            "stiffness": arg(2.0, "positive", "float32"), "exponent": arg(-0.5, "count"),
            "ratio": arg(0.1, "not negative", "float32"), "sliders": arg(3),
        },
    ),
    Target(
        structure.masing_loop,
        {"element": arg(ELEMENT), "amplitude": arg(0.3, *NOT_NEGATIVE)},
    ),
    Target(
        structure.HarmonicForce,
        {
            "amplitude": arg([1.0, 0.0], "row", "batch"), "frequency": arg(1.0, *POSITIVE),
            "phase": arg(0.0, "finite", "float32", "batch"),
        },
    ),
    Target(
        structure.LinearStructure,
        {
            "mass": MATRIX, "damping": MATRIX, "stiffness": MATRIX,
            "force": arg(None, "none", "function"),
        },
    ),
    Target(structure.WithSliders, {"system": arg(PAIR), "sliders": arg({"damper": ELEMENT})}),
    Target(
        structure.WithContacts,
        {"system": arg(PAIR), "contacts": arg({"pad": PAD}), "planar": arg(None, "none", "mapping")},
    ),
    Target(
        structure.NodeContact,
        {
            "direction": arg([1.0, -1.0], "row"), "law": arg(Coulomb(0.5, 0.3)),
            "normal_force": arg(1.0, "none", "not negative", "float32", "function"),
            "surface_speed": arg(0.1, "none", "finite", "float32", "function"),
            "normal_direction": arg(None, "none", "row"),
        },
    ),
    Target(
        structure.NodeStop,
        {
            "direction": arg([1.0, -1.0], "row"), "gap": arg(0.1, "finite", "float32"),
            "restitution": arg(0.5, "not negative", "float32"),
            "rest_speed": arg(0.0, "not negative", "float32"),
        },
    ),
    Target(
        structure.craig_bampton,
        {"mass": MATRIX, "stiffness": MATRIX, "boundary": arg([1]), "modes": arg(1, "count")},
    ),
    Target(
        structure.modal_damping,
        {"mass": MATRIX, "stiffness": MATRIX, "ratios": arg(0.01, *NOT_NEGATIVE)},
    ),
]  # fmt: skip
