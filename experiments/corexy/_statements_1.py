"""Statements of the paper on scenario 1, as predicates: truth and what was measured."""

import numpy as np

from .._statement import Untold, Verdict, statement
from .._thresholds import CoreXY
from ._view import View


@statement("S1.01", "Motor 1 rolls at first.")
def rolls_at_first(d: View) -> Verdict:
    d.resolves(CoreXY.SOON)
    t = d.first(d.slips[:, 0])
    return t >= CoreXY.SOON, f"first slip of motor 1 at {t:.4g} s"


@statement("S1.02", "Motor 2 slips right from the beginning.")
def slips_at_once(d: View) -> Verdict:
    d.resolves(CoreXY.AT_ONCE)
    t, share = d.first(d.slips[:, 1]), d.share(d.slips[:, 1], d.between(0, CoreXY.BEGINNING))
    good = t <= CoreXY.AT_ONCE and share >= CoreXY.NEARLY
    return good, f"from {t:.4g} s, {share:.0%} of the first {1e3 * CoreXY.BEGINNING:g} ms"


@statement("S1.03", "As the voltage is increased motor 1 also goes into slip.")
def also_slips(d: View) -> Verdict:
    t = d.first(d.slips[:, 0])
    if not np.isfinite(t):
        return False, "motor 1 never slips"
    i = int(np.argmax(d.slips[:, 0]))
    grows = i > 0 and abs(d.v[i, 0]) > abs(d.v[i - 1, 0])
    return t >= CoreXY.SOON and grows, f"first slip at {t:.4g} s, |v1| {'grows' if grows else 'falls'}"


@statement("S1.04", "Motor 1 both rolls in motion and slips.")
def rolls_and_slips(d: View) -> Verdict:
    rolls, slips = d.share(d.moving & ~d.slips[:, 0]), d.share(d.slips[:, 0])
    text = f"rolls in motion {rolls:.1%}, slips {slips:.1%}"
    return min(rolls, slips) >= CoreXY.SOME, text


@statement("S1.05", "Motion starts with motor 1 rolling and driving,")
def starts_rolling_and_driving(d: View) -> Verdict:
    if not d.moving.any():
        return False, "it never moves"
    i = int(np.argmax(d.moving))
    drives = d.torque[i, 0] * d.turn[i, 0] > 0
    return not d.slips[i, 0] and drives, f"at {d.t[i]:.4g} s in DMN{int(d.dmn[i])}"


@statement("S1.06", "aided by the Coulomb torque of the slipping motor 2.")
def is_aided(d: View) -> Verdict:
    begin = d.first(d.moving)
    if not np.isfinite(begin):
        return False, "it never moves"
    rows = d.between(begin, begin + CoreXY.SOON) & d.slips[:, 1]
    power = float(np.mean((d.belt[:, 1] * d.turn[:, 1])[rows])) if rows.any() else 0.0
    return power > CoreXY.POWER, f"mean power of motor 2 on its belt {power:.3g} W"


def _halt(d: View):
    begin = d.first(d.moving)
    rests = [run for run in d.long_runs(~d.moving) if d.t[run[0]] > begin]
    return begin, rests[0] if rests else None


@statement("S1.07", "After a short period it halts as the drive of motor 1 diminishes.")
def halts(d: View) -> Verdict:
    begin, rest = _halt(d)
    if rest is None:
        return False, f"it never halts for {1e3 * CoreXY.LASTS:g} ms"
    i = rest[0]
    peak = np.max(np.abs(d.v[: i + 1, 0]))
    if peak == 0:
        raise Untold("the voltage of motor 1 is zero until then")
    ratio = abs(d.v[i, 0]) / peak
    good = d.t[i] - begin < CoreXY.PERIOD and ratio < CoreXY.DIMINISHED
    return good, f"halts at {d.t[i]:.4g} s with |v1| at {ratio:.0%} of its peak"


@statement("S1.08", "It leaves the dead zone when the power of motor 1 grows again.")
def moves_again(d: View) -> Verdict:
    _, rest = _halt(d)
    if rest is None or rest[1] >= d.t.size:
        return False, "no halt that ends"
    i = rest[1]
    grows = abs(d.v[i, 0]) > abs(d.v[i - 1, 0])
    return grows, f"moves again at {d.t[i]:.4g} s, |v1| {'grows' if grows else 'falls'}"


@statement("S1.09", "Multiple stick-slip occurs.")
def sticks_and_slips(d: View) -> Verdict:
    counts = []
    for v in (d.vx, d.vy):
        rest = np.abs(v) <= CoreXY.AT_REST
        begin = d.first(~rest)
        counts.append(sum(d.t[a] > begin for a, _ in d.long_runs(rest)))
    return max(counts) >= CoreXY.REPEATED, f"{counts[0]} rests of x, {counts[1]} of y"


@statement("S1.10", "The motion is continuous with relatively smooth velocity.")
def is_smooth(d: View) -> Verdict:
    speed = max(np.abs(d.vx).max(), np.abs(d.vy).max())
    jump = max(np.abs(d.ax).max(), np.abs(d.ay).max()) * CoreXY.STEP / max(speed, np.finfo(float).tiny)
    share = d.share(d.moving)
    text = f"moves {share:.0%}, largest jump {jump:.2%} of the top speed"
    return share > CoreXY.MOST and jump < CoreXY.SMOOTH, text


@statement("S1.11", "The voltages lie on an ellipse.")
def is_an_ellipse(d: View) -> Verdict:
    top = np.abs(d.v).max(axis=0)
    if not top.all():
        return False, "a voltage is zero throughout"
    gap = float(np.max(np.abs(np.sum((d.v / top) ** 2, axis=1) - 1)))
    return gap < CoreXY.ELLIPSE, f"off the ellipse by {gap:.1g}"


@statement("S1.12", "Motor 1 first resides in the dead zone, then leaves it.")
def leaves_its_dead_zone(d: View) -> Verdict:
    resting = (d.omega[:, 0] == 0) & (np.abs(d.torque[:, 0]) < d.static[:, 0])
    runs = d.long_runs(resting)
    if not runs or runs[0][0] > 1:
        return False, f"it does not begin in its dead zone for {1e3 * CoreXY.LASTS:g} ms"
    if runs[0][1] >= d.t.size:
        return False, "it never leaves its dead zone"
    leaves = bool(np.any(np.abs(d.torque[runs[0][1] :, 0]) > d.static[runs[0][1] :, 0]))
    return leaves, f"in its dead zone until {d.t[runs[0][1]]:.4g} s"


@statement("S1.13", "v1 is inside the mapped dead zone at the start of each wave, outside later.")
def crosses_it_each_wave(d: View) -> Verdict:
    d.reaches(CoreXY.PERIOD)
    seen, start = [], CoreXY.WAVE_START * CoreXY.PERIOD
    for begin in np.arange(0.0, d.t[-1], CoreXY.PERIOD):
        end = begin + CoreXY.PERIOD - start
        if end > d.t[-1]:
            break
        near, later = d.between(begin - start, begin + start), d.between(begin + start, end)
        seen.append(bool(d.inside[near, 0].any() and (~d.inside[later, 0]).any()))
    return bool(seen) and all(seen), f"in {sum(seen)} of {len(seen)} waves"


@statement("S1.14", "Motor 2 is outside the mapped dead zone most of the time.")
def is_outside_it(d: View) -> Verdict:
    share = d.share(~d.inside[:, 1])
    return share > CoreXY.MOST, f"outside {share:.0%} of the time"


def _ratio(d: View, motors) -> float:
    slipping = max(d.greatest(d.belt[:, i], d.slips[:, i]) for i in motors)
    rolling = max(d.greatest(d.belt[:, i], ~d.slips[:, i]) for i in motors)
    return slipping / rolling if slipping > 0 and rolling > 0 else np.inf


@statement("S1.15", "Slipping, motor 1 transfers much less torque than rolling.")
def transfers_less_in_slip(d: View) -> Verdict:
    ratio = _ratio(d, [0])
    if not np.isfinite(ratio):
        return False, "motor 1 does not both roll and slip"
    return ratio < CoreXY.MUCH_LESS, f"ratio {ratio:.3g}"


@statement("S1.16", "Motor 2 gives nothing but kinetic friction.")
def gives_kinetic_friction(d: View) -> Verdict:
    share = d.share(d.slips[:, 1] & d.at_kinetic()[:, 1])
    return share >= CoreXY.ALMOST_ALL, f"{share:.1%} of the time"


@statement("S1.17", "Torque transferred in rolling is much greater than in slip.")
def transfers_more_in_rolling(d: View) -> Verdict:
    ratio = _ratio(d, [0, 1])
    return ratio < CoreXY.MUCH_LESS, f"slipping over rolling {ratio:.3g}"


@statement("S1.18", "Most points are in state 3 or 4.")
def is_in_3_or_4(d: View) -> Verdict:
    share = d.share(d.dmn >= 3)
    return share > CoreXY.MOST, f"{share:.1%}"


@statement("S1.19", "States 3 and 4 are both substantial.")
def is_in_3_and_4(d: View) -> Verdict:
    three, four = d.share(d.dmn == 3), d.share(d.dmn == 4)
    return min(three, four) >= CoreXY.SOME, f"state 3 {three:.1%}, state 4 {four:.1%}"


@statement("S1.20", "State 1 occurs.")
def is_in_1(d: View) -> Verdict:
    share = d.share((d.dmn == 1) & (d.t > 0))
    return share > 0, f"{share:.2%}"


@statement("S1.21", "State 2 occurs.")
def is_in_2(d: View) -> Verdict:
    share = d.share(d.dmn == 2)
    return share > 0, f"{share:.2%}"
