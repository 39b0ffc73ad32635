"""Names and units of a sweep and its results, and what is written beside the numbers."""

import dataclasses
from collections.abc import Mapping
from typing import Any

from .._types import Given, Named
from .._validation import check_mapping, check_text, check_type, refusal


@dataclasses.dataclass(frozen=True)
class Variable:
    """How a result of a lane is labelled.

    - `dims`: names of its axes after those of the grid, e.g. `("point",)`.
    - `units`, `long_name`: for axes of pictures and for readers of the file.
    - `attrs`: further attributes, e.g. `flag_values` and `flag_meanings` of a code.

    Errors: `TypeError` for anything but a name, text or mapping.
    """

    dims: tuple[str, ...] = ()
    units: str | None = None
    long_name: str | None = None
    attrs: Mapping[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self):
        if not isinstance(self.dims, tuple) or not all(isinstance(dim, str) for dim in self.dims):
            raise refusal("dims", self.dims, "a tuple of names of axes", TypeError)
        check_type("units", self.units, str | None, "a text or None")
        check_type("long_name", self.long_name, str | None, "a text or None")
        check_type("attrs", self.attrs, Mapping, "a mapping from names")
        check_mapping("attrs", self.attrs)

    def attributes(self) -> dict[str, Any]:
        """Attributes of the array in the dataset."""
        named = {"units": self.units, "long_name": self.long_name}
        return {k: v for k, v in named.items() if v is not None} | dict(self.attrs)


@dataclasses.dataclass(frozen=True)
class Labels:
    """Words about a sweep, written into its dataset and its store.

    - `variables`: a `Variable` for each result or coordinate that has a unit or a long name, by name.
    - `settings`: parameters, seeds and whatever else describes the sweep. They are part of what it is:
      a sweep whose settings differ from those in the store is another one.
    - `attrs`: attributes of the dataset.
    - `name`: title of the dataset, and how the progress line begins; by default the analysis's own.

    `variables`, `attrs` and `name` reach no number, and may differ when a sweep is taken up again.

    Errors: `ValueError`/`TypeError` naming the field, its value and what is allowed.
    """

    variables: Given[Mapping[str, Variable] | None] = None
    settings: Named | None = None
    attrs: Named | None = None
    name: Given[str | None] = None

    def __post_init__(self):
        for field in ("variables", "settings", "attrs"):
            object.__setattr__(self, field, check_mapping(field, getattr(self, field)))
        for key, label in self.variables.items():  # pyright: ignore[reportOptionalMemberAccess]
            check_type(f"variables[{key!r}]", label, Variable, "a Variable")
        if self.name is not None:
            check_text("name", self.name)
