"""Statements of the paper on scenario 3, as predicates."""

import numpy as np

from ._view import View


def _jumps(d: View):
    rows = np.flatnonzero(np.any(np.abs(np.diff(d.v, axis=0)) > 1.0, axis=1)) + 1
    return d.t[rows]


def s01(d: View):
    share = d.share(d.dmn == 1, d.between(1e-3, 0.1))
    return share == 1, f"RR in {share:.0%} of 1 ms to 0.1 s"


def s02(d: View):
    share = d.share(d.dmn == 1, d.between(0, 1.9))
    return share >= 0.95, f"RR in {share:.0%} of 0 to 1.9 s"


def s03(d: View):
    before, after = d.share(d.dmn == 1, d.between(1.4, 1.9)), d.share(d.dmn == 4, d.between(2.6, 2.7))
    return before > 0.5 and after > 0.5, f"RR {before:.0%} before, SS {after:.0%} after"


def s04(d: View):
    share = d.share(d.dmn == 4, d.after(2.6))
    return share >= 0.99, f"SS {share:.0%} after 2.6 s"


def s05(d: View):
    late = d.greatest(np.hypot(d.vx, d.vy), d.after(3))
    return late <= 1e-12 and bool(d.moving.any()), f"speed up to {late:.3g} m/s after 3 s"


def s06(d: View):
    d.reaches(2.7)
    last = float(d.t[np.flatnonzero(d.moving)[-1]]) if d.moving.any() else 0.0
    return 1.9 <= last <= 2.7, f"last motion at {last:.4g} s"


def s07(d: View):
    still = d.after(2.7) & ~d.moving
    count = int(np.sum(still & (np.hypot(d.ax, d.ay) > 1e-9)))
    return count > 0 and d.share(still, d.t > 2.7) == 1, f"{count} such rows"


def _range(d: View, rows) -> float:
    return float(np.hypot(np.ptp(d.x[rows]), np.ptp(d.y[rows]))) if rows.any() else 0.0


def s08(d: View):
    d.reaches(2)
    size = _range(d, d.t <= 2)
    return size > 0.01, f"{size:.4g} m in the first 2 s"


def s09(d: View):
    d.reaches(2)
    share = d.share(np.all(~d.inside, axis=1), d.t <= 2)
    return share >= 0.9, f"{share:.0%} of the first 2 s"


def s10(d: View):
    d.reaches(2)
    share = d.share(np.all(~d.slips, axis=1), d.t < 2)
    return share >= 0.9, f"{share:.0%} of the first 2 s"


def s11(d: View):
    late, early = d.greatest(d.belt, d.after(2.6)), d.greatest(d.belt, d.t < 1.9)
    return late < 0.25 * early, f"{late:.4g} N m against {early:.4g} N m"


def s12(d: View):
    slips = bool(np.any(d.slips[d.after(2.6)]))
    late, early = _range(d, d.after(3)), _range(d, d.t < 2)
    return slips and late < 1e-3 and early > 1e-3, f"{late:.3g} m after 3 s"


def s13(d: View):
    d.resolves(5e-3)
    begins = np.flatnonzero(np.any(d.slips, axis=1))
    jumps = _jumps(d)
    jumps = jumps[jumps > 0.1]
    if not begins.size or not jumps.size:
        return False, "no slip" if not begins.size else "no jump of the input"
    t = float(d.t[begins[0]])
    after = t - jumps[jumps <= t + 1e-9]
    return bool(after.size and after.min() <= 5e-3), f"first slip at {t:.4g} s"


def s14(d: View):
    d.reaches(2.7)
    rr, ss = d.share(d.dmn == 1), d.share(d.dmn == 4)
    mixed = d.share(np.isin(d.dmn, (2, 3)))
    return rr >= 0.1 and ss >= 0.1 and mixed < 0.05, f"RR {rr:.0%}, SS {ss:.0%}, SR and RS {mixed:.0%}"


def s15(d: View):
    d.reaches(2)
    levels = max(np.unique(np.round(d.v[:, i], 9)).size for i in (0, 1))
    jumps = int(np.sum(_jumps(d) > 0))
    return levels <= 3 and jumps > 0, f"{levels} levels, {jumps} jumps after the start"


STATEMENTS = {
    "S3.01": ("Both motors roll at first.", s01),
    "S3.02": ("The state is RR until about 2 s.", s02),
    "S3.03": ("After about 2 s both shift to slip.", s03),
    "S3.04": ("The state is SS for good afterwards.", s04),
    "S3.05": ("The virtual pulleys are stationary afterwards.", s05),
    "S3.06": ("The velocity drops to zero at about 2 s.", s06),
    "S3.07": ("Some points then leave the dead zone while the mechanism stays static.", s07),
    "S3.08": ("The mechanism moves in the first 2 s.", s08),
    "S3.09": ("The voltages exceed the mapped dead zone in the first 2 s.", s09),
    "S3.10": ("Before 2 s the transferred torque is the drive torque.", s10),
    "S3.11": ("After the slip the transferred torques are much smaller.", s11),
    "S3.12": ("The friction torques cannot restart it.", s12),
    "S3.13": ("Slip is triggered by inertia.", s13),
    "S3.14": ("RR, then SS.", s14),
    "S3.15": ("The input is piecewise constant pulses.", s15),
}
