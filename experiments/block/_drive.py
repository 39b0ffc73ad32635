"""The drive with the sign of the belt reaction as a number: one program serves both signs."""

import dataclasses
from typing import Any

from stickslip.systems import DCDrive

# Factor of the consistent reaction in each reading of the paper (B-E2).
SIGNS = {"consistent": 1.0, "printed": -1.0}


class SignedDrive(DCDrive):
    """`DCDrive` whose belt reaction has the factor `sign`, 1 or -1, known or traced.

    A word is part of the program, so that each sign would be traced and compiled by itself. The motion
    is that of `belt_reaction`; the powers, which ask for the word, are not.
    """

    sign: Any

    def __init__(self, sign: Any, **values: Any):
        super().__init__(**values)
        self.sign = sign

    @property
    def reaction(self) -> Any:
        """Torque on the rotor per T_s [m]."""
        return self.sign * self.transmission / self.eta


def signed_drive(sign: Any, **changes: Any) -> SignedDrive:
    """The constructed drive with the `sign` of its belt reaction; `changes` replace single values."""
    each = {word: DCDrive.constructed(belt_reaction=word) for word in SIGNS}
    numbers = [
        field.name for field in dataclasses.fields(DCDrive) if not field.metadata.get("static", False)
    ]
    values = {name: getattr(each["consistent"], name) for name in numbers}
    upper, lower = (each[word].U_in for word in ("consistent", "printed"))
    # One of the two terms is zero: exactly the voltage of that sign.
    values["U_in"] = 0.5 * ((1.0 + sign) * upper + (1.0 - sign) * lower)
    return SignedDrive(sign, **{**values, **changes})
