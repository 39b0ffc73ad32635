"""Judgement of the beam's figures on data made up so that the answer is known."""

import numpy as np
import xarray as xr

from experiments._experiment import load
from experiments.beam._coordinates import FIRST, MOST, physical
from experiments.beam._judge import (
    change_over,
    judge_diagrams,
    judge_exponents,
    judge_powers,
    judge_slow_frequency,
    judge_stick_slip,
)
from experiments.beam._score import ITEMS, SPEEDS, items
from experiments.beam.fig2_02 import EXPERIMENT as FRICTION
from stickslip.analysis import amplitude_spectrum

V = np.linspace(1e-4, 3e-2, 60)
T = np.arange(0.0, 200.0, 0.01)


def holds(statements):
    return {s.id.partition(" ")[0]: s.holds for s in statements}


def diagram(**faults):
    """What the paper claims, unless a fault is planted."""
    one = np.ones((1, V.size, 6))
    wobble = np.linspace(-1, 1, 6)[None, None, :]
    middle = ((V >= 2.5e-3) & (V <= 9e-3))[None, :, None]
    sticks = np.where(V < 2.5e-3, 100, 0)[None, :]
    data = {
        "x": 9e-4 * one * (1 + faults.get("x", 0.0) * wobble),
        "y": 0.01 * one * (1 + 0.2 * wobble * (middle if "y" not in faults else 0)),
        "w": V[None, :, None] * one * (1 + faults.get("w", 0.0) * wobble),
    }
    return xr.Dataset(
        {
            **{k: (("variant", "v", "point"), a) for k, a in data.items()},
            "sticks": (("variant", "v"), sticks if "sticks" not in faults else 0 * sticks + 3),
            "stick_share": (("variant", "v"), 0.3 * sticks / 100.0),
            "ok": (("variant", "v"), np.ones((1, V.size), int)),
        },
        {"variant": ["consistent"], "v": V},
        {"duration": 54.05},
    )


def test_diagrams():
    ids = ["C1", "C2", "C3", "C4a", "C4b", "C5"]
    assert holds(judge_diagrams(diagram())) == dict.fromkeys(ids, True)
    assert holds(judge_diagrams(diagram(x=1e-3)))["C1"] is False
    assert holds(judge_diagrams(diagram(w=0.3)))["C2"] is False
    assert holds(judge_diagrams(diagram(y=0)))["C4a"] is False
    wrong = holds(judge_diagrams(diagram(sticks=3)))
    assert [wrong[i] for i in ("C3", "C4b", "C5")] == [False, False, False]


DIAGRAMS = ["C1", "C2", "C3", "C4a", "C4b", "C5"]


def test_diagrams_that_do_not_tell():
    """No lane, all failed, no point, two points: open; a counterexample decides all the same."""
    good = diagram()
    nothing = dict.fromkeys(DIAGRAMS)
    assert holds(judge_diagrams(good.assign(ok=0 * good.ok))) == nothing
    bare = good.assign({name: good[name] * np.nan for name in "xyw"})
    found = holds(judge_diagrams(bare))
    assert found == {**nothing, "C3": True, "C4b": True}
    two = good.assign({name: good[name].where(good.point < 2) for name in "xyw"})
    assert holds(judge_diagrams(two)) == {**nothing, "C3": True, "C4b": True}
    part = good.assign(ok=good.ok.where(good.v < 0.012, 0))
    found = holds(judge_diagrams(part))
    assert [found[i] for i in DIAGRAMS] == [None, None, True, True, True, None]
    wrong = diagram(x=1e-3)
    assert holds(judge_diagrams(wrong.assign(ok=wrong.ok.where(wrong.v < 0.012, 0))))["C1"] is False
    few = holds(judge_diagrams(good.isel(v=[0, 30])))
    assert set(few.values()) == {None}


def motion(**signals):
    data = {}
    for name, u in signals.items():
        data[name] = (("variant", "time"), u[None])
        spectrum = amplitude_spectrum(u, 0.01)
        data[f"{name}_amplitude"] = (("variant", "frequency"), np.asarray(spectrum.amplitude)[None])
        frequency = np.asarray(spectrum.frequency)
    return xr.Dataset(
        data,
        {"variant": ["consistent"], "time": T, "frequency": frequency},
        {"dropped": 0.0},
    )


def saw(f, count):
    return sum(np.sin(2 * np.pi * n * f * T) / n for n in range(1, count + 1))


def test_stick_slip_and_its_superharmonics():
    y, w = saw(1 / 0.5405, 9), saw(1 / 0.5405, 5)
    data = motion(y=y, w=w)
    begins = np.full((1, 400), np.nan)
    begins[0, :370] = 0.5405 * np.arange(370) + 0.1
    data["stick_begins"] = (("variant", "stick"), begins)
    assert holds(judge_stick_slip(data)) == {"C6": True}
    data["stick_begins"] = (("variant", "stick"), 1.1 * begins)
    assert holds(judge_stick_slip(data)) == {"C6": False}


def test_powers():
    stuck = (T % 0.54054) < 0.2
    regular = np.where(stuck, 0.0, -np.abs(np.sin(np.pi * (T % 0.54054) / 0.54054)))
    data = motion(W_f=regular, W_b=np.sin(np.pi * T * np.sqrt(2)))
    data["mode"] = (("variant", "time"), np.where(stuck, 1, 0)[None])
    assert holds(judge_powers(data)) == {"C7": True}
    data["W_f"] = data.W_f - 1e-3
    assert holds(judge_powers(data)) == {"C7": False}
    assert change_over(np.sin(2 * np.pi * T), 0.01, 1.0) < 1e-10
    assert abs(change_over(np.sin(2 * np.pi * T), 0.01, 0.5) - 2.0) < 1e-2


def test_slow_frequency():
    assert holds(judge_slow_frequency(motion(y=saw(0.25, 5)))) == {"C8": True}
    assert holds(judge_slow_frequency(motion(y=saw(0.31, 5)))) == {"C8": False}
    assert holds(judge_slow_frequency(motion(y=0.1 * saw(0.25, 3) + saw(1.85, 3)))) == {"C8": False}


def test_exponents():
    tent = np.interp(V, [1e-4, 2.5e-3, 9e-3, 3e-2], [0.4, 0.1, 0.5, 0.2])

    def data(greatest):
        values = np.stack([greatest, -0.5 + 0 * V, -np.inf + 0 * V], axis=1)[None]
        return xr.Dataset(
            {
                "exponents": (("variant", "v", "exponent"), values),
                "error": (("variant", "v", "exponent"), np.full(values.shape, 0.01)),
                "letter": (("variant", "v"), greatest[None]),
            },
            {"variant": ["consistent"], "v": V},
        )

    assert holds(judge_exponents(data(tent))) == {"C9a": True, "C9b": True}
    assert holds(judge_exponents(data(-tent))) == {"C9a": False, "C9b": False}


def test_motions_that_do_not_tell():
    """NaN, at rest, too short, never in stick: open."""
    stuck = (T % 0.54054) < 0.2
    y = saw(1 / 0.5405, 9)
    data = motion(y=y, w=y, W_f=np.where(stuck, 0.0, -1.0), W_b=y)
    data["mode"] = (("variant", "time"), np.where(stuck, 1, 0)[None])
    data["stick_begins"] = (("variant", "stick"), 0.5405 * np.arange(370)[None] + 0.1)
    judges = (judge_stick_slip, judge_powers, judge_slow_frequency)

    def all_of(data):
        return [next(iter(holds(judge(data)).values())) for judge in judges]

    assert all_of(data) == [True, True, False] or None not in all_of(data)
    short = data.isel(time=slice(100))
    assert all_of(short) == [None, None, None]
    assert all_of(data * np.nan) == [None, None, None]
    still = data.assign({name: 0.0 * data[name] for name in data if name != "stick_begins"})
    assert all_of(still.assign_attrs(data.attrs)) == [None, None, None]
    slips = data.assign(mode=0 * data["mode"])
    assert all_of(slips)[1] is None
    coarse = data.assign_coords(frequency=5 * data.frequency)
    assert all_of(coarse)[2] is None


def test_exponents_that_do_not_tell():
    """Not a number; within their errors; too few."""
    tent = np.interp(V, [1e-4, 2.5e-3, 9e-3, 3e-2], [0.4, 0.1, 0.5, 0.2])

    def judged(greatest, error, rows=slice(None)):
        data = xr.Dataset(
            {
                "exponents": (("variant", "v", "exponent"), np.asarray(greatest)[None, :, None]),
                "error": (("variant", "v", "exponent"), np.full((1, V.size, 1), error)),
                "letter": (("variant", "v"), np.asarray(greatest)[None]),
            },
            {"variant": ["consistent"], "v": V},
        )
        return holds(judge_exponents(data.isel(v=rows)))

    open_ = {"C9a": None, "C9b": None}
    assert judged(tent * np.nan, 0.01) == open_
    assert judged(tent, np.nan)["C9a"] is None
    assert judged(tent, 1.0)["C9a"] is None
    assert judged(tent, 0.01, slice(0, 2)) == open_
    assert judged(0 * tent, 1e-4)["C9a"] is False
    assert judged(0 * tent - np.inf, 0.01)["C9a"] is None
    wobble = np.random.default_rng(0).standard_normal(V.size)
    assert judged(0.3 + 0.1 * wobble, 0.01)["C9b"] is not True
    one = np.where(V > 0.029, -0.1, tent)
    assert judged(one, 0.01)["C9a"] is False


def test_friction_curve_is_the_formula():
    curve = FRICTION.compute({"V_max": 0.3, "points": 60}, None)
    V = np.asarray(curve.V)
    np.testing.assert_allclose(curve.T_d.sel(variant="consistent"), -np.sign(V) / (1 + 10 * abs(V)))
    printed = np.asarray(curve.T_d.sel(variant="as printed"))
    exact = -np.sign(V) / (1 + 10 * V)
    np.testing.assert_allclose(printed, np.where(abs(exact) < 50, exact, np.nan))


def test_all_figures_are_there():
    names = [name for name in load() if name.startswith("beam-")]
    figures = (f"beam-fig2.{n}" for n in range(2, 14))
    assert names == ["beam-branches", *figures, "beam-search"]


def test_score_of_what_the_paper_claims():
    """C2 to C5 at all speeds; then stick everywhere; then a width that is never small."""
    middle = (SPEEDS > 2.5e-3) & (SPEEDS < 9e-3)
    slow = SPEEDS < 2.5e-3
    sticks, y, w = np.where(slow, 1.0, 0.0), np.where(middle, 0.3, 0.0), 0.0 * SPEEDS
    np.testing.assert_array_equal(items(y, w, SPEEDS, sticks), np.ones(len(ITEMS) - 3))
    np.testing.assert_array_equal(items(y, w, SPEEDS, sticks + 1), [1, 1, 1, 0, 0])
    np.testing.assert_array_equal(items(y + 1, w + 1, SPEEDS, sticks), [0.5, 1, 1, 1, 0])


def test_coordinates_of_the_search():
    """The constructed set is its first point, up to rounding by hand; the contact period is kept."""
    p = {k: float(v) for k, v in physical(FIRST).items()}
    for name, value in {"m": 0.1, "k1": 0.25, "k2": 7.6, "k3": 22.8, "z_A": 0.4}.items():
        assert abs(p[name] - value) < 1e-3 * value
    q = physical(MOST)
    period = np.pi * np.sqrt(q["m"]) * (1 / np.sqrt(q["k2"] + q["k3"]) + 1 / np.sqrt(q["k2"]))
    assert abs(float(period) - 0.5405) < 1e-12
