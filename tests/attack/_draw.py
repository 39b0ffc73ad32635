"""Random machines: structures of all that may be declared, and numbers degenerate on purpose."""

from dataclasses import replace

import numpy as np

from ._reference import March
from ._structure import Dimension, Numbers, Parameter, Structure, Touch, Wall, dimension_of

LENGTH, FORCE, TIME, NONE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)
RATE, PER_TIME = (1, 0, -1), (0, 0, -1)
TURN = "6.283185307179586"


def over(a: Dimension, b: Dimension) -> Dimension:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def product(*those: Dimension) -> Dimension:
    return tuple(map(sum, zip(*those, strict=True)))


class Draw:
    """One structure in the making."""

    def __init__(self, rng: np.random.Generator):
        self.rng, self.parameters = rng, {}
        n = rng.choice([1, 2, 3, 4], p=[0.35, 0.42, 0.17, 0.06])
        kinds = rng.choice(["m", "rad"], n, p=[0.75, 0.25])
        lengths, angles = iter("xyzw"), iter("abcd")
        self.kinds = {next(lengths if k == "m" else angles): str(k) for k in kinds}
        self.names = list(self.kinds)
        angles = [c for c, k in self.kinds.items() if k == "rad"]
        self.cyclic = tuple(angles[:1]) if angles and self.chance(0.25) else ()
        self.free = [c for c in self.names if c not in self.cyclic]  # on which something may depend
        self.breaks, self.period, self.jump = (), None, ""
        self.states: dict[str, tuple[Dimension, str]] = {}

    def chance(self, p: float) -> bool:
        return bool(self.rng.random() < p)

    def one(self, those):
        return those[int(self.rng.integers(len(those)))]

    def kind(self, weights: dict[str, float]) -> str:
        p = np.array(list(weights.values()))
        return str(self.rng.choice(list(weights), p=p / p.sum()))

    def new(self, dimension, low, high, where=None, **how) -> str:
        """A new parameter, by its name."""
        where = where or self.kind({"field": 0.8, "args": 0.1, "default": 0.1})
        name, default = f"p{len(self.parameters)}", round(0.5 * (low + high), 3)
        self.parameters[name] = Parameter(dimension, low, high, where=where, default=default, **how)
        return name

    def q(self, c):
        return LENGTH if self.kinds[c] == "m" else NONE

    def f(self, c):
        return FORCE if self.kinds[c] == "m" else (1, 1, 0)

    def bent(self, c, where=None) -> str:
        """A function of a coordinate without dimension, 0 at 0, or 1 there."""
        inner = c if self.kinds[c] == "rad" else f"{c} / {self.new(LENGTH, 0.3, 1.5, where)}"
        return self.kind({f"sin({inner})": 3, f"cos({inner})": 2, f"tanh({inner})": 1})

    def wave(self) -> str:
        w = self.new(PER_TIME, 0.5, 6.0)
        phase = self.kind({"": 2, f" + {round(float(self.rng.uniform(0, 3)), 2)}": 1})
        return f"{self.one(['sin', 'cos'])}({w} * t{phase})"

    def structure(self) -> Structure:
        self._breaks()
        if self.chance(0.2):
            tau = self.new(TIME, 0.2, 1.0)
            drive = f"{self.new(NONE, 0.2, 2.0, signed=True)} * {self.wave()}"
            c = self.one(self.names)
            if self.chance(0.5):
                drive = f"{self.new(over(NONE, self._rate(c)), 0.2, 1.5, signed=True)} * v_{c}"
            self.states["s"] = (NONE, f"({drive} - s) / {tau}")
        mass = self._mass()
        forces = self._forces()
        contacts: list[Touch] = []
        for i in range(self.rng.choice(5, p=[0.05, 0.48, 0.32, 0.11, 0.04])):
            contacts.append(self._contact(i, contacts))
        stops = tuple(
            self._wall(i) for i in range(self.rng.choice(3, p=[0.68, 0.24, 0.08])) if self.free
        )
        scale = self.new(TIME, 0.05, 0.3, "field") if self.chance(0.3) else None
        form = ""
        if not stops and contacts and self.chance(0.1):
            width = self.new(RATE, 0.02, 0.1, "field")
            form = f"regularised({width})"
            if self.chance(0.4):
                stiff = self.new(over(NONE, LENGTH), 200.0, 2000.0, "field")
                damping = self.new(over(NONE, RATE), 2.0, 10.0, "field")
                form = f"bristles(LuGre, sigma_0={stiff}, sigma_1={damping}, v_s={width})"
        style = self.kind({"mapping": 2, "tuple": 1, "array": 1})
        found = Structure(
            self.kinds, mass, tuple(forces), tuple(contacts), stops, self.states, self.cyclic,
            self.breaks, self.period, scale, form, self.parameters, style,
        )  # fmt: skip
        return found.pruned()

    def _rate(self, c):
        return over(self.q(c), TIME)

    def _breaks(self):
        if self.chance(0.2):
            a = self.new(TIME, 0.5, 2.5, "field")
            self.breaks, self.jump = (a,), f"t >= {a}"
            if self.chance(0.3):
                b = f"{a} + {self.new(TIME, 0.5, 2.0, 'field')}"
                self.breaks, self.jump = (a, b), f"(t >= {a}) & (t < {b})"
        elif self.chance(0.1):
            self.period = T = self.new(TIME, 0.8, 2.5, "field")
            self.breaks, self.jump = ("0.0", f"0.25 * {T}"), f"mod(t, {T}) >= 0.25 * {T}"
            if self.chance(0.5):
                self.breaks, self.jump = ("0.0", f"0.5 * {T}"), f"sin({TURN} * t / {T}) >= 0.0"

    def _mass(self):
        mass, kind = {}, self.kind({"diagonal": 4, "full": 3, "varying": 3})
        for i, a in enumerate(self.names):
            own = product(self.f(a), (0, 0, 2), over(NONE, self.q(a)))
            m = self.new(own, 0.8, 2.5, "field")
            mass[a, a] = m
            if kind == "varying" and self.free and self.chance(0.3):
                small = self.new(own, 0.05, 0.5, "field", zero=True)
                mass[a, a] = f"{m} + {small} * {self.bent(self.one(self.free), 'field')} ** 2"
            for b in self.names[i + 1 :]:
                if kind == "diagonal" or self.chance(0.25):
                    continue
                across = product(self.f(a), (0, 0, 2), over(NONE, self.q(b)))
                mass[a, b] = self.new(across, 0.05, 0.22, "field", signed=True, zero=True)
                if kind == "varying" and self.free and self.chance(0.7):
                    mass[a, b] += f" * {self.bent(self.one(self.free), 'field')}"
        return mass

    def _forces(self):
        found = []
        for c in self.names:
            F, q = self.f(c), self.q(c)
            if c in self.free and self.chance(0.7):
                found.append((c, f"-{self.new(over(F, q), 0.5, 12.0, zero=True)} * {c}"))
            if self.chance(0.35):
                found.append((c, f"-{self.new(over(F, self._rate(c)), 0.02, 0.5, zero=True)} * v_{c}"))
            if self.chance(0.45):
                found.append((c, f"{self.new(F, 0.3, 3.0, signed=True, zero=True)} * {self.wave()}"))
            if self.chance(0.25):
                found.append((c, self.new(F, 0.1, 1.5, signed=True, zero=True)))
            if self.jump and self.chance(0.6):
                load = self.new(F, 0.3, 2.5, signed=True)
                found.append((c, f"where({self.jump}, {load}, {self.one(['0.0', f'-{load}'])})"))
            if c in self.free and self.chance(0.2):
                found.append((c, self._bending(c)))
            for b in self.free:
                if b != c and self.kinds[b] == "rad" and self.chance(0.3):
                    power = self.one([1, 4, 16, 50])
                    lift = f"(0.5 + 0.5 * cos({b})) ** {power}"
                    found.append((c, f"{self.new(F, 0.5, 3.0, signed=True)} * {lift}"))
                if b != c and self.kinds[b] == self.kinds[c] and c in self.free and self.chance(0.25):
                    k = self.new(over(F, q), 0.5, 6.0)
                    found += [(c, f"-{k} * ({c} - {b})"), (b, f"-{k} * ({b} - {c})")]
            if self.chance(0.08):
                b = self.one(self.names)
                g = self.new(over(F, product(self._rate(c), self._rate(b))), 0.05, 0.3, signed=True)
                found.append((c, f"{g} * v_{c} * v_{b}"))
            if self.states and self.chance(0.6):
                found.append((c, f"{self.new(F, 0.2, 2.0, signed=True)} * s"))
        return found

    def _bending(self, c) -> str:
        """A force that bends or jumps in the state, as people write it."""
        F, q, rate = self.f(c), self.q(c), self._rate(c)
        k, edge = self.new(over(F, q), 2.0, 40.0), self.new(q, 0.02, 0.4)
        d, drag = self.new(over(F, rate), 0.1, 2.0), self.new(over(F, product(rate, rate)), 0.1, 1.0)
        past = f"maximum({c} - {edge}, 0.0)"
        return self.one([
            f"-{k} * {past}",
            f"where({c} > {edge}, -{k} * ({c} - {edge}) - {d} * v_{c}, 0.0)",
            f"where({past} > 0.0, -{k} * {past} - {d} * v_{c}, 0.0)",
            f"-{k} * ({past} + minimum({c} + {edge}, 0.0))",
            f"-{k} * clip({c}, -{edge}, {edge})",
            f"-{drag} * abs(v_{c}) * v_{c}",
            f"-{k} * {past} * sqrt({past} / {edge})",
        ])  # fmt: skip

    def _row(self, before):
        kind = self.kind({"one": 5, "pair": 2, "copy": 1.5, "given": 1, "varying": 2})
        c = self.one(self.names)
        same = [b for b in self.names if b != c and self.kinds[b] == self.kinds[c]]
        fixed = [b for b in before if b.fixed]
        if kind == "pair" and same:
            return {c: "1.0", self.one(same): self.one(["-1.0", "1.0", "0.5"])}, True
        if kind == "copy" and fixed:
            old = self.one(fixed).row
            factor = self.one([1.0, -1.0, 2.0])
            return {b: repr(factor * float(x)) for b, x in old.items()}, True
        if kind == "given":
            return {c: self.new(NONE, 0.3, 2.0, signed=True)}, False
        if kind == "varying" and self.free:
            b = self.one(self.free)
            lever = "" if self.kinds[c] == "m" else f"{self.new(LENGTH, 0.3, 1.5)} * "
            row = {c: f"{lever}{self.bent(b)}"}
            others = [b for b in self.names if b != c and self.kinds[b] == "m"]
            if others and self.chance(0.5):
                row[self.one(others)] = self.one(["1.0", self.bent(b)])
            return row, False
        return {c: self.one(["1.0", "1.0", "-1.0"])}, True

    def _contact(self, number, before):
        row, fixed = self._row(before)
        angular = all(self.kinds[c] == "rad" for c in row) and not any("*" in x for x in row.values())
        F, u = ((1, 1, 0), PER_TIME) if angular else (FORCE, RATE)
        normal, opens, push = None, False, None
        kind = self.kind({"1": 3, "number": 4, "time": 1.5, "off": 1, "state": 1.5, "jump": 3})
        if kind == "number":
            normal = self.new(F, 0.3, 2.0, zero=True)
        elif kind == "time":
            normal = f"{self.new(F, 0.5, 2.0)} + {self.new(F, 0.2, 1.5)} * {self.wave()}"
        elif kind == "off":
            normal = f"{self.new(F, 0.5, 3.0)} * maximum({self.wave()}, 0.0)"
        elif kind == "state" and (self.free or self.states):
            if self.states and self.chance(0.4):
                normal = f"{self.new(F, 0.5, 2.0)} + {self.new(F, 0.2, 2.0, signed=True)} * s"
            elif self.free:
                b = self.one(self.free)
                k = self.new(over(F, self.q(b)), 0.3, 3.0, signed=True)
                normal = f"{self.new(F, 0.3, 2.0, zero=True)} + {k} * {b}"
        elif kind == "jump" and self.jump:
            least = self.one(["0.0", f"0.001 * {self.new(F, 0.5, 1.0)}"])
            normal = f"where({self.jump}, {self.new(F, 0.5, 3.0)}, {least})"
        if normal and kind in ("time", "state", "jump", "off"):
            opens = self.chance(0.5)
            if opens and self.free and self.chance(0.4):
                b = self.one(self.names)
                if over(self.f(b), F) == NONE:
                    push = {b: self.one(["1.0", "-1.0"])}
        surface = None
        if self.chance(0.45):
            speed = self.new(u, 0.1, 1.0, signed=True, zero=True)
            surface = speed if self.chance(0.65) else f"{speed} * {self.wave()}"
        law = self._law(NONE if normal else F, F, u)
        return Touch(f"c{number}", row, fixed, law, normal, surface, opens, push)

    def _law(self, mu, F, u):
        def coefficient(**how):
            return self.new(mu, 0.15, 1.2, **how)

        kind = self.kind({"C": 3, "CC": 3, "S": 2, "H": 1.5, "A": 1, "V": 1, "D": 1})
        if kind == "C":
            return f"Coulomb({coefficient(zero=True)})"
        if kind == "S":
            k, v = coefficient(zero=True), self.new(u, 0.05, 0.5)
            exponent = self.one(["", ", 1", ", 1.5"])
            return f"Stribeck({k} + {coefficient(zero=True)}, {k}, {v}{exponent})"
        if kind == "H":
            weak = self.new(over(NONE, u), 0.2, 3.0, zero=True)
            return f"HyperbolicWeakening({coefficient()}, {weak}, {coefficient()})"
        dry = f"Coulomb({coefficient()}, {coefficient(zero=True)})"
        if kind == "A":
            return f"Asymmetric({dry}, Coulomb({coefficient(zero=True)}))"
        if kind == "V":
            return f"Sum({dry}, ViscousFriction({self.new(over(mu, u), 0.05, 0.5, zero=True)}))"
        if kind == "D":
            return f"Sum({dry}, ViscousDamping({self.new(over(F, u), 0.05, 0.5, zero=True)}))"
        return dry

    def _wall(self, number):
        c = self.one(self.free)
        g = self.new(self.q(c), 0.15, 0.8)
        same = [b for b in self.free if b != c and self.kinds[b] == self.kinds[c]]
        gap = self.one([f"{g} - {c}", f"{g} + {c}"])
        if same and self.chance(0.35):
            b = self.one(same)
            gap = f"{g} + {c} - {b}"
            if self.kinds[c] == "m" and self.chance(0.3):
                gap = f"{g} + {b} - {c} * {c} / {self.new(LENGTH, 0.3, 2.0)}"
        elif self.chance(0.2):
            gap += f" + {self.new(self.q(c), 0.02, 0.12)} * {self.wave()}"
        e = self.new(NONE, 0.1, 1.0, zero=True)
        return Wall(f"w{number}", gap, e, self.new(self._rate(c), 0.01, 0.06))


def numbers(structure: Structure, rng: np.random.Generator) -> Numbers:
    """Numbers for a structure, a start that it allows, and an end."""
    for attempt in range(40):
        found = _numbers(structure, rng, attempt > 25)
        march = March(structure, found)
        y = march.y0
        M, *_, N, _, _ = march.at(0.0, y, [2] * march.m)
        pulls = any(N[i] < 0 and not c.opens for i, c in enumerate(structure.contacts))
        gaps = march.gaps(0.0, *y)[0] if structure.stops else [1.0]
        if np.linalg.eigvalsh(M).min() > 0.1 and not pulls and min(gaps) > 0.01:
            return found
    return found


def _numbers(structure: Structure, rng: np.random.Generator, still: bool) -> Numbers:
    values: dict[str, float] = {}
    for name, p in structure.parameters.items():
        x = round(float(rng.uniform(p.low, p.high)), 3)
        if p.signed and rng.random() < 0.5:
            x = -x
        twins = [values[o] for o, other in structure.parameters.items()
                 if o in values and other.dimension == p.dimension]  # fmt: skip
        twins = [v for v in twins if p.low <= abs(v) <= p.high and (p.signed or v > 0)]
        chance = rng.random()
        if p.zero and chance < 0.1:
            x = 0.0
        elif twins and chance < 0.25:
            x = twins[int(rng.integers(len(twins)))] * (-1 if p.signed and rng.random() < 0.3 else 1)
        elif p.low <= 1.0 <= p.high and chance < 0.35:
            x = 1.0
        values[name] = x
    start, rest = {}, rng.random() < 0.3
    for c in structure.components:
        speed = c.startswith("v_")
        size, none = (1.5, 0.25) if speed else (0.4, 0.35)
        if speed and structure.coordinates[c[2:]] == "rad" and rng.random() < 0.4:
            size = 6.0
        x = round(float(rng.uniform(-size, size)), 3)
        same = [values[n] for n, p in structure.parameters.items()
                if p.dimension == dimension_of(structure, c)]  # fmt: skip
        chance = rng.random()
        if (speed and rest) or chance < none or still:
            x = 0.0
        elif same and speed and chance < none + 0.15:
            x = same[int(rng.integers(len(same)))]
        start[c] = x
    return Numbers(values, start, round(float(rng.uniform(2.5, 6.0)), 2))


def structure_of(rng: np.random.Generator) -> Structure:
    return replace(Draw(rng).structure())
