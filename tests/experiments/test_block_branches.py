"""The block's branches of periodic orbits: their judgement, and the command against SciPy alone."""

import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

import stickslip as ss
from experiments._experiment import Context, chosen, load
from experiments.block import _branches
from experiments.block._branches import kept_in, precise, with_branches
from experiments.block._diagram import MODELS
from experiments.block._judge import judge_branches
from experiments.block._sets import MASS, NAMES, RADIUS, start_values

FIRST = 81.1341060  # N/m, of the simplified model: SciPy, below


def made_up(flips, *, lost=None, more=()):
    """Basic orbits over k3, stable up to their doubling; `lost`: a model that is unstable before it."""
    k3 = np.linspace(70.0, 95.0, 26)
    rows = [
        (i, 0, k, k < flip and not (i == lost and k < 72.0)) for i, flip in enumerate(flips) for k in k3
    ]
    marks = [(i, 0, flip, "PD") for i, flip in enumerate(flips) if flip < 95.0]
    marks += [(i, 0, 95.0, "EP") for i in range(len(flips))] + list(more)
    names = ("model", "doublings", "k3")
    return xr.Dataset(
        {
            f"{what}_{name}": (what, [row[i] for row in table])
            for what, table, last in (("orbit", rows, "stable"), ("special", marks, "label"))
            for i, name in enumerate((*names, last))
        },
        {"model": list(MODELS)},
    )


def verdicts(data):
    return {s.reading: s.holds for s in judge_branches(data)}


def test_first_doublings_are_compared():
    data = made_up((81.0, 79.0, 83.0))
    assert verdicts(data) == {"printed sign": True, "consistent sign": False}
    # Those of doubled orbits, and later ones of the basic orbit, are not the first.
    later = ((1, 1, 60.0, "PD"), (2, 0, 90.0, "PD"), (0, 0, 60.0, "LP"))
    assert verdicts(made_up((81.0, 79.0, 83.0), more=later)) == verdicts(data)


def test_what_is_not_on_the_branch_is_left_open():
    none = made_up((81.0, 99.0, 83.0))
    assert verdicts(none) == {"printed sign": None, "consistent sign": False}
    assert "cannot be told" in judge_branches(none)[0].measured
    assert verdicts(made_up((99.0, 79.0, 83.0))) == {"printed sign": None, "consistent sign": None}
    unstable = made_up((81.0, 79.0, 83.0), lost=2)
    assert verdicts(unstable) == {"printed sign": True, "consistent sign": None}
    early = made_up((81.0, 60.0, 83.0))  # nothing is known of what comes before
    assert verdicts(early)["printed sign"] is None


def slopes(t, y, k3):
    """Eqs. (8) to (12) with set A, written here by themselves."""
    p, g, r, m = dict(zip(NAMES, start_values(), strict=True)), 9.81, RADIUS, MASS
    big, J = p["M"], p["J_factor"] * 3.0 * p["M"] * RADIUS**2
    Q = p["Q_factor"] * -0.75 * big * g * r
    x, vx, y, vy = y
    lift = 0.75 * (1.0 + y / r - y**2 / (2 * r**2) - y**3 / (6 * r**3))
    spring = k3 * (y + x**2 / (2 * r))
    normal = m * g + big * g * lift - spring - p["c2"] * vy
    slip = vx - p["V_b"]
    size = slip * np.sign(np.real(slip))  # analytic: slopes are taken by complex steps
    mu = p["mu_0"] / (1.0 + p["gamma"] * size) * np.tanh(p["alpha"] * slip)
    # Trial steps of the solver go far away, where the hyperbolic cosine has no number.
    near = np.real(p["alpha"] * size) < 300.0
    peak = p["beta"] / np.cosh(p["alpha"] * size) if near else 0.0
    friction = mu * (1.0 + peak) * normal
    rate = vx + vy
    ax = (-friction - p["c1"] * rate - (p["k1"] + p["k2"]) * x - p["k2"] * y - spring * x / r) / m
    push = Q / r + p["c1"] * rate + p["c2"] * vy + p["k2"] * (x + y) + spring + big * g * lift
    return vx, ax, vy, -push * r**2 / J


def with_deviations(t, z, k3):
    """The motion and four deviations from it; the field's derivative by complex steps."""
    y, deviations = z[:4], z[4:].reshape(4, 4)
    jacobian = np.array([np.imag(slopes(t, y + 1e-30j * e, k3)) for e in np.eye(4)]).T / 1e-30
    return np.concatenate([slopes(t, y, k3), np.ravel(jacobian @ deviations)])


def orbit(y, period, k3):
    """Newton's method with SciPy's integration alone; state, period, monodromy."""
    y0 = y.copy()
    for _ in range(8):
        start = np.concatenate([y, np.eye(4).ravel()])
        run = solve_ivp(
            with_deviations, (0.0, period), start, "DOP853", args=(k3,), rtol=1e-11, atol=1e-13
        )
        end, monodromy = run.y[:4, -1], run.y[4:, -1].reshape(4, 4)
        along = np.array(slopes(0.0, y0, k3))
        left = np.block([
            [monodromy - np.eye(4), np.array(slopes(0.0, end, k3))[:, None]],
            [along[None, :], np.zeros((1, 1))],
        ])  # fmt: skip
        move = np.linalg.solve(left, -np.append(end - y, along @ (y - y0)))
        if np.abs(move).max() < 1e-10:
            break
        y, period = y + move[:4], period + move[4]
    return y, period, monodromy


@pytest.mark.slow
def test_the_first_doubling_is_that_of_shooting_with_scipy(tmp_path):
    parameters = chosen(load()["block-branches"], True, [])
    found = with_branches(MODELS[:1], parameters, Context(tmp_path))
    labels = found.special_label.values.tolist()
    flip = found.isel(special=labels.index("PD"))
    assert labels.count("PD") == 1
    # The same from a settled motion and its deviations: -1 is reached by secants.
    start = solve_ivp(slopes, (0.0, 30.0), np.zeros(4), "DOP853", args=(80.0,), rtol=1e-6, atol=1e-8)
    y, period = start.y[:, -1], 0.781

    def multiplier(k3, y, period):
        y, period, monodromy = orbit(y, period, k3)
        return y, period, float(np.linalg.eigvals(monodromy).real.min()) + 1.0

    a, b = 81.0, 81.2
    y, period, va = multiplier(a, y, period)
    y, period, vb = multiplier(b, y, period)
    for _ in range(3):
        a, b, before = b, b - vb * (b - a) / (vb - va), vb
        va, (y, period, vb) = before, multiplier(b, y, period)
        if abs(b - a) < 1e-8:
            break
    assert float(flip.special_k3) == pytest.approx(b, abs=1e-6)
    assert float(flip.special_period) == pytest.approx(period, abs=1e-8)
    assert b == pytest.approx(FIRST, abs=1e-6)


QUICK = chosen(load()["block-branches"], True, []) | {"doublings": 1, "max_orbits": 200, "step": 0.02}


@pytest.fixture(scope="module")
def beginning():
    """A diagram of two lanes: one that is not settled, and one on the orbit."""
    system, start = _branches.system_of("simplified", 80.0, "A")
    run = ss.simulate(
        system, 0.0, 60.0, start, integrator=precise(QUICK), saveat=ss.SaveAt(max_events=None)
    )
    rows = ("protocol", "k3")
    ends = {f"end_{k}": (rows, [[float(v), float(v)]]) for k, v in run.y1._asdict().items()}
    return xr.Dataset({
        "status": (rows, [[3, 0]]), "duration": (rows, [[0.781, 0.781]]), "count": (rows, [[1, 1]]),
        **ends,
    }, {"k3": [79.0, 80.0]})  # fmt: skip


@pytest.mark.slow
def test_doubled_orbits_bend_back_and_branch_again(tmp_path, beginning, monkeypatch):
    """At k3 = 90.2 the branch turns within a thousandth of its length: there Newton's method fails from
    afar. What follows is located; SciPy alone has the multipliers there."""
    parameters = QUICK | {"follow_min": 79.0, "follow_max": 91.0}
    folder = kept_in("simplified", parameters, Context(tmp_path))
    found = _branches.family("simplified", beginning, parameters, folder)
    basic, doubled = found.branches
    assert found.doublings == (0, 1)
    assert basic["PD"][0].value == pytest.approx(FIRST, abs=1e-6)
    assert [s.label for s in doubled.specials] == ["NS", "PD", "EP"]
    torus, flip, _ = doubled.specials
    for at in (torus, flip):
        _, period, monodromy = orbit(np.array(at.orbit.y0), float(at.orbit.period), at.value)
        assert period == pytest.approx(float(at.orbit.period), abs=1e-7)
        multipliers = np.linalg.eigvals(monodromy)
        if at is flip:
            assert np.abs(multipliers + 1.0).min() < 1e-4
        else:
            pair = multipliers[np.abs(multipliers.imag) > 0.1]
            np.testing.assert_allclose(np.abs(pair), 1.0, atol=1e-4)
            assert pair.size == 2
    # A second run reads what the first one found, and follows nothing.
    monkeypatch.setattr(_branches, "continue_orbit", None)
    again = _branches.family("simplified", beginning, parameters, folder)
    for old, new in zip(found.branches, again.branches, strict=True):
        np.testing.assert_array_equal(old.values, new.values)
        assert [(s.label, s.value) for s in old.specials] == [(s.label, s.value) for s in new.specials]

    # Only what is missing is followed, and what cannot be found is named.
    def fails(system, point, name, **options):
        raise ValueError("no orbit there")

    monkeypatch.setattr(_branches, "continue_orbit", fails)
    (folder / "doubled-1-0.nc").unlink()
    less = _branches.family("simplified", beginning, parameters, folder)
    assert less.doublings == (0,)
    assert less.not_followed == ("PD at 81.13410606: no orbit there",)
    assert not list(kept_in("simplified", parameters, Context(tmp_path, fresh=True)).iterdir())
