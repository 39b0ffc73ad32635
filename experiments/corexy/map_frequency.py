"""Modes and slip over the frequency of the input, sine and cosine."""

import corexy_jax as cx

from ._map import machine_map


def _machine(frequency):
    parameters = cx.CoreXYParameters(mu_1s_b=2.0, mu_2s_b=2.0)
    return parameters, cx.Harmonic(20.0, 10.0, frequency)


EXPERIMENT = machine_map(
    "corexy-map-frequency",
    "CoreXY: modes and slip over the frequency of the input (belts with mu_s = 2, 20 V and 10 V)",
    (("frequency", "Hz", "frequency of the input", 0.1, 20.0, True),),
    _machine,
)
