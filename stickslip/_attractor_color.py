"""The colour of an attractor, the same in pictures and in the viewer."""

COLORS = ("#4477aa", "#ccbb44", "#66ccee", "#228833", "#aa3377", "#ee6677", "#997700", "#004488")
# Of motions that come to none.
OTHERS = {"not settled": "lightgrey", "left the limits": "white", "failed": "black"}


def attractor_color(name: str, number: int) -> str:
    """Colour of the attractor, or other class of motions, with a name and a place among all."""
    return OTHERS.get(name, COLORS[number % len(COLORS)])
