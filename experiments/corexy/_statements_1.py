"""Statements of the paper on scenario 1, as predicates: truth and what was measured."""

import numpy as np

from ._view import STEP, Untold, View

PERIOD = 2.0


def s01(d: View):
    d.resolves(0.02)
    t = d.first(d.slips[:, 0])
    return t >= 0.02, f"first slip of motor 1 at {t:.4g} s"


def s02(d: View):
    d.resolves(1e-3)
    t, share = d.first(d.slips[:, 1]), d.share(d.slips[:, 1], d.between(0, 0.05))
    return t <= 1e-3 and share >= 0.9, f"from {t:.4g} s, {share:.0%} of the first 50 ms"


def s03(d: View):
    t = d.first(d.slips[:, 0])
    if not np.isfinite(t):
        return False, "motor 1 never slips"
    i = int(np.argmax(d.slips[:, 0]))
    grows = i > 0 and abs(d.v[i, 0]) > abs(d.v[i - 1, 0])
    return t >= 0.02 and grows, f"first slip at {t:.4g} s, |v1| {'grows' if grows else 'falls'}"


def s04(d: View):
    rolls, slips = d.share(d.moving & ~d.slips[:, 0]), d.share(d.slips[:, 0])
    return rolls >= 0.01 and slips >= 0.01, f"rolls in motion {rolls:.1%}, slips {slips:.1%}"


def s05(d: View):
    if not d.moving.any():
        return False, "it never moves"
    i = int(np.argmax(d.moving))
    drives = d.torque[i, 0] * d.turn[i, 0] > 0
    return not d.slips[i, 0] and drives, f"at {d.t[i]:.4g} s in DMN{int(d.dmn[i])}"


def s06(d: View):
    begin = d.first(d.moving)
    if not np.isfinite(begin):
        return False, "it never moves"
    rows = d.between(begin, begin + 0.02) & d.slips[:, 1]
    power = float(np.mean((d.belt[:, 1] * d.turn[:, 1])[rows])) if rows.any() else 0.0
    return power > 1e-12, f"mean power of motor 2 on its belt {power:.3g} W"


def _halt(d: View):
    begin = d.first(d.moving)
    rests = [run for run in d.long_runs(~d.moving) if d.t[run[0]] > begin]
    return begin, rests[0] if rests else None


def s07(d: View):
    begin, rest = _halt(d)
    if rest is None:
        return False, "it never halts for 1 ms"
    i = rest[0]
    peak = np.max(np.abs(d.v[: i + 1, 0]))
    if peak == 0:
        raise Untold("the voltage of motor 1 is zero until then")
    ratio = abs(d.v[i, 0]) / peak
    good = d.t[i] - begin < PERIOD and ratio < 0.7
    return good, f"halts at {d.t[i]:.4g} s with |v1| at {ratio:.0%} of its peak"


def s08(d: View):
    _, rest = _halt(d)
    if rest is None or rest[1] >= d.t.size:
        return False, "no halt that ends"
    i = rest[1]
    grows = abs(d.v[i, 0]) > abs(d.v[i - 1, 0])
    return grows, f"moves again at {d.t[i]:.4g} s, |v1| {'grows' if grows else 'falls'}"


def s09(d: View):
    counts = []
    for v in (d.vx, d.vy):
        rest = np.abs(v) <= 1e-12
        begin = d.first(~rest)
        counts.append(sum(d.t[a] > begin for a, _ in d.long_runs(rest)))
    return max(counts) >= 2, f"{counts[0]} rests of x, {counts[1]} of y"


def s10(d: View):
    speed = max(np.abs(d.vx).max(), np.abs(d.vy).max())
    jump = max(np.abs(d.ax).max(), np.abs(d.ay).max()) * STEP / max(speed, 1e-300)
    share = d.share(d.moving)
    return share > 0.5 and jump < 0.02, f"moves {share:.0%}, largest jump {jump:.2%} of the top speed"


def s11(d: View):
    top = np.abs(d.v).max(axis=0)
    if not top.all():
        return False, "a voltage is zero throughout"
    gap = float(np.max(np.abs(np.sum((d.v / top) ** 2, axis=1) - 1)))
    return gap < 1e-3, f"off the ellipse by {gap:.1g}"


def s12(d: View):
    resting = (d.omega[:, 0] == 0) & (np.abs(d.torque[:, 0]) < d.static[:, 0])
    runs = d.long_runs(resting)
    if not runs or runs[0][0] > 1:
        return False, "it does not begin in its dead zone for 1 ms"
    if runs[0][1] >= d.t.size:
        return False, "it never leaves its dead zone"
    leaves = bool(np.any(np.abs(d.torque[runs[0][1] :, 0]) > d.static[runs[0][1] :, 0]))
    return leaves, f"in its dead zone until {d.t[runs[0][1]]:.4g} s"


def s13(d: View):
    d.reaches(PERIOD)
    seen = []
    for begin in np.arange(0.0, d.t[-1], PERIOD):
        if begin + 0.95 * PERIOD > d.t[-1]:
            break
        near = d.between(begin - 0.05 * PERIOD, begin + 0.05 * PERIOD)
        later = d.between(begin + 0.05 * PERIOD, begin + 0.95 * PERIOD)
        seen.append(bool(d.inside[near, 0].any() and (~d.inside[later, 0]).any()))
    return bool(seen) and all(seen), f"in {sum(seen)} of {len(seen)} waves"


def s14(d: View):
    share = d.share(~d.inside[:, 1])
    return share > 0.5, f"outside {share:.0%} of the time"


def _ratio(d: View, motors) -> float:
    slipping = max(d.greatest(d.belt[:, i], d.slips[:, i]) for i in motors)
    rolling = max(d.greatest(d.belt[:, i], ~d.slips[:, i]) for i in motors)
    return slipping / rolling if slipping > 0 and rolling > 0 else np.inf


def s15(d: View):
    ratio = _ratio(d, [0])
    if not np.isfinite(ratio):
        return False, "motor 1 does not both roll and slip"
    return ratio < 0.25, f"ratio {ratio:.3g}"


def s16(d: View):
    share = d.share(d.slips[:, 1] & d.at_kinetic()[:, 1])
    return share >= 0.95, f"{share:.1%} of the time"


def s17(d: View):
    ratio = _ratio(d, [0, 1])
    return ratio < 0.25, f"slipping over rolling {ratio:.3g}"


def s18(d: View):
    share = d.share(d.dmn >= 3)
    return share > 0.5, f"{share:.1%}"


def s19(d: View):
    three, four = d.share(d.dmn == 3), d.share(d.dmn == 4)
    return min(three, four) >= 0.01, f"state 3 {three:.1%}, state 4 {four:.1%}"


def s20(d: View):
    share = d.share((d.dmn == 1) & (d.t > 0))
    return share > 0, f"{share:.2%}"


def s21(d: View):
    share = d.share(d.dmn == 2)
    return share > 0, f"{share:.2%}"


STATEMENTS = {
    "S1.01": ("Motor 1 rolls at first.", s01),
    "S1.02": ("Motor 2 slips right from the beginning.", s02),
    "S1.03": ("As the voltage is increased motor 1 also goes into slip.", s03),
    "S1.04": ("Motor 1 both rolls in motion and slips.", s04),
    "S1.05": ("Motion starts with motor 1 rolling and driving,", s05),
    "S1.06": ("aided by the Coulomb torque of the slipping motor 2.", s06),
    "S1.07": ("After a short period it halts as the drive of motor 1 diminishes.", s07),
    "S1.08": ("It leaves the dead zone when the power of motor 1 grows again.", s08),
    "S1.09": ("Multiple stick-slip occurs.", s09),
    "S1.10": ("The motion is continuous with relatively smooth velocity.", s10),
    "S1.11": ("The voltages lie on an ellipse.", s11),
    "S1.12": ("Motor 1 first resides in the dead zone, then leaves it.", s12),
    "S1.13": ("v1 is inside the mapped dead zone at the start of each wave, outside later.", s13),
    "S1.14": ("Motor 2 is outside the mapped dead zone most of the time.", s14),
    "S1.15": ("Slipping, motor 1 transfers much less torque than rolling.", s15),
    "S1.16": ("Motor 2 gives nothing but kinetic friction.", s16),
    "S1.17": ("Torque transferred in rolling is much greater than in slip.", s17),
    "S1.18": ("Most points are in state 3 or 4.", s18),
    "S1.19": ("States 3 and 4 are both substantial.", s19),
    "S1.20": ("State 1 occurs.", s20),
    "S1.21": ("State 2 occurs.", s21),
}
