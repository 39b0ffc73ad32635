"""The same machine said otherwise: its motion must be the same.

Each function of `OF_NUMBERS` and `OF_STRUCTURES` returns the other machine, its numbers, and a function
that takes states of it `[time, component]` by name back; None where it does not apply.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from ._structure import Numbers, Parameter, Structure, dimension_of, words

States = dict[str, np.ndarray]
Other = tuple[Structure, Numbers, Callable[[np.ndarray, States], States]]


def units(s: Structure, n: Numbers, rng: np.random.Generator) -> Other | None:
    """Other units of length, force and time, by powers of ten."""
    if s.form and ("bristles" in s.form or "rad" in s.coordinates.values()):
        return None  # a width that is a speed for contacts of angles too
    if any(c.row and c.fixed and len({s.coordinates[x] for x in c.row}) > 1 for c in s.contacts):
        return None
    unit = 10.0 ** rng.integers(-12, 13, 3)
    unit[2] = 10.0 ** rng.integers(-6, 7)
    if len(set(s.coordinates.values())) > 1:
        # Inertias of angles and of lengths are joined, which costs the digits of their ratio.
        unit[0] = 10.0 ** rng.integers(-1, 2)

    def factor(dimension) -> float:
        return float(np.prod(unit ** np.array(dimension)))

    values = {name: n.values[name] * factor(p.dimension) for name, p in s.parameters.items()}
    start = {c: x * factor(dimension_of(s, c)) for c, x in n.start.items()}

    def back(t, states):
        return {c: y / factor(dimension_of(s, c)) for c, y in states.items()}

    return s, Numbers(values, start, n.end * float(unit[2])), back


def substituted(s: Structure, names: dict[str, str]) -> Structure:
    """All expressions with some names replaced by texts."""
    pattern = re.compile(r"\b(" + "|".join(map(re.escape, names)) + r")\b")

    def new(text):
        return None if text is None else pattern.sub(lambda m: names[m[0]], text)

    def row(r):
        return None if r is None else {c: new(x) for c, x in r.items()}

    contacts = tuple(
        replace(
            c, row=row(c.row), law=c.law, normal=new(c.normal), surface=new(c.surface), push=row(c.push)
        )
        for c in s.contacts
    )
    return replace(
        s,
        mass={pair: new(x) for pair, x in s.mass.items()},
        forces=tuple((c, new(x)) for c, x in s.forces),
        contacts=contacts,
        stops=tuple(replace(w, gap=new(w.gap)) for w in s.stops),
        states={x: (d, new(rate)) for x, (d, rate) in s.states.items()},
    )


def order(s: Structure, n: Numbers, rng: np.random.Generator) -> Other | None:
    """Coordinates, contacts, stops and terms in another order."""

    def mixed(those):
        those = list(those)
        return [those[i] for i in rng.permutation(len(those))]

    other = replace(
        s, coordinates=dict(mixed(s.coordinates.items())), forces=tuple(mixed(s.forces)),
        contacts=tuple(mixed(s.contacts)), stops=tuple(mixed(s.stops)),
    )  # fmt: skip
    same = list(other.coordinates) == list(s.coordinates) and other.contacts == s.contacts
    return None if same and other.stops == s.stops else (other, n, lambda t, states: states)


def _negative(text: str) -> str:
    try:
        return repr(-float(text))
    except ValueError:
        return f"-({text})"


def mirror(s: Structure, n: Numbers, rng: np.random.Generator) -> Other | None:
    """One coordinate counted in the other direction."""
    c = list(s.coordinates)[int(rng.integers(len(s.coordinates)))]
    other = substituted(s, {c: f"(-{c})", f"v_{c}": f"(-v_{c})"})

    def row(r):
        return r and {x: _negative(text) if x == c else text for x, text in r.items()}

    mass = {(a, b): x if (a == c) == (b == c) else _negative(x) for (a, b), x in other.mass.items()}
    other = replace(
        other,
        mass=mass,
        forces=tuple((x, _negative(term) if x == c else term) for x, term in other.forces),
        contacts=tuple(replace(k, row=row(k.row), push=row(k.push)) for k in other.contacts),
    )
    flip = {c, f"v_{c}"}
    start = {x: -y if x in flip else y for x, y in n.start.items()}

    def back(t, states):
        return {x: -y if x in flip else y for x, y in states.items()}

    return other, n._replace(start=start), back


def boost(s: Structure, n: Numbers, rng: np.random.Generator) -> Other | None:
    """One coordinate in a frame that moves evenly."""
    c = list(s.coordinates)[int(rng.integers(len(s.coordinates)))]
    if any(c in words(x) for x in s.mass.values()):
        return None  # the inertia may not depend on the time
    speed = round(float(rng.uniform(-1.0, 1.0)), 2)
    name = f"p{1 + max([int(p[1:]) for p in s.parameters], default=0)}"
    other = substituted(s, {c: f"({c} + {name} * t)", f"v_{c}": f"(v_{c} + {name})"})

    def moved(k):
        if c not in k.row:
            return k
        return replace(k, surface=f"{k.surface or '0.0'} - ({k.row[c]}) * {name}")

    frame = Parameter(dimension_of(s, f"v_{c}"), 0.0, 1.0, True, True)
    other = replace(
        other, contacts=tuple(map(moved, other.contacts)), parameters={**s.parameters, name: frame}
    )
    start = {**n.start, f"v_{c}": n.start[f"v_{c}"] - speed}

    def back(t, states):
        found = dict(states)
        found[f"v_{c}"] = states[f"v_{c}"] + speed
        if c in states:
            found[c] = states[c] + speed * t
        return found

    return other, Numbers({**n.values, name: speed}, start, n.end), back


def relative(s: Structure, n: Numbers, rng: np.random.Generator) -> Other | None:
    """One coordinate as the distance from another: a full mass matrix, more rows across."""
    free = [c for c in s.coordinates if c not in s.cyclic and s.coordinates[c] == "m"]
    if len(free) < 2:
        return None
    i, j = rng.choice(len(free), 2, replace=False)
    c, b = free[i], free[j]  # c is c + b from now on
    other = substituted(s, {c: f"({c} + {b})", f"v_{c}": f"(v_{c} + v_{b})"})

    def entry(x, y):
        return other.mass.get((x, y)) or other.mass.get((y, x)) or "0.0"

    def plus(*texts):
        return " + ".join(x for x in texts if x != "0.0") or "0.0"

    def row(r):
        if not r or c not in r:
            return r
        try:
            return {**r, b: repr(float(r[c]) + float(r.get(b, 0.0)))}
        except ValueError:
            return {**r, b: plus(r[c], r.get(b, "0.0"))}

    mass, names = {}, list(s.coordinates)
    for k, x in enumerate(names):
        for y in names[k:]:
            parts = [entry(x, y)]
            parts += [entry(c, y)] if x == b else []
            parts += [entry(x, c)] if y == b else []
            parts += [entry(c, c)] if x == y == b else []
            if (text := plus(*parts)) != "0.0":
                mass[x, y] = text
    forces = [*other.forces, *((b, term) for x, term in other.forces if x == c)]
    contacts = tuple(replace(k, row=row(k.row), push=row(k.push)) for k in other.contacts)
    if any(k.fixed and not any(float(x) for x in k.row.values()) for k in contacts):
        return None
    start = {**n.start, c: n.start[c] - n.start[b], f"v_{c}": n.start[f"v_{c}"] - n.start[f"v_{b}"]}

    def back(t, states):
        return {**states, c: states[c] + states[b], f"v_{c}": states[f"v_{c}"] + states[f"v_{b}"]}

    other = replace(other, mass=mass, forces=tuple(forces), contacts=contacts)
    return other, n._replace(start=start), back


OF_STRUCTURES: dict[str, Any] = {
    "order": order, "mirror": mirror, "boost": boost, "relative": relative,
}  # fmt: skip
