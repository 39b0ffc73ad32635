"""The lanes of the beam's diagrams as the statements read them."""

import dataclasses

import numpy as np
import xarray as xr

from .._thresholds import Beam
from ._model import CONTACT_PERIOD


def relative_width(points: np.ndarray) -> np.ndarray:
    """Spread of the points of each lane against their largest size; NaN for fewer than 3 points."""
    seen = np.isfinite(points)
    size = np.where(seen, np.abs(points), 0.0).max(axis=1)
    top = np.where(seen, points, -np.inf).max(axis=1)
    low = np.where(seen, points, np.inf).min(axis=1)
    enough = seen.sum(axis=1) >= Beam.FEWEST
    top, low = np.where(enough, top, np.nan), np.where(enough, low, np.nan)
    return (top - low) / np.where(size > 0, size, 1.0)


def everywhere(true: np.ndarray, told: np.ndarray, share: float = 1.0) -> bool | None:
    """Whether it is true in all lanes, or in more than `share` of them; None where that is not told.

    One lane of the other kind decides against "all", however few are known.
    """
    true, told = np.asarray(true, bool), np.asarray(told, bool)
    if share == 1.0 and bool((told & ~true).any()):
        return False
    if told.sum() < Beam.FEWEST or told.mean() < Beam.ENOUGH:
        return None
    return bool(true[told].mean() > share) if share < 1.0 else True


@dataclasses.dataclass
class Lanes:
    """One reading's lanes over the belt speed: widths of the maxima, sticks, and which of them are
    known.

    Lanes that failed, and for widths those with fewer than `Beam.FEWEST` points, are unknown.
    """

    v: np.ndarray
    points: dict[str, np.ndarray]
    width: dict[str, np.ndarray]
    told: dict[str, np.ndarray]
    sticks: np.ndarray
    share: np.ndarray
    counted: np.ndarray
    cycles: float

    @classmethod
    def of(cls, part: xr.Dataset) -> "Lanes":
        """From the diagrams of one reading."""
        ok = np.asarray(part.ok) == 1
        points = {
            name: np.where(ok[:, None], np.asarray(part[name].transpose("v", "point")), np.nan)
            for name in ("x", "y", "w")
        }
        width = {name: relative_width(a) for name, a in points.items()}
        sticks, share = np.asarray(part.sticks), np.asarray(part.stick_share)
        return cls(
            np.asarray(part.v), points, width, {name: np.isfinite(a) for name, a in width.items()},
            sticks, share, ok & np.isfinite(sticks) & np.isfinite(share),
            float(part.attrs["duration"]) / CONTACT_PERIOD,
        )  # fmt: skip

    @property
    def tail(self) -> str:
        """How many lanes are unknown in which observable; empty if none is."""
        return "".join(
            f"; {int((~known).sum())} of {self.v.size} lanes say nothing on {name}"
            for name, known in self.told.items()
            if not known.all()
        )

    @property
    def per_cycle(self) -> np.ndarray:
        """Sticks a contact, of lanes that count."""
        return np.where(self.counted, self.sticks, 0) / self.cycles

    def below(self) -> np.ndarray:
        """Lanes of stick-slip."""
        return self.v < Beam.STICK_SLIP_BELOW * (1 - Beam.BORDER)

    def between(self) -> np.ndarray:
        """Lanes of the middle range."""
        low, high = Beam.STICK_SLIP_BELOW * (1 + Beam.BORDER), Beam.SLIP_ABOVE * (1 - Beam.BORDER)
        return (self.v > low) & (self.v < high)

    def above(self) -> np.ndarray:
        """Lanes of pure slip."""
        return self.v > Beam.SLIP_ABOVE * (1 + Beam.BORDER)
