"""Map over the static friction of the two belts, scenario 1 otherwise."""

import corexy_jax as cx

from ._map import machine_map


def _machine(one, two):
    return cx.CoreXYParameters(mu_1s_b=one, mu_2s_b=two), cx.Harmonic(10.0, 5.0)


EXPERIMENT = machine_map(
    "corexy-map-friction",
    "CoreXY: modes and slip over the static friction of the belts, scenario 1 otherwise",
    (
        ("mu_1s_b", "1", r"$\mu_{1s}^b$", 0.2, 5.0, True),
        ("mu_2s_b", "1", r"$\mu_{2s}^b$", 0.2, 5.0, True),
    ),
    _machine,
)
