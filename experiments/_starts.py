"""How the motions of an identification start: a choice that each report names."""

import dataclasses

KINDS = {
    "rest": "from rest",
    "given": "from a state that is given",
    "fitted": "from a state that is fitted",
}


@dataclasses.dataclass(frozen=True)
class Start:
    """The state in which a motion starts: its `kind`, one of `KINDS`, and `how` it is known.

    Errors: `ValueError` for another kind.
    """

    kind: str
    how: str = ""

    def __post_init__(self):
        if self.kind not in KINDS:
            raise ValueError(f"kind is {self.kind!r}; it must be one of {', '.join(KINDS)}.")

    def __str__(self) -> str:
        return KINDS[self.kind] + (f": {self.how}" if self.how else "")


def starts_told(**starts: Start) -> str:
    """A line for each of the motions that are `fitted`, `scored` and so on, printed and returned."""
    told = "\n".join(f"{what.replace('_', ' ')} {start}" for what, start in starts.items())
    print(told)
    return told
