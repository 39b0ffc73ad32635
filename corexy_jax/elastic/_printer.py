"""A desktop printer: the parameters of a machine that is constructed from data of its parts."""

import math
from typing import NamedTuple

from .._parameters import CoreXYParameters
from ._belts import Belts, Frame
from ._winding import Winding


class Printer(NamedTuple):
    """Parameters of an `ElasticCoreXY` and of its steppers: `torque` [N m] at rest, and `winding`."""

    parameters: CoreXYParameters
    belts: Belts
    torque: float
    winding: Winding


def desktop_printer() -> Printer:
    r"""A CoreXY printer with a bed of 250 mm, **constructed**: no machine has been measured for it.

    | number | value | from |
    |---|---|---|
    | pulleys | 20 teeth of 2 mm | $r = 20\cdot2\,\mathrm{mm}/2\pi$ = 6.366 mm |
    | $EA$ | 19 kN | see below |
    | $P$ | 18 N | aim of the firmware of the Prusa XL (4) |
    | frame | 0.36 m, 0.37 m | bed, carriage, idlers; (5) has 0.35 m, 0.37 m for 235 mm |
    | $T_m$ | 0.28 N m | holding torque 0.4 N m of a 17HS4401 (6) by $\sqrt2$: `Winding` |
    | $I_m$, $R$, $L$ | 1.7 A, 1.5 ohm, 2.8 mH | the same (6); 24 V of the supply |
    | $J$ | 55 g cm² | rotor 54 g cm² (6), a pulley of 5 g |
    | $J'$ | 1.5 g cm² | estimate: an idler with two bearings, 7 g |
    | $m$, $M$ | 0.35 kg, 0.45 kg | estimates: head with extruder; rail, carriages, idlers |
    | $\mu_s$, $\mu_k$ | 0.02, 0.015 | estimates: guides and bearings of balls, with seals |
    | $r_f$ | 2.5 mm | radius of the shaft of the idlers |
    | $\tau$ | 0.3 ms | estimate: 5% of the critical damping at 50 Hz |

    $EA$ of a belt of 6 mm, neoprene with cords of glass fibre: the stock one of a router, 9 mm, was
    seen to stretch by 0.58% under 38 lbf (1), which is 29 kN, or 19 kN by the width. A buyer of belts
    of 6 mm accepts up to 1% under 10 kg (2), which is 9.8 kN or more: take 10 kN to 20 kN for possible.
    It rises with the load, by tests up to breaking (3), of which the numbers are not used here.

    `K_t` and `K_e` are $T_m/I_m$, as DC motors would have them; those of belts that slip are not used.

    ??? cite "Sources"

        (1) Carbide 3D community, *Belt stretch and stepper holding measured*, thread 18480, post 22.
        (2) FarmBot Genesis documentation v1.6, *Belt*, component tests. (3) B. Wang, Y. Si, C. Chadha,
        J. T. Allison and A. E. Patterson, *Nominal stiffness of GT-2 rubber-fiberglass timing belts for
        dynamic system modeling and design*, Robotics 7 (4), 75, 2018. (4) Prusa-Firmware-Buddy,
        `PrinterBeltParameters`, target tension of the XL. (5) FuseBox3, alexyu132/fusebox3.
        (6) MotionKing, data sheet of the 17HS4401.
    """
    torque, current, r = 0.4 / math.sqrt(2.0), 1.7, 20 * 2e-3 / (2.0 * math.pi)
    constant = torque / current
    parameters = CoreXYParameters(
        m=0.35, M=0.45, J=5.5e-6, J_passive=1.5e-7, r=r, r_f=2.5e-3, R=1.5, K_t=constant, K_e=constant,
        mu_s=0.02, mu_k=0.015, P1=18.0, P2=18.0,
    )  # fmt: skip
    belts = Belts(Frame(0.36, 0.37), EA_1=1.9e4, EA_2=1.9e4, retardation=3e-4)
    return Printer(parameters, belts, torque, Winding(24.0, current, 1.5, 2.8e-3))
