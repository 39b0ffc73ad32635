"""Right arguments of controllers and their loops."""

import numpy as np

from stickslip import control, plot
from stickslip.systems import CoulombOscillator, Motion
from tests.house._nonsense_laws import POSITIVE
from tests.house._nonsense_target import Target, arg

AXIS = Motion(0.1, 0.0)
SYSTEM = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
PID = control.PID(1.0, 1.0, 1.0, period=0.1)
LOOP = control.WithController(SYSTEM, lambda k, t, m, s, a: (0.0, s), 0.1)
MAP = control.HuntingMap(
    {"kp": np.ones((2, 2)), "ki": np.ones((2, 2))}, np.array([[0, 1], [2, 3]]), np.ones((2, 2)),
    np.ones((2, 2)),
)  # fmt: skip
FINITE = ("finite", "float32", "batch")
GAIN = arg(1.0, *FINITE)
ONE = ("positive", "float32")
SHAPER = control.InputShaper(0.0, "EI", 1.0)
UPDATE = arg(PID, "function")
OFTEN = {
    "period": arg(0.1, *ONE),
    "reference": arg(0.0, "finite", "float32", "function"),
    "limit": arg(1.0, "none", *ONE),
    "tracking_time": arg(None, "none", *ONE),
}
TARGETS = [
    Target(control.PID, {"kp": GAIN, "ki": GAIN, "kd": GAIN, **OFTEN}),
    Target(control.Cascade, {"k_position": GAIN, "pid": arg(PID)}),
    Target(control.ResetPID, {"pid": arg(PID), "factor": GAIN}),
    Target(
        control.FrictionFeedforward,
        {
            "controller": UPDATE, "friction": arg(lambda w: w, "function"),
            "reference": arg(None, "none", "finite", "float32", "function"),
        },
    ),
    Target(
        control.DisturbanceObserver,
        {
            "controller": UPDATE, "mass": arg(1.0, *POSITIVE), "bandwidth": arg(1.0, *POSITIVE),
            "period": arg(0.1, *POSITIVE),
        },
    ),
    Target(control.FirstOrderHold, {"controller": UPDATE, "period": arg(0.1, *POSITIVE)}),
    Target(
        control.InputShaper,
        {
            "kind": arg("ZV"),
            "reference": arg(lambda t, args: (t, 1.0), "finite", "float32", "function"),
            "omega": arg(1.0, *POSITIVE),
            "damping": arg(0.1, "zero", "float32", "row"),
        },
    ),
    *(
        Target(of, {"omega": arg(1.0, "reals"), "damping": arg(0.1, "zero", "float32", "row")})
        for of in (SHAPER.residual, SHAPER.peak)
    ),
    Target(control.encoder_reading, {"x": arg(0.1, "reals"), "quantum": arg(0.1, *ONE)}),
    Target(
        control.reading_noise,
        {"seed": arg(1, "count"), "k": arg(2, "count")},
    ),
    Target(
        control.WithController,
        {
            "system": arg(SYSTEM), "update": arg(lambda k, t, m, s, a: (0.0, s), "function"),
            "period": arg(0.1, *ONE), "state": arg(0.0, "shared", "no times"),
            "measure": arg(lambda t, y, args: y, "function"), "delay": arg(1, "count"),
            "latency": arg(None, "none", "zero"), "offset": arg(0.0, "finite", "float32"),
            "drive": arg(lambda s, u, a: (s, u), "function"),
        },
    ),
    Target(
        control.hunting_map,
        {
            "loop": arg(lambda ki: LOOP, "function"), "values": arg({"ki": [1.0, 2.0]}),
            "start": arg(lambda system: system.start(AXIS), "function"), "duration": arg(1.0, *ONE),
            "component": arg("x"), "resolution": arg(1e-9, *ONE), "integrator": arg(None, "none"),
        },
    ),
    Target(plot.hunting, {"found": arg(MAP), "axes": arg(None, "none"), "ax": arg(None, "none")}),
]  # fmt: skip
