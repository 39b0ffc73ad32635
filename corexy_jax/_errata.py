"""Where the paper contradicts itself: one switch an erratum."""

import equinox as eqx

from stickslip.checks import Given, check_flag, check_in

CLAIMS = {
    "A1": "x rows of (39), (48), (57), (66): minus before the torques of pulleys 1_1 and 2_1",
    "A2": "(45), (49), (55), (58), (63), (64), (67): the belt feels minus the force on the pulley",
    "A3": "(81)-(84): the factor J belongs to the acceleration only",
    "A4": "(73): a slipping motor rolls again where its relative speed changes sign",
    "A5": "Table 1: the frequency 0.5 is in Hz, not rad/s",
    "A6": "scenario 3: v0 sign(sin), not sign|sin|",
    "A7": "arm of the pulleys' friction, not stated: r_f of the parameters",
    "A8": "one dead zone for both axes (Gauss' principle) instead of one along each acceleration",
    "A9": "a belt holds up to max(mu_s, mu_k)",
    "A10": "(60): f_2k^b, not f_2k^E",
    "A11": "Table 1: K_t = 2, K_e = 0.03 are unequal in SI units",
    "A12": "a part that reaches zero speed rests there, under its static threshold",
}
CHOICES = ("A5", "A7", "A10", "A11")


class Errata(eqx.Module):
    """Which errata of the paper are corrected; none by default, so that all is as printed.

    Fields `A1`, `A2`, `A3`, `A4`, `A6`, `A8`, `A9`, `A12`: true where corrected, see
    `Errata.describe`. The others change no number of the algorithm and have no switch: A5 (the
    printed formula already takes 0.5 in Hz), A7 (`r_f` of the parameters), A10 (a misprint without a
    second meaning), A11 (the printed values are kept). `A6` acts through `scenario(3, errata)`.

    `Errata.corrected()` corrects all. **Raises** `TypeError` for a value that is not a boolean.
    """

    A1: Given[bool] = eqx.field(static=True, default=False)
    A2: Given[bool] = eqx.field(static=True, default=False)
    A3: Given[bool] = eqx.field(static=True, default=False)
    A4: Given[bool] = eqx.field(static=True, default=False)
    A6: Given[bool] = eqx.field(static=True, default=False)
    A8: Given[bool] = eqx.field(static=True, default=False)
    A9: Given[bool] = eqx.field(static=True, default=False)
    A12: Given[bool] = eqx.field(static=True, default=False)

    def __check_init__(self):
        for name in SWITCHES:
            check_flag(name, getattr(self, name))

    @staticmethod
    def corrected(**changes: Given[bool]) -> "Errata":
        """All corrected but for `changes`, e.g. `Errata.corrected(A8=False)`."""
        return Errata(**{**dict.fromkeys(SWITCHES, True), **changes})

    @staticmethod
    def describe(name: str) -> str:
        """What the consistent form of erratum `name` says; `ValueError` for an unknown name."""
        return CLAIMS[check_in("name", name, tuple(CLAIMS))]


SWITCHES = tuple(name for name in CLAIMS if name not in CHOICES)
