"""Numbers that decide in maps of basins, each with its unit and its meaning, chosen by us."""

import dataclasses


@dataclasses.dataclass(frozen=True)
class Accuracy:
    """Numbers that decide in maps of basins; `ACCURACY` is the one object of this class."""

    rounds: int = 32
    """Parts of the duration, after each of which motions are judged."""
    many: int = 128
    """Pieces of an orbit, at least: its cubics are then off by some 1e-8 of its size. Motions about an
    attractor at each radius that is looked at, and those that are judged together. States between two
    at rest, all of which must be."""
    few: int = 8
    """Places of an orbit about which motions are looked at. Motions that are asked for an attractor in
    one go. Durations for which motions beside a border are followed, at most."""
    levels: int = 12
    """Radii about an attractor, each half of the one before, at which motions are looked at. Steps of
    Newton's method to a border."""
    near: float = 0.1
    """Part of the motions' size: an unstable motion so near to one from the border is on it; a radius
    about a motion that never repeats is at most that. Part by which deviations from an attractor decay
    over the duration, at least. Angle by which a border bends between two places [rad], and part of the
    box that they are apart, at most. A tenth of `ENGINE.same`, by which attractors are one, is the part
    of the way between two places to which a border is enclosed where it begins."""
    block: int = 8 * many
    """Motions in one call of their program."""
    places: int = 4 * block
    """Of a motion that never repeats, by which it is known. Of a border, which may be longer only if it
    is fractal."""
    corners: int = 32 * block
    """Of the polygon that stands for a border."""


ACCURACY = Accuracy()
