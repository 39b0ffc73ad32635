"""The smallest machine that is still wrong: features are taken away one by one."""

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from ._structure import Numbers, Structure, words


def smaller(s: Structure, n: Numbers, literals: bool = True) -> Iterator[tuple[Structure, Numbers]]:
    """Machines with one feature less, the coarse cuts first.

    `literals`: whether a mass, a force or a law may become a number that is written down, and so has no
    unit.
    """
    for c in s.coordinates:
        if len(s.coordinates) > 1:
            yield from _without(s, n, c)
    for name, values in (("contacts", s.contacts), ("stops", s.stops), ("forces", s.forces)):
        for i in range(len(values)):
            yield replace(s, **{name: (*values[:i], *values[i + 1 :])}), n
    if s.states and not any("s" in words(x) for x in [*(t for _, t in s.forces), *_normals(s)]):
        yield replace(s, states={}), n
    if s.breaks:
        yield replace(s, breaks=(), period=None), n
    for name, plain in (("cyclic", ()), ("time_scale", None), ("form", ""), ("style", "mapping")):
        if getattr(s, name) != plain:
            yield replace(s, **{name: plain}), n
    for pair in s.mass:
        if pair[0] != pair[1]:
            yield replace(s, mass={p: x for p, x in s.mass.items() if p != pair}), n
        elif literals and s.mass[pair] != "1.0":
            yield replace(s, mass={**s.mass, pair: "1.0"}), n
    for i, c in enumerate(s.contacts):
        plainer = [replace(c, push=None), replace(c, opens=False, push=None), replace(c, surface=None)]
        if literals:
            plainer += [replace(c, normal=None, opens=False, push=None)]
        names = [x for x in s.parameters if x in words(c.law)]
        limits = [*names[:1], "1.0"] if literals else names[:1]
        plainer += [replace(c, law=f"Coulomb({x})") for x in limits]
        if len(c.row) > 1:
            plainer += [replace(c, row={x: c.row[x]}) for x in c.row]
        for new in plainer:
            if new != c:
                yield replace(s, contacts=(*s.contacts[:i], new, *s.contacts[i + 1 :])), n
    for i, (c, term) in enumerate(s.forces):
        short = "1.0" if "t" not in words(term) else "sin(t)"
        if literals and len(term) > len(short) + 4:
            yield replace(s, forces=(*s.forces[:i], (c, short), *s.forces[i + 1 :])), n
    for name, p in s.parameters.items():
        if p.where != "field":
            yield replace(s, parameters={**s.parameters, name: replace(p, where="field")}), n
    for c, x in n.start.items():
        if x and c in s.components:
            yield s, n._replace(start={**n.start, c: 0.0})
    for name in s.parameters:
        for plain in (1.0, 0.0):
            if n.values[name] not in (0.0, 1.0):
                yield s, n._replace(values={**n.values, name: plain})


def _normals(s: Structure) -> list[str]:
    return [c.normal or "" for c in s.contacts]


def _without(s: Structure, n: Numbers, gone: str) -> Iterator[tuple[Structure, Numbers]]:
    """Without a coordinate, and all that names it."""
    own = {gone, f"v_{gone}"}

    def free(*texts: str | None) -> bool:
        return not any(own & words(x or "") for x in texts)

    mass = {p: x for p, x in s.mass.items() if gone not in p}
    if not free(*mass.values(), *(rate for _, rate in s.states.values())):
        return
    contacts = []
    for c in s.contacts:
        row = {x: text for x, text in c.row.items() if x != gone}
        push = {x: text for x, text in (c.push or {}).items() if x != gone} or None
        if row and free(*row.values(), c.normal, c.surface):
            contacts.append(replace(c, row=row, push=push))
    yield (
        replace(
            s,
            coordinates={c: k for c, k in s.coordinates.items() if c != gone},
            mass=mass,
            forces=tuple((c, term) for c, term in s.forces if c != gone and free(term)),
            contacts=tuple(contacts),
            stops=tuple(w for w in s.stops if free(w.gap)),
            cyclic=tuple(c for c in s.cyclic if c != gone),
        ),
        n,
    )


def shrunk(
    structure: Structure, n: Numbers, wrong: Callable[[Structure, Numbers], bool], seconds: float,
    literals: bool = True,
) -> tuple[Structure, Numbers]:  # fmt: skip
    """Take away while it stays wrong, for so many seconds of the processor; see `smaller`."""
    end, again = time.process_time() + seconds, True
    while again:
        again = False
        for s, m in smaller(structure, n, literals):
            if time.process_time() > end:
                return structure, n
            s = s.pruned()
            m = m._replace(start={c: x for c, x in m.start.items() if c in s.components})
            try:
                still = wrong(s, m)
            except Exception:  # what is left is no machine any more
                still = False
            if still:
                structure, n, again = s, m, True
                break
    return structure, n
