"""Coverage on synthetic records: against closed forms and SciPy; what is said of made-up results."""

import jax
import numpy as np
import pytest
import scipy.optimize
import scipy.stats
import xarray as xr

from experiments import _output
from experiments._experiment import Context, chosen
from experiments.statistics import _machine, _many, corexy_machines, coverage

VALUES = {"belt_speed": 0.2, "kinetic_force": 0.5, "static_force": 0.8, "stiffness": 1.3}
calls = []


def squares(parameters, number):
    """Stands for a case; a module's own function, as `many` wants it."""
    calls.append(number)
    return {"square": parameters["power"] * number**2, "pair": np.array([number, -number])}


def closed_form(values, times):
    """Position of the block: uniform in stick, harmonic about F_k/k in slip, period after period."""
    v, k = values["belt_speed"], values["stiffness"]
    omega = np.sqrt(k / coverage.MASS)
    give = (values["static_force"] - values["kinetic_force"]) / k
    middle, top = values["kinetic_force"] / k, values["static_force"] / k
    slip = 2.0 * (np.pi - np.arctan(give * omega / v)) / omega
    stick = 2.0 * give / v
    first = top / v
    since = np.mod(times - first, slip + stick)
    swing = middle + give * np.cos(omega * since) + v / omega * np.sin(omega * since)
    held = middle - give + v * (since - slip)
    return np.where(times < first, v * times, np.where(since < slip, swing, held))


def test_a_record_is_that_of_the_closed_form():
    times = np.linspace(0.0, coverage.duration_of(VALUES), coverage.SAMPLES + 1)[1:]
    values = {name: np.float64(value) for name, value in VALUES.items()}
    found = np.asarray(coverage._clean(values, times))
    np.testing.assert_allclose(found, closed_form(VALUES, times), rtol=0, atol=1e-7)
    # The sixth period ends where the first slip begins.
    assert found[-1] == pytest.approx(VALUES["static_force"] / VALUES["stiffness"], abs=1e-6)


def test_cases_are_kept_and_more_of_them_cost_only_what_is_new(tmp_path):
    calls.clear()

    def run(fresh=False, **changed):
        parameters = {"count": 5, "power": 2.0, "workers": 1} | changed
        return _many.many("squares", squares, parameters, Context(tmp_path, fresh=fresh), 2)

    found = run()
    assert calls == [0, 1, 2, 3, 4]
    np.testing.assert_array_equal(found["square"], 2.0 * np.arange(5) ** 2)
    np.testing.assert_array_equal(found["pair"], [[n, -n] for n in range(5)])
    np.testing.assert_array_equal(run(count=8)["square"], 2.0 * np.arange(8) ** 2)
    assert calls[5:] == [4, 5, 6, 7]  # the last block was not a whole one
    run(count=8)
    assert len(calls) == 9
    assert run(power=3.0)["square"][2] == 12.0
    assert len(calls) == 14
    run(fresh=True)
    assert len(calls) == 19


def test_rows_of_another_engine_are_made_anew(tmp_path, monkeypatch):
    parameters = {"count": 2, "power": 1.0, "workers": 1}
    stores = []
    for version in ("before", "after"):
        monkeypatch.setattr(_many, "_sources", lambda version=version: version)
        _many.many("squares", squares, parameters, Context(tmp_path), 2)
        stores.append(len(list(tmp_path.glob("squares/*"))))
    assert stores == [1, 2]


def test_a_torn_file_is_made_anew(tmp_path):
    calls.clear()
    parameters = {"count": 2, "power": 1.0, "workers": 1}
    _many.many("squares", squares, parameters, Context(tmp_path), 2)
    (kept,) = tmp_path.rglob("*.npz")
    kept.write_bytes(kept.read_bytes()[:40])
    found = _many.many("squares", squares, parameters, Context(tmp_path), 2)
    assert calls == [0, 1, 0, 1]
    np.testing.assert_array_equal(found["square"], [0.0, 1.0])


@pytest.mark.slow
def test_processes_have_no_say(tmp_path):
    parameters = {"count": 5, "power": 2.0, "workers": 2}
    found = _many.many("squares", squares, parameters, Context(tmp_path), 2)
    np.testing.assert_array_equal(found["square"], 2.0 * np.arange(5) ** 2)


def made_up(count, shrunk=1.0):
    """Normal estimates with intervals, which are right unless they are shrunk."""
    rng = np.random.default_rng(0)
    truth = rng.uniform(1.0, 2.0, (count, 4))
    off = 0.01 * rng.standard_normal((count, 4))
    half = shrunk * 0.01 * scipy.stats.norm.ppf(0.975)
    both = ("record", "unknown")
    return xr.Dataset(
        {
            "truth": (both, truth), "estimate": (both, truth + off),
            "lower": (both, truth + off - half), "upper": (both, truth + off + half),
            "wald_lower": (both, truth + off - half), "wald_upper": (both, truth + off + half),
            "verdict": (both, np.zeros((count, 4), int)),
            "successful": ("record", np.ones(count, bool)), "fall": ("record", np.zeros(count)),
            "starts": ("record", np.ones(count, int)),
            "excess": ("record", shrunk * np.sum((off / 0.01) ** 2, axis=1)),
        },
        {"unknown": list(coverage.NAMES)},
    )  # fmt: skip


@pytest.mark.parametrize(("shrunk", "holds"), [(1.0, True), (0.8, False), (1.3, False)])
def test_statements_know_intervals_that_are_too_short_or_too_long(shrunk, holds):
    found = {s.id: s for s in coverage.judge(made_up(1000, shrunk))}
    assert [found[f"Y1.{k}"].holds for k in (3, 4, 5)] == [holds] * 3
    assert found["Y1.1"].holds
    assert found["Y1.2"].holds


def test_few_records_say_nothing_of_coverage():
    found = {s.id: s.holds for s in coverage.judge(made_up(20))}
    assert [found[f"Y1.{k}"] for k in (3, 4, 5)] == [None] * 3


def machines():
    """Four machines: found, off by five errors, not at the noise, with an unknown not seen."""
    truth = np.ones((4, 6))
    estimate, error, verdict = truth + 0.02, np.full((4, 6), 0.02), np.zeros((4, 6), int)
    estimate[1, 2] = 1.1
    estimate[3, 0], error[3, 0], verdict[3, 0] = 7.0, 0.5, 1
    both = ("machine", "unknown")
    half = 1.96 * error
    return xr.Dataset(
        {
            "truth": (both, truth), "estimate": (both, estimate), "error": (both, error),
            "verdict": (both, verdict), "least": ("machine", [1.0, 1.0, 9.0, 1.0]),
            "limit": ("machine", np.full(4, 2.0)), "starts": ("machine", np.ones(4, int)),
            "of_start": (("machine", "try"), np.ones((4, 2))),
            "lower": (both, estimate - half), "upper": (both, estimate + half),
            "wald_lower": (both, estimate - half), "wald_upper": (both, estimate + half),
        },
        {"unknown": list(_machine.NAMES)},
    )  # fmt: skip


def test_a_machine_is_recovered_where_all_that_can_be_seen_is_near():
    found = corexy_machines.judged(machines())
    assert found.recovered.values.tolist() == [True, False, False, True]
    assert found.identifiable.sum() == 23
    told = {s.id: s.measured for s in corexy_machines.judge(machines())}
    assert told["Y2.1"].startswith("2 of 4; 3 come down to the noise")
    assert "95.7% of 23" in told["Y2.3"]


def test_the_belts_hold_in_the_gentle_record_and_slip_in_the_rough_one():
    known = _machine.drawn(np.random.default_rng(3))
    gentle, rough = _machine.candidates(np.random.default_rng(4), known, 16)
    for motor in (0, 1):
        # Torque [N m] that the belt holds at the tension that is true.
        held = known[f"mu_{motor + 1}s_b"] * known[f"P{motor + 1}"] * known["r"]
        torque = np.abs(known["K_t"] * rough[..., motor] / known["R"])
        assert torque.max() > 1.5 * held
        # Every piece is one or the other at both of its ends, but the first, which begins at zero.
        low, high = torque[:, 1:] < held, torque[:, 1:] > 1.5 * held
        assert ((low | high) & (low == low[:, :, :1])).all()
        assert np.abs(known["K_t"] * gentle[..., motor] / known["R"]).max() < held


@pytest.mark.slow
def test_the_end_of_an_interval_is_where_scipy_finds_the_rise():
    truth, times, data, sigma, rng = coverage.record(5, 3)
    start = {name: value * np.exp(0.05 * rng.uniform(-1, 1)) for name, value in truth.items()}
    fit = coverage._fit(start, data, times, np.float64(sigma))
    found = coverage._profile(fit, data, times, np.float64(sigma))

    def rows(values):
        return (closed_form(values, times) - data) / sigma

    def least(fixed):
        """Sum of squares by SciPy on the closed form, with some unknowns fixed."""
        free = [name for name in coverage.NAMES if name not in fixed]
        first = [float(fit.values[name]) for name in free]
        run = scipy.optimize.least_squares(
            lambda x: rows(fixed | dict(zip(free, x, strict=True))), first, x_scale=first,
            xtol=1e-12, ftol=1e-12, gtol=1e-12,
        )  # fmt: skip
        return 2.0 * run.cost

    lowest = least({})
    for name in coverage.NAMES:
        for end in (float(found.lower[name]), float(found.upper[name])):
            assert least({name: end}) - lowest == pytest.approx(scipy.stats.chi2.ppf(0.95, 1), rel=1e-3)


@pytest.mark.slow
def test_a_slice_of_the_records(tmp_path):
    """Seed and number of records were chosen without a look at them."""
    parameters = chosen(coverage.EXPERIMENT, False, ["count=60", "seed=1"])
    data = coverage.compute(parameters, Context(tmp_path))
    held = coverage.coverage(data)
    least = scipy.stats.binom.ppf(1e-4, 240, 0.95) / 240
    assert float(held.profile.mean()) > least
    assert bool(data.successful.all())
    # As a sum of squares it has a mean of 4 and a deviation of the mean of sqrt(8/60).
    assert float(data.excess.mean()) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / 60.0))


@pytest.mark.slow
def test_a_machine_is_found_from_afar(tmp_path):
    # As users run it: its arrays broadcast over records and signals.
    with jax.numpy_rank_promotion("allow"):
        files = _output.run(
            corexy_machines.EXPERIMENT, tmp_path,
            changes=["count=1", "starts=16", "tries=6", "seed=3"],
        )  # fmt: skip
    with xr.open_dataset(files[0], engine="h5netcdf") as data:
        found = corexy_machines.judged(data.load())
        assert bool(found.at_noise.all())
        assert bool(found.recovered.all())
        assert float(data.least[0]) <= float(data.at_truth[0])
