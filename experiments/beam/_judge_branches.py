"""The paper's claims on the motion of the mass against branches of periodic orbits."""

import dataclasses

import numpy as np
import xarray as xr

from .._statement import Claim, Statement, Untold, Verdict, statement
from .._thresholds import Beam
from ._judge import MIDDLE, is_found

LOW, HIGH = Beam.STICK_SLIP_BELOW, Beam.SLIP_ABOVE


@dataclasses.dataclass
class Followed:
    """One branch in the order of the belt speed: orbits and special points."""

    orbits: xr.Dataset
    specials: xr.Dataset

    @classmethod
    def of(cls, dataset: xr.Dataset, variant: str, damping: float) -> "Followed":
        """That of one reading and damping; raises `Untold` where there is none."""
        parts = []
        for axis in ("orbit", "special"):
            mine = (dataset[f"{axis}_variant"] == variant) & (dataset[f"{axis}_damping"] == damping)
            parts.append(dataset.isel({axis: np.flatnonzero(mine)}).sortby(f"{axis}_v"))
        if not parts[0].sizes["orbit"]:
            raise Untold(f"no branch with a damping of {damping:g}")
        return cls(*parts)

    @property
    def v(self) -> np.ndarray:
        """Belt speeds of the orbits."""
        return np.asarray(self.orbits.orbit_v)

    @property
    def sticks(self) -> np.ndarray:
        """Whether each orbit sticks."""
        return np.asarray(self.orbits.orbit_stick) > 0

    @property
    def largest(self) -> np.ndarray:
        """Size of the largest multiplier of each orbit."""
        return np.asarray(self.orbits.orbit_size).max(axis=1)

    def marked(self, label: str) -> xr.Dataset:
        """Special points with a label."""
        return self.specials.isel(special=np.flatnonzero(self.specials.special_label == label))

    def must_reach(self, low: float, high: float) -> None:
        """Raises `Untold` if the branch does not reach over a range of speeds."""
        ends = np.append(self.v, self.specials.special_v)
        if ends.min() > low or ends.max() < high:
            text = f"the branch is known from v = {ends.min():.4g} to {ends.max():.4g} only"
            raise Untold(text)

    def end_of_stick(self) -> xr.Dataset:
        """The one last orbit with a stick; raises `Untold` where the branch has none."""
        borders = self.marked("GR")
        if not (self.sticks.any() and (~self.sticks).any()):
            raise Untold("the branch has orbits of one kind only")
        if borders.sizes["special"] != 1:
            raise Untold(f"the branch has {borders.sizes['special']} borders of its events")
        border = borders.isel(special=0)
        if not (self.sticks == (self.v <= float(border.special_v))).all():
            raise Untold("the orbits with a stick are not those before the border")
        return border


@statement("C3b", f"y: the orbit of stick-slip ends at v = {LOW:g}.")
def stick_ends(branch: Followed, damped: Followed | None) -> Verdict:
    """Speed of the last orbit with a stick, and what becomes of the multipliers there."""
    border = branch.end_of_stick()
    at, kind = float(border.special_v), str(border.special_words.item()).partition(",")[0]
    text = f"its stick has no length left at v = {at:.9f} ({kind}); {_jump(branch, at)}"
    text += _of_beam(branch, border)
    if damped is not None:
        text += f"; {_of_damped(damped)}"
    return abs(at / LOW - 1.0) < Beam.SAME_BORDER, text


def _jump(branch: Followed, at: float) -> str:
    """Multipliers of the mass on both sides: of the last orbit with a stick, and the next one."""
    here = branch.marked("GR").isel(special=0)
    size, turn = np.asarray(here.special_size), np.asarray(here.special_turn)
    # A stick leaves the mass one multiplier, a real one; the beam's are pairs.
    real = size[(turn == 0.0) & (size > 0.0)]
    beyond = branch.orbits.isel(orbit=int(np.flatnonzero(branch.v > at)[0]))
    pair = int(np.argmax(np.abs(np.asarray(beyond.orbit_size) - 1.0)))
    size, turn = float(beyond.orbit_size[pair]), float(beyond.orbit_turn[pair])
    before = f"{real.max():.3f} and 0" if real.size else "none but 0"
    return (
        f"the mass has the multipliers {before} before, a pair of size {size:.4f} and frequency "
        f"{turn:.4f} beyond"
    )


def _of_beam(branch: Followed, border: xr.Dataset) -> str:
    """Where and by how much a mode of the beam is unstable before the stick ends; empty if none is."""
    torus = np.asarray(branch.marked("NS").special_v)
    torus = torus[torus < float(border.special_v)]
    grows = branch.largest - 1.0
    if not torus.size or not (grows[branch.sticks] > Beam.NEUTRAL).any():
        return ""
    last, greatest = float(torus.max()), float(np.max(border.special_size)) - 1.0
    after, before = grows[branch.sticks & (branch.v > last)], grows[branch.v < last]
    return (
        f"; before that a mode of the beam leaves the unit circle at v = {last:.9f}, by "
        f"{max([greatest, *after]):.1e} at most (below it by {max([0.0, *before]):.1e})"
    )


def _of_damped(damped: Followed) -> str:
    """The same with a little damping."""
    try:
        at = float(damped.end_of_stick().special_v)
    except Untold as reason:
        return f"with damping it cannot be told: {reason}"
    damping = float(damped.orbits.orbit_damping[0])
    stable = "all" if bool((damped.largest[damped.sticks] < 1.0).all()) else "not all"
    return f"with a damping ratio of {damping:g} at {at:.9f}, {stable} orbits before are stable"


@statement("C4c", f"y: the orbit of stick-slip doubles its period in {MIDDLE}.")
def doubles(branch: Followed, damped: Followed | None) -> Verdict:
    """Period doublings of the branch in that range."""
    branch.must_reach(LOW, HIGH)
    found = np.asarray(branch.marked("PD").special_v)
    inside = found[(found >= LOW * (1 - Beam.BORDER)) & (found <= HIGH * (1 + Beam.BORDER))]
    rows = (branch.v >= LOW) & (branch.v <= HIGH)
    text = f"{inside.size} doublings of the orbit, none computed there"
    if rows.any():
        share = float((branch.largest[rows] <= 1.0 + Beam.NEUTRAL).mean())
        text = f"{inside.size} doublings of the orbit; {share:.0%} of the orbits there do not repel"
    if inside.size:
        text += ", at v = " + ", ".join(f"{v:.8f}" for v in inside)
    return bool(inside.size), text


@statement("C5b", f"y: an orbit of pure slip attracts for v > {HIGH:g}.")
def slip_attracts(branch: Followed, damped: Followed | None) -> Verdict:
    """Stability of the orbits without stick above the second border."""
    rows = branch.v > HIGH * (1 + Beam.BORDER)
    if rows.sum() < Beam.FEWEST:
        raise Untold(f"{int(rows.sum())} orbits are known there")
    slips = ~branch.sticks[rows]
    stable = branch.largest[rows] <= 1.0 + Beam.NEUTRAL
    strongest = np.asarray(branch.orbits.orbit_size)[rows]
    away = np.take_along_axis(strongest, np.argmax(np.abs(strongest - 1.0), axis=1)[:, None], axis=1)[
        :, 0
    ]
    text = (
        f"{slips.mean():.0%} of the orbits there slip throughout, {stable.mean():.0%} do not repel; "
        f"the multipliers of the mass have sizes from {away.min():.4f} to {away.max():.4f}"
    )
    if damped is not None:
        high = damped.v > HIGH * (1 + Beam.BORDER)
        share = damped.largest[high] < 1.0
        text += f"; with damping {share.mean():.0%} are stable" if share.size else ""
    return bool((slips & stable).all()), text


CLAIMS: tuple[Claim, ...] = (stick_ends, doubles, slip_attracts)


def judge_branches(dataset: xr.Dataset) -> list[Statement]:
    """C3b, C4c and C5b for each reading, from its branch without damping."""
    found = []
    for variant in map(str, dataset.variant.values):
        branch = Followed.of(dataset, variant, 0.0)
        damping = float(dataset.attrs["damping"])
        damped = Followed.of(dataset, variant, damping) if damping > 0 else None
        found += [claim(variant, branch, damped, found=is_found(variant)) for claim in CLAIMS]
    return found
