"""Statements of the paper on scenario 3, as predicates."""

import numpy as np

from .._statement import Verdict, statement
from .._thresholds import CoreXY
from ._view import ROUNDING, View


def _jumps(d: View):
    rows = np.flatnonzero(np.any(np.abs(np.diff(d.v, axis=0)) > CoreXY.JUMP, axis=1)) + 1
    return d.t[rows]


@statement("S3.01", "Both motors roll at first.")
def both_roll_at_first(d: View) -> Verdict:
    share = d.share(d.dmn == 1, d.between(CoreXY.AT_ONCE, CoreXY.EARLY))
    return share == 1, f"RR in {share:.0%} of {1e3 * CoreXY.AT_ONCE:g} ms to {CoreXY.EARLY:g} s"


@statement("S3.02", "The state is RR until about 2 s.")
def rolls_until_the_turn(d: View) -> Verdict:
    share = d.share(d.dmn == 1, d.between(0, CoreXY.TURN_FROM))
    return share >= CoreXY.ALMOST_ALL, f"RR in {share:.0%} of 0 to {CoreXY.TURN_FROM:g} s"


@statement("S3.03", "After about 2 s both shift to slip.")
def slips_after_the_turn(d: View) -> Verdict:
    before = d.share(d.dmn == 1, d.between(CoreXY.TURN_BEFORE, CoreXY.TURN_FROM))
    after = d.share(d.dmn == 4, d.between(CoreXY.TURN_TO, CoreXY.TURN_SEEN))
    return min(before, after) > CoreXY.MOST, f"RR {before:.0%} before, SS {after:.0%} after"


@statement("S3.04", "The state is SS for good afterwards.")
def slips_for_good(d: View) -> Verdict:
    share = d.share(d.dmn == 4, d.after(CoreXY.TURN_TO))
    return share >= CoreXY.FOR_GOOD, f"SS {share:.0%} after {CoreXY.TURN_TO:g} s"


@statement("S3.05", "The virtual pulleys are stationary afterwards.")
def pulleys_stand(d: View) -> Verdict:
    late = d.greatest(np.hypot(d.vx, d.vy), d.after(CoreXY.AFTERWARDS))
    text = f"speed up to {late:.3g} m/s after {CoreXY.AFTERWARDS:g} s"
    return late <= CoreXY.AT_REST and bool(d.moving.any()), text


@statement("S3.06", "The velocity drops to zero at about 2 s.")
def velocity_drops(d: View) -> Verdict:
    d.reaches(CoreXY.TURN_SEEN)
    last = float(d.t[np.flatnonzero(d.moving)[-1]]) if d.moving.any() else 0.0
    return CoreXY.TURN_FROM <= last <= CoreXY.TURN_SEEN, f"last motion at {last:.4g} s"


@statement("S3.07", "Some points then leave the dead zone while the mechanism stays static.")
def dead_zone_is_left_at_rest(d: View) -> Verdict:
    after = d.after(CoreXY.TURN_SEEN)
    still = after & ~d.moving
    count = int(np.sum(still & (np.hypot(d.ax, d.ay) > CoreXY.ACCELERATES)))
    return count > 0 and d.share(still, after) == 1, f"{count} such rows"


def _range(d: View, rows) -> float:
    return float(np.hypot(np.ptp(d.x[rows]), np.ptp(d.y[rows]))) if rows.any() else 0.0


@statement("S3.08", "The mechanism moves in the first 2 s.")
def moves_before(d: View) -> Verdict:
    d.reaches(CoreXY.TURN)
    size = _range(d, d.t <= CoreXY.TURN)
    return size > CoreXY.MOVES, f"{size:.4g} m in the first {CoreXY.TURN:g} s"


@statement("S3.09", "The voltages exceed the mapped dead zone in the first 2 s.")
def voltages_exceed(d: View) -> Verdict:
    d.reaches(CoreXY.TURN)
    share = d.share(np.all(~d.inside, axis=1), d.t <= CoreXY.TURN)
    return share >= CoreXY.NEARLY, f"{share:.0%} of the first {CoreXY.TURN:g} s"


@statement("S3.10", "Before 2 s the transferred torque is the drive torque.")
def torque_is_that_of_the_drive(d: View) -> Verdict:
    d.reaches(CoreXY.TURN)
    share = d.share(np.all(~d.slips, axis=1), d.t < CoreXY.TURN)
    return share >= CoreXY.NEARLY, f"{share:.0%} of the first {CoreXY.TURN:g} s"


@statement("S3.11", "After the slip the transferred torques are much smaller.")
def torques_are_smaller(d: View) -> Verdict:
    late = d.greatest(d.belt, d.after(CoreXY.TURN_TO))
    early = d.greatest(d.belt, d.t < CoreXY.TURN_FROM)
    return late < CoreXY.MUCH_LESS * early, f"{late:.4g} N m against {early:.4g} N m"


@statement("S3.12", "The friction torques cannot restart it.")
def cannot_restart(d: View) -> Verdict:
    slips = bool(np.any(d.slips[d.after(CoreXY.TURN_TO)]))
    late, early = _range(d, d.after(CoreXY.AFTERWARDS)), _range(d, d.t < CoreXY.TURN)
    good = slips and late < CoreXY.RESTARTS < early
    return good, f"{late:.3g} m after {CoreXY.AFTERWARDS:g} s"


@statement("S3.13", "Slip is triggered by inertia.")
def inertia_triggers(d: View) -> Verdict:
    d.resolves(CoreXY.TRIGGERED)
    begins = np.flatnonzero(np.any(d.slips, axis=1))
    jumps = _jumps(d)
    jumps = jumps[jumps > CoreXY.EARLY]
    if not begins.size or not jumps.size:
        return False, "no slip" if not begins.size else "no jump of the input"
    t = float(d.t[begins[0]])
    after = t - jumps[jumps <= t + ROUNDING]
    return bool(after.size and after.min() <= CoreXY.TRIGGERED), f"first slip at {t:.4g} s"


@statement("S3.14", "RR, then SS.")
def rolls_then_slips(d: View) -> Verdict:
    d.reaches(CoreXY.TURN_SEEN)
    rr, ss = d.share(d.dmn == 1), d.share(d.dmn == 4)
    mixed = d.share(np.isin(d.dmn, (2, 3)))
    good = min(rr, ss) >= CoreXY.BOTH_STATES and mixed < CoreXY.NO_OTHER
    return good, f"RR {rr:.0%}, SS {ss:.0%}, SR and RS {mixed:.0%}"


@statement("S3.15", "The input is piecewise constant pulses.")
def input_is_pulses(d: View) -> Verdict:
    d.reaches(CoreXY.TURN)
    levels = max(np.unique(np.round(d.v[:, i], int(CoreXY.DIGITS))).size for i in (0, 1))
    jumps = int(np.sum(_jumps(d) > 0))
    return levels <= CoreXY.LEVELS and jumps > 0, f"{levels} levels, {jumps} jumps after the start"
