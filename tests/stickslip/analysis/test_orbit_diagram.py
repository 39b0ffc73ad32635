"""Orbit diagrams of systems whose attractors are known."""

from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

import stickslip as ss
from stickslip.analysis import Maximum, Minimum, PeriodTest, Recording, orbit_diagram
from stickslip.sweep import Carried, Compute, Labels, Storage
from stickslip.systems import CoulombOscillator, Motion
from tests.stickslip.analysis._forced import (
    DoubleWell,
    Driven,
    HopfOscillator,
    Hysteresis,
    Level,
    Quadratic,
    Rotor,
)

STEP = ss.Integrator("rk4", ss.FixedStep(0.05))
MU = np.array([0.25, 0.49, 1.0, 1.44])


RECORDED = (
    "transient", "duration", "section", "observables", "points", "max_points", "period", "domain",
    "check", "t0",
)  # fmt: skip


def diagram(*given, **options):
    """A diagram, what it records given flat."""
    record = Recording(**{key: options.pop(key) for key in RECORDED if key in options})
    return orbit_diagram(*given, record=record, **options)


def up(system, t, y, dy, mode, args):
    return y.v


def clock(system, t, y, dy, mode, args):
    return y.s


HOPF = {
    "system": HopfOscillator(mu=1.0),
    "grid": {"mu": MU},
    "y0": Rotor(0.5, 0.1),
    "section": ss.Section(up, "rising"),
    "observables": "u",
    "transient": 40.0,
    "duration": 50.0,
    "max_points": 16,
    "integrator": STEP,
    "check": 0,
    "compute": Compute("portable"),
}


FAR = ss.Section(lambda system, t, y, dy, mode, args: y.u + 9.0, "both")


def meanings(dataset, name="status"):
    words = dataset[name].attrs["flag_meanings"].split()
    return [words[int(s)] for s in np.ravel(dataset[name])]


@pytest.mark.more
def test_radius_period_and_labels():
    result = diagram(**{**HOPF, "check": 4})
    np.testing.assert_allclose(result.u[:, :7], np.sqrt(MU)[:, None] * np.ones(7), rtol=1e-4)
    assert result.u.dims == ("mu", "point")
    assert result.u.attrs["units"] == "m"
    assert set(meanings(result)) == {"ok"}
    assert (result.period == 1).all()
    assert not result.slow_transient.any()
    assert (result["count"] == np.isfinite(result.u).sum("point")).all()
    # A step of half the length of a method of order 4: the estimate is near the error itself.
    error = np.abs(result.u - np.sqrt(result.mu)).max("point")
    np.testing.assert_allclose(result.error_u, error, rtol=0.3, atol=1e-12)
    np.testing.assert_array_equal(result.checked_mu, MU)


@pytest.mark.slow
def test_maxima_are_a_section():
    high = diagram(**{**HOPF, "section": Maximum("u")})
    low = diagram(**{**HOPF, "section": Minimum("u")})
    np.testing.assert_allclose(high.u[:, 0], np.sqrt(MU), rtol=1e-4)
    np.testing.assert_allclose(low.u[:, 0], -np.sqrt(MU), rtol=1e-4)


@pytest.mark.slow
def test_slow_transient_is_flagged():
    result = diagram(**{**HOPF, "transient": 0.0, "duration": 100.0, "max_points": 32})
    assert bool(result.slow_transient[0])
    assert (result.period == 1).all()


CASCADE = {
    "system": DoubleWell(0.2),
    "grid": {"f": [0.20, 0.28, 0.29, 0.37, 0.50, 0.65]},
    "y0": Driven(1.0, 0.0, 1.0, 0.0),
    "section": Maximum("x"),
    "observables": {
        "x": "x",
        "v": "v",
        "far": "far",
        "zero": lambda system, t, y, dy, mode, args: 0.0 * t,
    },
    "transient": 300.0,
    "duration": 500.0,
    "max_points": 128,
    "integrator": ss.Integrator("tsit5", ss.AdaptiveStep(1e-9, 1e-10)),
    "check": 0,
    "compute": Compute("portable"),
}


@pytest.mark.slow
def test_periods_where_one_observable_vanishes_on_the_section():
    """The speed is zero at the maxima of x to rounding, and must not spoil what x says.

    Per period of the drive x has one maximum here.
    """
    result = diagram(**CASCADE)
    assert result.period.values.tolist() == [1, 2, 4, 5, 0, 2]
    assert meanings(result, "period_status") == [*["repeats"] * 4, "none", "repeats"]
    assert set(meanings(result)) == {"ok"}
    assert float(abs(result.v).max()) < 1e-9
    assert not result.flags.any()
    # By itself the speed says nothing, nor do two rounds of a period of 16 in 20 points.
    speed = diagram(**{**CASCADE, "observables": "v"})
    assert set(meanings(speed, "period_status")) == {"zero_on_section"}
    assert (speed.period == -1).all()


@pytest.mark.more
def test_a_record_too_short_or_too_early_does_not_say_chaos():
    short = diagram(**{**CASCADE, "points": 20, "duration": 200.0})
    assert short.period.values.tolist() == [1, 2, 4, 5, -1, 2]
    # Which 20 points of the chaos are seen hangs on rounding; some of them look like a slow approach.
    assert meanings(short)[4] in ("too_few_points", "not_settled")
    assert set(np.delete(meanings(short), 4)) == {"ok"}
    assert meanings(short, "period_status")[4] in ("too_few_points", "not_settled")
    fewer = diagram(**{**CASCADE, "points": 20, "duration": 60.0, "transient": 1.0})
    assert set(meanings(fewer)) == {"fewer_points"}
    assert not (fewer.period == 0).any()


class Resonant(ss.AbstractSmoothSystem):
    r"""$\ddot x + 2\zeta\dot x + x = \cos s$, $\dot s = \omega$: transients decay as $e^{-\zeta t}$."""

    omega: Any
    units: ClassVar = {"x": "m", "v": "m/s", "s": "rad"}
    parameter_units: ClassVar = {"omega": "rad/s"}

    def vector_field(self, t, y, mode, args):
        pull = jnp.cos(y["s"]) - y["x"] - 2.0 * 0.005 * y["v"]
        return {"x": y["v"], "v": pull, "s": self.omega}


@pytest.mark.more
@pytest.mark.parametrize("transient", [20.0, 100.0, 3000.0])
def test_a_lightly_damped_resonance_is_not_ok_before_it_has_settled(transient):
    """Maxima of the closed form are all alike: where they differ by 2 %, it has not been reached."""
    result = diagram(
        lambda omega: Resonant(omega), {"omega": np.linspace(0.7, 1.3, 16)},
        {"x": 0.0, "v": 0.0, "s": 0.0}, section=Maximum("x"), observables="x", transient=transient,
        duration=100.0, check=0, compute=Compute("portable"),
    )  # fmt: skip
    x, omega = result.x.values, result.omega.values
    spread = (np.nanmax(x, axis=1) - np.nanmin(x, axis=1)) / np.nanmax(np.abs(x), axis=1)
    ok = np.array(meanings(result)) == "ok"
    assert not np.any(ok & (spread > 0.02))
    assert set(np.array(meanings(result))[~ok]) <= {"not_settled", "too_few_points"}
    assert ok.all() == (transient == 3000.0)
    if transient == 3000.0:
        closed = 1.0 / np.hypot(1.0 - omega**2, 0.01 * omega)
        np.testing.assert_allclose(np.nanmax(x, axis=1), closed, rtol=1e-4)
    assert result.omega.attrs["units"] == "rad/s"  # known of a function, too


@pytest.mark.more
def test_a_motion_at_rest_has_no_period():
    """A block on a belt at rest stops and sticks: the section is never reached after the transient."""
    result = diagram(
        CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2), {"belt_speed": [0.0, 0.3]}, Motion(0.0, 0.4),
        section=Maximum("x"), observables=["x", "v"], transient=20.0, duration=60.0, check=0,
        integrator=ss.Integrator("rk4", ss.FixedStep(0.01)), compute=Compute("portable"),
    )  # fmt: skip
    assert meanings(result) == ["at_rest", "ok"]
    assert result.period.values.tolist() == [-1, 1]
    assert meanings(result, "period_status") == ["constant", "repeats"]
    # Slip against 0.5 N until the first stop; there it stays to the end.
    assert float(result.end_x[0]) == pytest.approx(np.sqrt(0.5**2 + 0.4**2) - 0.5, abs=1e-7)
    assert float(result.end_v[0]) == 0.0


@pytest.mark.more
def test_motions_that_decay_are_told_apart_from_rest_and_from_one_another():
    """By friction F maxima fall by 4 F a swing, and rest begins within F; without it they repeat."""
    force = np.array([0.0, 0.005, 0.02, 0.1, 2.0])
    result = diagram(
        lambda force: CoulombOscillator(1.0, 1.0, force, force, 0.0), {"force": force},
        Motion(1.0, 0.0), section=Maximum("x"), observables="x", transient=0.0, duration=120.0,
        max_points=32, check=0, compute=Compute("portable"),
    )  # fmt: skip
    assert meanings(result)[0] == "ok"
    assert meanings(result)[1] in ("too_few_points", "not_settled")
    assert meanings(result)[2:] == ["at_rest"] * 3
    assert result.period.values.tolist() == [1, -1, -1, -1, -1]
    assert meanings(result, "period_status")[2:] == ["constant"] * 3
    for lane in (1, 2, 3):
        seen = result.x.values[lane, : int(result["count"][lane])]
        closed = 1.0 - 4.0 * force[lane] * (1.0 + np.arange(seen.size))
        np.testing.assert_allclose(seen, closed, atol=1e-7)
    assert (np.abs(result.end_x.values[2:]) <= force[2:] + 1e-9).all()


@pytest.mark.more
def test_a_transient_that_did_not_settle_is_no_ok():
    """r' = r (mu - r^2): at mu = 0.25 the distance falls by e^-0.5 a second, e^-pi a round."""
    result = diagram(**{**HOPF, "transient": 1e-3, "duration": 100.0, "max_points": 32})
    assert meanings(result)[0] == "not_settled"
    assert int(result.period[0]) == 1


@pytest.mark.more
def test_a_lane_whose_points_still_differ_is_not_ok():
    """The radius grows by 2 mu a second: over the record it is still on its way by 2% to 40%."""
    slow = {**HOPF, "grid": {"mu": [0.002, 0.003, 0.005, 0.25]}, "y0": Rotor(0.03, 0.0)}
    for duration, word in ((45.0, "too_few_points"), (203.0, "not_settled")):
        result = diagram(**{**slow, "transient": 1e-3, "duration": duration, "max_points": 32})
        reached = np.nanmax(result.u.values, axis=1)[:3]
        assert (reached - result.u.values[:3, 0] > 0.02 * reached).all()
        assert meanings(result)[:3] == [word] * 3
        assert (result.period[:3] == -1).all()


@pytest.mark.more
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"domain": "gap"}, ["ok", "ok", "ok", "left_domain"]),
        pytest.param({"max_points": 3}, ["buffer_full"] * 4, marks=pytest.mark.slow),
        pytest.param({"points": 3}, ["ok"] * 4, marks=pytest.mark.slow),
        pytest.param(
            {"y0": Rotor(-1.2, 0.0), "domain": ("gap",)}, ["left_domain"] * 4, marks=pytest.mark.slow
        ),
        pytest.param({"section": FAR}, ["no_crossing"] * 4, marks=pytest.mark.slow),
    ],
    ids=["leaves", "overflows", "stops", "outside", "never crosses"],
)
def test_status_of_a_lane(change, words):
    result = diagram(**{**HOPF, **change})
    assert meanings(result) == words
    assert result.sizes["point"] == change.get("points", change.get("max_points", 16))
    assert (result["count"] == np.isfinite(result.u).sum("point")).all()


@pytest.mark.more
def test_a_lane_that_blows_up_is_marked_and_leaves_the_others_alone():
    call = {
        "system": Quadratic(p=0.0),
        "y0": Level(1.0, 1.0, 0.0),
        "section": ss.Section(clock, "rising"),
        "observables": ("x", "t"),
        "transient": 2.0,
        "duration": 5.0,
        "max_points": 8,
        "integrator": ss.Integrator("rk4", ss.FixedStep(0.02)),
        "check": 0,
        "compute": Compute("portable"),
    }
    odd = diagram(grid={"p": [0.0, 1.0, 0.01]}, **call)
    assert meanings(odd)[1] == "nonfinite"
    assert meanings(odd, "period_status")[1] == "lane_failed"
    assert int(odd.period[1]) == -1
    assert int(odd["count"][1]) == 0
    alone = diagram(grid={"p": [0.0, 0.0, 0.01]}, **call)
    np.testing.assert_array_equal(odd.x[[0, 2]], alone.x[[0, 2]])
    np.testing.assert_allclose(odd.t[0, :5], [2.0, 3.0, 4.0, 5.0, 6.0], atol=1e-4)


@pytest.mark.more
@pytest.mark.parametrize(
    ("carried", "check"), [("upwards", 0), pytest.param("downwards", 25, marks=pytest.mark.slow)]
)
def test_carried_lanes_show_hysteresis(carried, check):
    p = np.linspace(-0.6, 0.6, 25)
    upwards = carried == "upwards"
    result = diagram(
        Hysteresis(p=0.0),
        {"p": p},
        Level(-1.0 if upwards else 1.0, 1.0, 0.0),
        section=ss.Section(clock, "rising"),
        observables="x",
        transient=30.0,
        duration=2.2,
        max_points=4,
        integrator=ss.Integrator("rk4", ss.FixedStep(0.1)),
        carried=Carried(carried),
        check=check,
        store=Storage(chunk=7),
        compute=Compute("portable"),
    )
    fold = 2.0 / (3.0 * np.sqrt(3.0))
    upper = p > fold if upwards else p > -fold
    np.testing.assert_array_equal(np.sign(result.x[:, 0]), np.where(upper, 1.0, -1.0))
    if check:
        # The check restarts each lane from what its neighbour handed on.
        assert float(result.error_x.max()) < 1e-4


@pytest.mark.more
def test_several_sections_of_one_run_are_those_of_single_ones():
    """Maxima and minima of u on the circle of radius sqrt(mu) are its ends; v vanishes on both."""
    both = {"top": Maximum("u"), "bottom": Minimum("u")}
    options = {**HOPF, "grid": {"mu": MU[1:]}, "transient": 60.0, "check": 2}
    result = diagram(**{**options, "section": both})
    assert result.u.dims == ("mu", "section", "point")
    assert result.period.dims == result["count"].dims == ("mu", "section")
    assert result.error_u.dims == ("checked", "section")
    assert result.section.values.tolist() == ["top", "bottom"]
    radius = np.sqrt(MU[1:])[:, None] * np.ones(7)
    np.testing.assert_allclose(result.u.sel(section="top")[:, :7], radius, rtol=1e-4)
    np.testing.assert_allclose(result.u.sel(section="bottom")[:, :7], -radius, rtol=1e-4)
    assert (result.period == 1).all()
    assert set(meanings(result)) == {"ok"}
    assert float(result.error_u.max()) < 1e-4


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: Carried("sideways"), "direction = 'sideways'"),
        (lambda: PeriodTest(0.0), "tolerance = 0.0: it must be finite and positive"),
        (lambda: PeriodTest(longest=0), "longest = 0"),
        (lambda: Recording(1.0, 2.0, Maximum("u"), "u", t0=np.nan), "t0 = nan"),
    ],
)
def test_wrong_fields_are_named(make, text):
    with pytest.raises(ValueError, match=text):
        make()


@pytest.mark.slow
def test_two_parameters_and_a_state_per_lane():
    start = Rotor(np.full((4, 2), 0.5), np.array([[0.1, -0.1]] * 4))
    result = diagram(
        **{
            **HOPF,
            "system": lambda mu, scale: HopfOscillator(mu=mu * scale),
            "grid": {"mu": MU, "scale": [1.0, 0.5]},
            "y0": start,
            "check": 3,
        }
    )
    assert result.u.dims == ("mu", "scale", "point")
    radius = np.sqrt(MU[:, None] * np.array([1.0, 0.5]))
    np.testing.assert_allclose(result.u[..., 0], radius, rtol=2e-3)
    np.testing.assert_array_equal(result.checked_scale, [1.0, 1.0, 0.5])


@pytest.mark.more
def test_dry_friction_and_the_result_does_not_depend_on_the_cut():
    block = CoulombOscillator(1.0, 1.0, 1.0, 0.5, 0.2)
    call = {
        "system": block,
        "grid": {"belt_speed": np.linspace(0.1, 0.4, 9)},
        "y0": Motion(0.0, 0.0),
        "section": Maximum("x"),
        "observables": "x",
        "transient": 20.0,
        "duration": 60.0,
        "integrator": ss.Integrator("rk4", ss.FixedStep(0.01)),
        "max_points": 16,
        "check": 0,
        "compute": Compute("portable"),
    }
    result = diagram(**call)
    # Sticks until the spring holds 1 N, then swings about 0.5: a cycle of one maximum.
    expected = 0.5 + np.sqrt(0.25 + result.belt_speed**2)
    np.testing.assert_allclose(result.x[:, 0], expected, rtol=1e-8)
    assert (result.period == 1).all()
    other = diagram(**call, store=Storage(chunk=2))
    np.testing.assert_allclose(other.x, result.x, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"grid": {"nu": MU}}, ValueError, r"grid\['nu'\] = 'nu'.*one of mu"),
        ({"grid": {"mu": []}}, ValueError, "grid"),
        ({"grid": {"a": [1.0], "b": [1.0], "c": [1.0]}}, ValueError, "at most two"),
        ({"system": 3}, TypeError, "system = 3"),
        ({"system": lambda mu: mu}, TypeError, "it must be an AbstractHybridSystem"),
        ({"y0": Rotor(0.0, np.nan)}, ValueError, r"y0.v = nan: it must be finite"),
        ({"y0": Rotor("a", 0.0)}, TypeError, "y0.u = 'a'"),
        (
            {"y0": Rotor(np.zeros(3), np.zeros(3))},
            ValueError,
            r"\[\(3,\)\] beside the grid's shape \(4,\)",
        ),
        ({"section": "up"}, TypeError, "section = 'up'"),
        ({"section": Maximum("w")}, ValueError, "section.observable = 'w'"),
        ({"observables": "w"}, ValueError, r"observables\['w'\] = 'w': it must be a component"),
        ({"observables": []}, ValueError, r"observables = \[\]: it must be .* at least one"),
        ({"observables": {"count": "u"}}, ValueError, r"observables\['count'\].*this one is taken"),
        ({"observables": 4}, TypeError, "observables = 4"),
        ({"domain": "wall"}, ValueError, "domain = 'wall'"),
        ({"transient": -1.0}, ValueError, "transient = -1.0: it must be finite and not negative"),
        ({"transient": "long"}, TypeError, "transient = 'long'"),
        ({"duration": 0.0}, ValueError, "duration = 0.0: it must be finite and positive"),
        ({"duration": np.inf}, ValueError, "duration = inf"),
        ({"points": 0}, ValueError, "points = 0: it must be an integer of at least 1"),
        ({"max_points": 2.0}, ValueError, "max_points = 2.0"),
        ({"check": -1}, ValueError, "check = -1"),
        ({"carried": "upwards"}, TypeError, "carried = 'upwards': it must be a Carried, or None"),
        ({"period": 1e-3}, TypeError, "period = 0.001: it must be a PeriodTest"),
        ({"section": {}}, ValueError, r"section = \{\}"),
        ({"section": {"top": "up"}}, TypeError, r"section\['top'\] = 'up'"),
        ({"transients": 1.0}, TypeError, "argument .transients."),
        ({"integrator": "rk4"}, TypeError, "integrator = 'rk4'"),
        ({"labels": Labels({"w": ss.sweep.Variable()})}, ValueError, r"variables\['w'\] = Variable"),
        ({"mode0": "flying"}, ValueError, "mode0 = 'flying'"),
    ],
)
def test_wrong_arguments_are_named(change, error, text):
    with pytest.raises(error, match=text):
        diagram(**{**HOPF, **change})


def test_a_section_that_is_no_number_is_refused_before_anything_is_compiled():
    wrong = ss.Section(lambda system, t, y, dy, mode, args: jnp.stack([y.u, y.v]), "both")
    with pytest.raises(ValueError, match="section"):
        diagram(**{**HOPF, "section": wrong})
