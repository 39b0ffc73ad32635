"""Parameter sets of the block on a belt: set A, and those the search varies and has found."""

from typing import Any

import numpy as np

from stickslip.friction import SmoothHyperbolicWeakening
from stickslip.systems import BlockOnBelt, BlockOnDrivenBelt, BlockState, DrivenBlockState

from ._drive import SIGNS, signed_drive

# What the search varies, with the values of set A and how far a first guess strays from them (the
# standard deviation of the logarithm). J and Q are factors of 3 M r^2 and of -3/4 M g r.
NAMES = {
    "M": (0.21, 0.15), "k1": (17.0, 0.2), "k2": (11.0, 0.2), "c1": (0.9965, 0.2), "c2": (0.035, 0.3),
    "mu_0": (0.26, 0.15), "alpha": (190.0, 0.3), "beta": (0.9, 0.3), "gamma": (1.75, 0.3),
    "V_b": (0.12, 0.15), "J_factor": (1.0, 0.1), "Q_factor": (1.0, 0.05),
    "J_dc": (5e-5, 0.7), "r_bp": (0.03, 0.3), "R_w": (2.0, 0.4),
}  # fmt: skip
MASS, RADIUS, GRAVITY = 0.20, 0.25, 9.81
# Best sets of `block-search` so far, constructed like set A. "found" was bred from the best sets of
# two runs that began from set A, one good at doublings, one at 87.968 N/m. `pull` is the mean of T_s
# [N] of the simplified model at 85 N/m, for which the drive's voltage is set.
FOUND = {
    "found": {
        "M": 0.177745, "k1": 15.8068, "k2": 17.1536, "c1": 0.759503, "c2": 0.0411814,
        "mu_0": 0.329107, "alpha": 229.113, "beta": 0.978135, "gamma": 0.646011, "V_b": 0.125175,
        "J_factor": 1.14355, "Q_factor": 0.861615, "J_dc": 1.41294e-4, "r_bp": 0.010785,
        "R_w": 1.90685, "pull": -1.14235,
    },
}  # fmt: skip


def start_values() -> np.ndarray:
    """Set A with its drive, in the order of `NAMES`."""
    return np.array([value for value, _ in NAMES.values()])


def found_values() -> np.ndarray:
    """`FOUND` as an array [set, parameter] in the order of `NAMES`."""
    return np.array([[values[name] for name in NAMES] for values in FOUND.values()])


def found_set(name: str) -> tuple[np.ndarray, float]:
    """Values of a set of `FOUND` in the order of `NAMES`, and its mean friction [N].

    Errors: `ValueError` for a name that is not in `FOUND`.
    """
    if name not in FOUND:
        allowed = ", ".join(["A", *FOUND])
        raise ValueError(f"set is {name!r}; it must be one of {allowed}.")
    values = FOUND[name]
    return np.array([values[key] for key in NAMES]), values["pull"]


def spreads() -> np.ndarray:
    """Standard deviations of the logarithms."""
    return np.array([spread for _, spread in NAMES.values()])


def mechanics(p: Any, k3: Any) -> dict[str, Any]:
    """Arguments of a block for the values `p` in the order of `NAMES`."""
    q = dict(zip(NAMES, p, strict=True))
    return {
        "m": MASS, "M": q["M"], "J": q["J_factor"] * 3.0 * q["M"] * RADIUS**2, "k1": q["k1"],
        "k2": q["k2"], "k3": k3, "c1": q["c1"], "c2": q["c2"], "r": RADIUS,
        "Q": q["Q_factor"] * -0.75 * q["M"] * GRAVITY * RADIUS, "g": GRAVITY,
        "law": SmoothHyperbolicWeakening(q["mu_0"], q["alpha"], q["beta"], q["gamma"]),
    }  # fmt: skip


def simplified(p: Any, k3: Any, pull: Any = 0.0):
    """Simplified model and its initial state."""
    return BlockOnBelt(V_b=p[list(NAMES).index("V_b")], **mechanics(p, k3)), BlockState(
        0.0, 0.0, 0.0, 0.0
    )


def with_drive(sign: Any):
    """Full model, driven so that the belt runs at `V_b` on average if the mean friction is `pull`.

    `sign`: of the belt reaction, a word of `SIGNS` or a factor, known or traced.
    """
    sign = SIGNS[sign] if isinstance(sign, str) else sign

    def build(p, k3, pull):
        q = dict(zip(NAMES, p, strict=True))
        changes = {"J_dc": q["J_dc"], "r_bp": q["r_bp"], "R_w": q["R_w"]}
        drive = signed_drive(sign, **changes)
        omega = q["V_b"] / drive.transmission
        current = (drive.b * omega + drive.T_k - drive.reaction * pull) / drive.k_m
        drive = signed_drive(sign, **changes, U_in=drive.k_e * omega + drive.R_w * current)
        return BlockOnDrivenBelt(drive=drive, **mechanics(p, k3)), DrivenBlockState(
            0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        )

    return build
