"""Statements of the paper on scenario 2, as predicates."""

import numpy as np

from .._statement import Untold, Verdict, statement
from .._thresholds import CoreXY
from ._view import View


@statement("S2.01", "Both motors slip immediately.")
def both_slip_at_once(d: View) -> Verdict:
    d.resolves(CoreXY.SOON)
    t = d.first(d.dmn == 4)
    return t <= CoreXY.SOON, f"both slip from {t:.4g} s"


@statement("S2.02", "Velocities of motor and virtual pulleys diverge.")
def velocities_diverge(d: View) -> Verdict:
    apart = np.abs(d.omega - d.turn).max(axis=0)
    return bool(np.all(apart > CoreXY.DIVERGE)), f"up to {apart[0]:.4g} and {apart[1]:.4g} rad/s apart"


@statement("S2.03", "The torque along x stays inside the dead zone.")
def x_stays_inside(d: View) -> Verdict:
    speed = float(np.abs(d.vx).max())
    if not d.dead_x.all():
        raise Untold("the bound of the dead zone along x is zero at times")
    use = float(np.max(np.abs(d.tau_x) / d.dead_x))
    return speed == 0 and use < 1, f"torque up to {use:.0%} of the bound, |vx| up to {speed:.3g} m/s"


@statement("S2.04", "The position x is constant.")
def x_is_constant(d: View) -> Verdict:
    x, y = np.ptp(d.x), np.ptp(d.y)
    return x < max(CoreXY.CONSTANT * y, CoreXY.CONSTANT_X), f"x ranges over {x:.3g} m, y over {y:.3g} m"


@statement("S2.05", "y leaves its dead zone in certain intervals.")
def y_leaves_at_times(d: View) -> Verdict:
    moving = np.abs(d.vy) > CoreXY.AT_REST
    runs, share = d.runs(moving), d.share(moving)
    d.reaches(CoreXY.EARLY)
    late = any(d.t[a] > CoreXY.EARLY for a, _ in runs)
    good = len(runs) >= CoreXY.REPEATED and late and CoreXY.RARE <= share <= CoreXY.MOST
    return good, f"{len(runs)} intervals of motion, {share:.2%} of the time"


@statement("S2.06", "The motion along y is of millimetre scale.")
def y_moves_millimetres(d: View) -> Verdict:
    size = float(np.ptp(d.y))
    return (
        CoreXY.MILLIMETRES_FROM <= size <= CoreXY.MILLIMETRES_TO,
        f"y ranges over {1e3 * size:.4g} mm",
    )


@statement("S2.07", "It is driven by sporadic impulsive accelerations.")
def impulses_drive_it(d: View) -> Verdict:
    d.reaches(CoreXY.SPREAD)
    top = float(np.abs(d.ay).max())
    if top <= CoreXY.ACCELERATES:
        return False, "no acceleration along y"
    large = np.abs(d.ay) > CoreXY.IMPULSIVE * top
    runs, share = d.runs(large), d.share(large)
    spread = float(d.t[runs[-1][0]] - d.t[runs[0][0]])
    good = share < CoreXY.SPORADIC and len(runs) >= CoreXY.IMPULSES and spread > CoreXY.SPREAD
    return good, f"{len(runs)} impulses, {share:.2%} of the time, over {spread:.3g} s"


@statement("S2.08", "Both motors slip during most of the motion along y.")
def both_slip_in_motion(d: View) -> Verdict:
    moving = np.abs(d.vy) > CoreXY.AT_REST
    share = d.share(d.dmn == 4, moving)
    return share > CoreXY.MOST, f"{share:.0%} of the motion" if moving.any() else "no motion along y"


@statement("S2.09", "The motors show stick-slip at zero velocity.")
def motors_stick_and_slip(d: View) -> Verdict:
    counts = [len(d.long_runs(np.abs(d.omega[:, i]) <= CoreXY.AT_REST)) for i in (0, 1)]
    return min(counts) >= CoreXY.REPEATED, f"{counts[0]} and {counts[1]} rests"


@statement("S2.10", "Small residual velocities of the motors remain.")
def velocities_remain(d: View) -> Verdict:
    found = 0
    for i in (0, 1):
        slow = np.abs(d.omega[:, i]) < CoreXY.RESIDUAL * np.abs(d.omega[:, i]).max()
        residual = slow & (np.abs(d.omega[:, i]) > 0) & (np.abs(d.torque[:, i]) < d.static[:, i])
        found += len(d.long_runs(residual))
    return found > 0, f"{found} episodes"


@statement("S2.11", "The motors restart when the drive leaves the dead zone.")
def motors_restart_outside(d: View) -> Verdict:
    uses = []
    for i in (0, 1):
        for a, b in d.long_runs(np.abs(d.omega[:, i]) <= CoreXY.AT_REST):
            if b < d.t.size and d.static[a, i] > 0:
                uses.append(float(np.abs(d.torque[b - 1 : b + 1, i]).max() / d.static[a, i]))
    if not uses:
        return False, "the motors never rest"
    return min(
        uses
    ) >= CoreXY.NEARLY, f"restart at {min(uses):.2f} times the bound or more, {len(uses)} rests"


@statement("S2.12", "The voltages are inside the mapped dead zone in some instances.")
def voltages_are_inside_at_times(d: View) -> Verdict:
    late = d.after(CoreXY.SOON)
    counts = [int(np.sum(d.inside[late, i])) for i in (0, 1)]
    return min(counts) > 0, f"inside in {counts[0]} and {counts[1]} rows of {int(late.sum())}"


@statement("S2.13", "The motors keep oscillating.")
def motors_oscillate(d: View) -> Verdict:
    ends = [(d.omega[:, i].min(), d.omega[:, i].max()) for i in (0, 1)]
    good = all(low <= -CoreXY.DIVERGE and high >= CoreXY.DIVERGE for low, high in ends)
    return good, ", ".join(f"{low:.4g} to {high:.4g} rad/s" for low, high in ends)


@statement("S2.14", "The transferred torque is kinetic friction throughout.")
def torque_is_kinetic(d: View) -> Verdict:
    share = d.share(np.all(d.at_kinetic() & d.slips, axis=1))
    return share >= CoreXY.ALMOST_ALL, f"{share:.1%} of the time"


@statement("S2.15", "Almost all points are in state 4,")
def is_in_4(d: View) -> Verdict:
    share = d.share(d.dmn == 4)
    return share >= CoreXY.ALMOST_ALL, f"{share:.1%}"


@statement("S2.16", "except for a few isolated instances.")
def leaves_4_briefly(d: View) -> Verdict:
    d.resolves(CoreXY.BRIEF)
    runs = d.runs((d.dmn != 4) & d.after(CoreXY.SOON))
    longest = max(((b - a) * d.dt for a, b in runs), default=0.0)
    return 0 < longest <= CoreXY.BRIEF, f"{len(runs)} episodes, the longest {1e3 * longest:.3g} ms"


@statement("S2.17", "Kinetic friction sets the mechanism in motion along y.")
def friction_moves_y(d: View) -> Verdict:
    launches = [a for a, _ in d.runs(np.abs(d.vy) > CoreXY.AT_REST)]
    share = float(np.mean([d.dmn[max(a - 1, 0)] == 4 for a in launches])) if launches else 0.0
    return share >= CoreXY.MOST, f"{len(launches)} launches, {share:.0%} of them in state 4"
