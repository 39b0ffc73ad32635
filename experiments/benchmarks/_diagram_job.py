"""The headline job: the bifurcation diagram of the block on a belt, the same for every peer."""

import dataclasses
import functools
import math
from typing import Any, NamedTuple

import diffrax
import numpy as np

from stickslip.friction import SmoothHyperbolicWeakening
from stickslip.systems import (
    BlockOnBelt,
    BlockOnDrivenBelt,
    BlockState,
    DCDrive,
    DrivenBlockState,
)

LOW, HIGH = 72.0, 97.0  # [N/m]
LANES = 25_001


@dataclasses.dataclass(frozen=True)
class Case:
    """Parameters of the block on a belt by the names of the C file, and what the job needs to know.

    `start`: x and y at the beginning; `h`: step [s] with which Tsit5 errs by 1e-8 per second in the
    largest component of the state; `settled`: k3 up to which errors do not grow, as the motion is
    periodic; `drive`: those of the drive in the full model, which begins with enough current that the
    rotor turns at once.
    """

    name: str
    values: dict[str, float]
    start: tuple[float, float]
    h: float
    settled: float
    drive: DCDrive | None = None

    def system(self, k3) -> BlockOnBelt | BlockOnDrivenBelt:
        p = self.values
        law = SmoothHyperbolicWeakening(p["MU_0"], p["ALPHA"], p["BETA"], p["GAMMA"])
        make: Any = BlockOnDrivenBelt if self.drive else BlockOnBelt
        belt = {"drive": self.drive} if self.drive else {"V_b": p["V_B"]}
        return make(
            m=p["M_BLOCK"], M=p["M_PENDULUM"], J=p["J"], k1=p["K1"], k2=p["K2"], k3=k3, c1=p["C1"],
            c2=p["C2"], r=p["R"], Q=p["Q"], law=law, g=p["G"], **belt,
        )  # fmt: skip

    @property
    def initial(self) -> BlockState | DrivenBlockState:
        x, y = self.start
        if self.drive:
            return DrivenBlockState(x, 0.0, y, 0.0, 0.0, self.start_current)
        return BlockState(x, 0.0, y, 0.0)

    @property
    def start_current(self) -> float:
        """Current [A] that moves the rotor from rest with a tenth to spare."""
        assert self.drive is not None
        return 1.1 * float(self.drive.T_st) / float(self.drive.k_m)


def _values(block: BlockOnBelt) -> dict[str, float]:
    law: Any = block.law
    found = {
        "M_BLOCK": block.m, "M_PENDULUM": block.M, "J": block.J, "K1": block.k1, "K2": block.k2,
        "C1": block.c1, "C2": block.c2, "R": block.r, "G": block.g, "Q": block.Q, "V_B": block.V_b,
        "MU_0": law.mu_0, "ALPHA": law.alpha, "BETA": law.beta, "GAMMA": law.gamma,
    }  # fmt: skip
    return {name: float(value) for name, value in found.items()}


@functools.cache
def set_a() -> Case:
    """The parameters of the figures: stiff in the contact, 2,000 1/s."""
    return Case("set A", _values(BlockOnBelt.constructed(85.0)), (0.0, 0.0), 1 / 1600, 85.0)


@functools.cache
def mild() -> Case:
    """A contact less stiff, 200 1/s: the hardest for an interpreter, as steps are few and large."""
    law = SmoothHyperbolicWeakening(0.3, 50.0, 0.4, 1.0)
    block = BlockOnBelt(
        m=1.0, M=0.5, J=0.01, k1=40.0, k2=50.0, k3=80.0, c1=0.3, c2=0.5, r=0.1, Q=0.0, V_b=0.1, law=law
    )
    return Case("a mild contact", _values(block), (0.0, -0.02), 1 / 300, HIGH)


@functools.cache
def full_model() -> Case:
    """Set A on the belt with the drive, consistent sign."""
    a = set_a()
    return Case(
        "the drive (full model), set A", a.values, a.start, a.h, a.settled, DCDrive.constructed()
    )


class Points(NamedTuple):
    """Poincaré points by lane: position, time, how many; NaN where there is none."""

    x: np.ndarray
    t: np.ndarray
    count: np.ndarray


@dataclasses.dataclass(frozen=True)
class Job:
    """Lanes evenly over k3, `transient` dropped, `duration` recorded, `room` points a lane at most."""

    case: Case
    lanes: int = LANES
    transient: float = 15.0
    duration: float = 25.0
    room: int = 96

    @property
    def h(self) -> float:
        return self.case.h

    @property
    def end(self) -> float:
        return self.transient + self.duration

    @property
    def steps(self) -> int:
        return round(self.end / self.h)

    @property
    def first(self) -> int:
        return round(self.transient / self.h)

    @property
    def k3(self) -> np.ndarray:
        return np.linspace(LOW, HIGH, self.lanes)

    def sample(self, number: int = 12) -> np.ndarray:
        """Indices of lanes whose motion is periodic, evenly spaced."""
        last = np.searchsorted(self.k3, self.case.settled) - 1
        return np.unique(np.linspace(0, last, number).round().astype(int))

    def empty(self, lanes: int) -> Points:
        shape = (lanes, self.room)
        return Points(np.full(shape, np.nan), np.full(shape, np.nan), np.zeros(lanes, np.int32))


@functools.cache
def tsit5() -> tuple[np.ndarray, np.ndarray]:
    """Coefficients a and b of the six stages of Tsit5."""
    source = diffrax.Tsit5().tableau
    a = np.zeros((6, 6))
    for i, row in enumerate(source.a_lower[:5]):
        a[i + 1, : i + 1] = np.asarray(row)
    return a, np.asarray(source.b_sol)[:6]


def slopes(p, x, y, u, v, k3, *, absolute, tanh, cosh):
    """Accelerations of block and rim, Eqs. (8) to (12), in the arithmetic of whoever calls."""
    stretched = k3 * (y + x * x * (0.5 / p["R"]))
    angle = y * (1.0 / p["R"])
    weight = (0.75 * p["M_PENDULUM"] * p["G"]) * (
        1.0 + angle - 0.5 * angle * angle - angle * angle * angle * (1.0 / 6.0)
    )
    on_rim = p["C2"] * v + stretched
    V = u - p["V_B"]
    s = p["ALPHA"] * V
    mu = p["MU_0"] / (1.0 + p["GAMMA"] * absolute(V)) * (1.0 + p["BETA"] / cosh(s)) * tanh(s)
    friction = mu * (p["M_BLOCK"] * p["G"] + weight - on_rim)
    shared = p["C1"] * (u + v) + p["K2"] * (x + y)
    block = shared + p["K1"] * x + stretched * x * (1.0 / p["R"]) + friction
    rim = shared + on_rim + weight + p["Q"] / p["R"]
    return block * (-1.0 / p["M_BLOCK"]), rim * (-p["R"] * p["R"] / p["J"])


def plain_field(case: Case):
    """Right-hand side (t, (x, y, vx, vy), k3) for SciPy, one lane, in floats."""

    def field(t, s, k3):
        x, y, u, v = s
        a, b = slopes(case.values, x, y, u, v, k3, absolute=abs, tanh=math.tanh, cosh=math.cosh)
        return (u, v, a, b)

    return field


def errors(found: Points, truth: Points) -> tuple[float, float]:
    """Largest error of x and of t over the lanes; infinite if the numbers of points differ."""
    if not np.array_equal(found.count, truth.count):
        return math.inf, math.inf
    n = int(truth.count.max())
    gaps = (np.abs(a[:, :n] - b[:, :n]) for a, b in zip(found[:2], truth[:2], strict=True))
    x, t = (float(np.nanmax(gap)) for gap in gaps)
    return x, t
