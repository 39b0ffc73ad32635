"""Friction laws of the reference, written from their formulas."""

import math


class Coulomb:
    def __init__(self, s, k=None):
        self.s, self.k = s, s if k is None else k

    def static(self, sense):
        return max(self.s, self.k)

    def kinetic(self, u, sense):
        return sense * self.k

    def drag(self, u):
        return 0.0


class Stribeck(Coulomb):
    def __init__(self, s, k, v, exponent=2):
        super().__init__(s, k)
        self.v, self.exponent = v, exponent

    def kinetic(self, u, sense):
        slip = sense * u / self.v  # below zero by rounding, where a broken power has no value
        power = max(slip**self.exponent, -1.0) if slip > 0 or self.exponent % 1 == 0 else 0.0
        return sense * (self.k + (self.s - self.k) * math.exp(-power))


class HyperbolicWeakening(Coulomb):
    def __init__(self, s, gamma, k=None):
        super().__init__(s, k)
        self.gamma = gamma

    def kinetic(self, u, sense):
        return sense * self.k / max(1.0 + self.gamma * sense * u, 0.5)


class ViscousFriction(Coulomb):
    def __init__(self, c):
        super().__init__(0.0)
        self.c = c

    def kinetic(self, u, sense):
        return self.c * u


class ViscousDamping(ViscousFriction):
    def kinetic(self, u, sense):
        return 0.0

    def drag(self, u):
        return self.c * u


class Asymmetric:
    def __init__(self, forward, backward):
        self.laws = {1: forward, -1: backward}

    def static(self, sense):
        return self.laws[sense].static(sense)

    def kinetic(self, u, sense):
        return self.laws[sense].kinetic(u, sense)

    def drag(self, u):
        return self.laws[1 if u > 0 else -1].drag(u)


class Sum:
    def __init__(self, *laws):
        self.laws = laws

    def static(self, sense):
        return sum(law.static(sense) for law in self.laws)

    def kinetic(self, u, sense):
        return sum(law.kinetic(u, sense) for law in self.laws)

    def drag(self, u):
        return sum(law.drag(u) for law in self.laws)


LAWS = {c.__name__: c for c in (Coulomb, Stribeck, HyperbolicWeakening, ViscousFriction)}
LAWS |= {c.__name__: c for c in (ViscousDamping, Asymmetric, Sum)}
MATHS = {name: getattr(math, name) for name in ("sin", "cos", "exp", "tanh", "sqrt")}
MATHS |= {"abs": abs, "clip": lambda x, low, high: min(max(x, low), high)}
MATHS |= {
    "maximum": max,
    "minimum": min,
    "where": lambda c, a, b: a if c else b,
    "mod": lambda a, b: a % b,
}
