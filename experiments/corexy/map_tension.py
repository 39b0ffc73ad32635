"""Map over belt tension and voltage amplitude, the inputs those of scenario 1."""

import corexy_jax as cx

from ._map import machine_map


def _machine(tension, amplitude):
    parameters = cx.CoreXYParameters(P1=tension, P2=tension, mu_1s_b=2.0, mu_2s_b=2.0)
    return parameters, cx.Harmonic(amplitude, 0.5 * amplitude)


EXPERIMENT = machine_map(
    "corexy-map-tension",
    "CoreXY: modes and slip over belt tension and voltage (belts with mu_s = 2)",
    (
        ("tension", "N", "tension of both belts $P_1 = P_2$", 5.0, 100.0, True),
        ("amplitude", "V", "amplitude $v_{01} = 2 v_{02}$", 1.0, 24.0, False),
    ),
    _machine,
)
