"""Statements of the paper on scenario 2, as predicates."""

import numpy as np

from ._view import Untold, View


def s01(d: View):
    d.resolves(0.02)
    t = d.first(d.dmn == 4)
    return t <= 0.02, f"both slip from {t:.4g} s"


def s02(d: View):
    apart = np.abs(d.omega - d.turn).max(axis=0)
    return bool(np.all(apart > 100)), f"up to {apart[0]:.4g} and {apart[1]:.4g} rad/s apart"


def s03(d: View):
    speed = float(np.abs(d.vx).max())
    if not d.dead_x.all():
        raise Untold("the bound of the dead zone along x is zero at times")
    use = float(np.max(np.abs(d.tau_x) / d.dead_x))
    return speed == 0 and use < 1, f"torque up to {use:.0%} of the bound, |vx| up to {speed:.3g} m/s"


def s04(d: View):
    x, y = np.ptp(d.x), np.ptp(d.y)
    return x < max(0.01 * y, 1e-6), f"x ranges over {x:.3g} m, y over {y:.3g} m"


def s05(d: View):
    moving = np.abs(d.vy) > 1e-12
    runs, share = d.runs(moving), d.share(moving)
    d.reaches(0.1)
    late = any(d.t[a] > 0.1 for a, _ in runs)
    good = len(runs) >= 2 and late and 1e-4 <= share <= 0.5
    return good, f"{len(runs)} intervals of motion, {share:.2%} of the time"


def s06(d: View):
    size = float(np.ptp(d.y))
    return 0.5e-3 <= size <= 20e-3, f"y ranges over {1e3 * size:.4g} mm"


def s07(d: View):
    d.reaches(1.0)
    top = float(np.abs(d.ay).max())
    if top <= 1e-9:
        return False, "no acceleration along y"
    large = np.abs(d.ay) > 0.5 * top
    runs, share = d.runs(large), d.share(large)
    spread = float(d.t[runs[-1][0]] - d.t[runs[0][0]])
    good = share < 0.01 and len(runs) >= 3 and spread > 1
    return good, f"{len(runs)} impulses, {share:.2%} of the time, over {spread:.3g} s"


def s08(d: View):
    moving = np.abs(d.vy) > 1e-12
    share = d.share(d.dmn == 4, moving)
    return share > 0.5, f"{share:.0%} of the motion" if moving.any() else "no motion along y"


def s09(d: View):
    counts = [len(d.long_runs(np.abs(d.omega[:, i]) <= 1e-12)) for i in (0, 1)]
    return min(counts) >= 2, f"{counts[0]} and {counts[1]} rests"


def s10(d: View):
    found = 0
    for i in (0, 1):
        slow = np.abs(d.omega[:, i]) < 0.01 * np.abs(d.omega[:, i]).max()
        residual = slow & (np.abs(d.omega[:, i]) > 0) & (np.abs(d.torque[:, i]) < d.static[:, i])
        found += len(d.long_runs(residual))
    return found > 0, f"{found} episodes"


def s11(d: View):
    uses = []
    for i in (0, 1):
        for a, b in d.long_runs(np.abs(d.omega[:, i]) <= 1e-12):
            if b < d.t.size and d.static[a, i] > 0:
                uses.append(float(np.abs(d.torque[b - 1 : b + 1, i]).max() / d.static[a, i]))
    if not uses:
        return False, "the motors never rest"
    return min(uses) >= 0.9, f"restart at {min(uses):.2f} times the bound or more, {len(uses)} rests"


def s12(d: View):
    late = d.after(0.02)
    counts = [int(np.sum(d.inside[late, i])) for i in (0, 1)]
    return min(counts) > 0, f"inside in {counts[0]} and {counts[1]} rows of {int(late.sum())}"


def s13(d: View):
    ends = [(d.omega[:, i].min(), d.omega[:, i].max()) for i in (0, 1)]
    good = all(low <= -100 and high >= 100 for low, high in ends)
    return good, ", ".join(f"{low:.4g} to {high:.4g} rad/s" for low, high in ends)


def s14(d: View):
    share = d.share(np.all(d.at_kinetic() & d.slips, axis=1))
    return share >= 0.95, f"{share:.1%} of the time"


def s15(d: View):
    share = d.share(d.dmn == 4)
    return share >= 0.95, f"{share:.1%}"


def s16(d: View):
    d.resolves(0.05)
    runs = d.runs((d.dmn != 4) & d.after(0.02))
    longest = max(((b - a) * d.dt for a, b in runs), default=0.0)
    return 0 < longest <= 0.05, f"{len(runs)} episodes, the longest {1e3 * longest:.3g} ms"


def s17(d: View):
    launches = [a for a, _ in d.runs(np.abs(d.vy) > 1e-12)]
    share = float(np.mean([d.dmn[max(a - 1, 0)] == 4 for a in launches])) if launches else 0.0
    return share >= 0.5, f"{len(launches)} launches, {share:.0%} of them in state 4"


STATEMENTS = {
    "S2.01": ("Both motors slip immediately.", s01),
    "S2.02": ("Velocities of motor and virtual pulleys diverge.", s02),
    "S2.03": ("The torque along x stays inside the dead zone.", s03),
    "S2.04": ("The position x is constant.", s04),
    "S2.05": ("y leaves its dead zone in certain intervals.", s05),
    "S2.06": ("The motion along y is of millimetre scale.", s06),
    "S2.07": ("It is driven by sporadic impulsive accelerations.", s07),
    "S2.08": ("Both motors slip during most of the motion along y.", s08),
    "S2.09": ("The motors show stick-slip at zero velocity.", s09),
    "S2.10": ("Small residual velocities of the motors remain.", s10),
    "S2.11": ("The motors restart when the drive leaves the dead zone.", s11),
    "S2.12": ("The voltages are inside the mapped dead zone in some instances.", s12),
    "S2.13": ("The motors keep oscillating.", s13),
    "S2.14": ("The transferred torque is kinetic friction throughout.", s14),
    "S2.15": ("Almost all points are in state 4,", s15),
    "S2.16": ("except for a few isolated instances.", s16),
    "S2.17": ("Kinetic friction sets the mechanism in motion along y.", s17),
}
