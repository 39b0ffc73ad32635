"""Attack on one structure: runs beside the reference, and beside itself said otherwise."""

import warnings
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

import stickslip as ss

from ._draw import numbers
from ._instants import Unsure
from ._reference import March
from ._structure import Numbers, Outcome, Program, Structure
from ._transformations import OF_STRUCTURES, units

RIGHT, FLAGGED, REFUSED = "right", "flagged and right", "refused by name"
LOUD, WRONG, FLAGGED_WRONG = "loud failure", "SILENTLY WRONG", "flagged, differs"
UNDECIDED, CRASH = "undecided", "crash"
CLASSES = (RIGHT, FLAGGED, REFUSED, LOUD, UNDECIDED, FLAGGED_WRONG, CRASH, WRONG)
TOLERANCE, TIMES, NUMBERS = 1e-6, 9, 5
AGAIN = 0.4  # chance to leave out what is compiled a second time, which costs as much as all the rest
SLOPES = 1e-4  # of derivatives beside differences
PATIENT = 20.0  # times what a change of 1e-9 in the start makes of the reference's motion


class Finding(NamedTuple):
    """What came of one comparison: its class, its name, words and the numbers it is of."""

    verdict: str
    check: str
    words: str = ""
    numbers: Numbers | None = None


class Truth(NamedTuple):
    y: np.ndarray
    end: float
    spread: Callable[[], float]


def truth_of(structure: Structure, n: Numbers) -> Truth:
    """The reference's motion; how far it is spread by rounding, computed when it is asked for."""
    ts = np.linspace(0.0, n.end, TIMES)
    y, end = March(structure, n).run(ts)

    def spread() -> float:
        most = 0.0
        for sign in (1, -1):
            start = {c: x + 1e-9 * sign * (1 + abs(x)) for c, x in n.start.items()}
            try:
                other, stop = March(structure, n._replace(start=start), 1e-10, 131).run(ts)
            except Unsure:
                return np.inf
            if abs(stop - end) > 1e-6 * n.end:
                return np.inf
            most = max(most, _distance(other, y))
        return most

    return Truth(y, end, spread)


def _scales(y: np.ndarray) -> np.ndarray:
    most = np.nanmax(np.abs(y), axis=0)
    return most + 1e-2 * np.max(most) + 1e-300


def _distance(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference beside the size of each component; infinite where one of them ends early."""
    if (np.isnan(a) != np.isnan(b)).any():
        return np.inf
    return float(np.nanmax(np.abs(a - b) / _scales(b)))


def beside_truth(got: Outcome, truth: Truth, n: Numbers) -> tuple[str, str]:
    """Class of a run, and words."""
    flagged = got.flags != 0
    done = ~np.isnan(got.y).any(1)
    if not got.result:
        if truth.end < n.end * (1 - 1e-9):
            error, what = np.inf, f"the motion ends at {truth.end:.9g} s by its declaration"
        else:
            error, what = _distance(got.y, truth.y), "states differ"
    elif truth.end < n.end * (1 - 1e-9) and abs(truth.end - got.t1) < 1e-6 * n.end:
        rows = done & ~np.isnan(truth.y).any(1)
        error, what = _distance(got.y[rows], truth.y[rows]), "states before the end differ"
    else:
        rows = done & ~np.isnan(truth.y).any(1)
        far = _distance(got.y[rows], truth.y[rows]) if rows.any() else 0.0
        return LOUD, f"{got.result.split('.')[0][:60]} at {got.t1:.9g} s, differs {far:.1e} before"
    if error <= TOLERANCE:
        return (FLAGGED if flagged else RIGHT), ""
    spread = truth.spread()
    if error <= TOLERANCE + PATIENT * spread or spread > 1e-3:
        return UNDECIDED, f"{what}: {error:.1e}, but rounding alone makes {spread:.1e}"
    words = f"{what}: {error:.2e} of their size (rounding: {spread:.1e}), flags {got.flags}"
    return (FLAGGED_WRONG if flagged else WRONG), words


def refusal_of(error: Exception, check: str, n: Numbers) -> Finding:
    kind = type(error)
    named = isinstance(error, ValueError | TypeError) and kind.__module__.split(".")[0] != "jax"
    inside = "stickslip" in str(kind.__module__) or "must be" in str(error) or "it " in str(error)
    text = f"{kind.__name__}: {str(error).splitlines()[0][:200] if str(error) else ''}"
    return Finding(REFUSED if named and inside else CRASH, check, text, n)


def attacked(
    structure: Structure, rng: np.random.Generator, thorough: bool = True
) -> Iterator[Finding]:
    """All comparisons of one structure; they stop at a refusal."""
    program, runs = None, []
    for _ in range(NUMBERS):
        n = numbers(structure, rng)
        try:
            truth: Truth | None = truth_of(structure, n)
        except Unsure as why:
            truth = None
            words = str(why)
        try:
            program = program or Program(structure)
            got = program.run(n, np.linspace(0.0, n.end, TIMES))
        except Exception as error:
            yield refusal_of(error, "reference", n)
            return
        if truth is None:
            yield Finding(UNDECIDED, "reference", words, n)
        else:
            verdict, words = beside_truth(got, truth, n)
            yield Finding(verdict, "reference", words, n)
            if verdict in (RIGHT, FLAGGED) and not got.result:
                runs.append((n, got, truth))
    if runs and program is not None and thorough:
        yield from transformed(structure, program, runs, rng)


def transformed(structure, program, runs, rng) -> Iterator[Finding]:
    """Runs that are right, said otherwise."""
    for n, got, truth in runs[:3]:
        ts = np.linspace(0.0, n.end, TIMES)
        for name in ("units", "split", "tolerance"):
            found = _beside(name, CHECKS[name], structure, program, n, got, truth, ts, rng)
            if found is not None:
                yield found
    names = [*OF_STRUCTURES, "batch", "method", "derivative", "default"]
    if rng.random() < AGAIN:
        return
    for name in rng.permutation(names):
        if name == "derivative":
            found = _derivative(structure, program, runs, rng)
        else:
            n, got, truth = runs[int(rng.integers(len(runs)))]
            ts = np.linspace(0.0, n.end, TIMES)
            found = _beside(str(name), CHECKS[name], structure, program, n, got, truth, ts, rng)
        if found is not None:
            yield found
            return


def _beside(name, check, structure, program, n, got, truth, ts, rng) -> Any:
    try:
        other = check(structure, program, n, ts, rng)
    except Exception as error:
        return refusal_of(error, name, n)
    if other is None:
        return None
    y, flags, result = other
    if result:
        return Finding(LOUD, name, result[:60], n)
    rows = slice(None) if len(y) == len(got.y) else slice(-1, None)
    scales = _scales(truth.y)
    error = float(np.max(np.abs(y[rows] - got.y[rows]) / scales))
    flagged = bool(flags or got.flags)
    if error <= TOLERANCE * (10 if name == "tolerance" else 1):
        return Finding(FLAGGED if flagged else RIGHT, name, "", n)
    spread = truth.spread()
    if error <= TOLERANCE + PATIENT * spread or spread > 1e-3:
        return Finding(UNDECIDED, name, f"{error:.1e}, rounding alone makes {spread:.1e}", n)
    words = f"differs by {error:.2e} (rounding: {spread:.1e}), flags {got.flags} and {flags}"
    return Finding(FLAGGED_WRONG if flagged else WRONG, name, words, n)


def _units(structure, program, n, ts, rng):
    other = units(structure, n, rng)
    if other is None:
        return None
    _, m, back = other
    got = program.run(m, ts * (m.end / n.end))
    return _named(structure, structure, got, back, ts), got.flags, got.result


def _named(structure, other, got, back, ts):
    states = back(ts, dict(zip(other.components, got.y.T, strict=True)))
    return np.stack([states[c] for c in structure.components], -1)


def _split(structure, program, n, ts, rng):
    middle = float(rng.uniform(0.2, 0.8)) * n.end
    one = program.solution(n, np.linspace(0.0, middle, TIMES))
    if not bool(one.successful):
        return np.zeros(0), 0, str(one.result) or "the first half ends early"
    two = program.run(n, np.linspace(middle, n.end, TIMES), begin=one.y1)
    return two.y[-1:], two.flags | int(one.flags), two.result


def _tolerance(structure, program, n, ts, rng):
    step = ss.AdaptiveStep(float(rng.choice([1e-8, 1e-12])))
    got = program.run(n, ts, integrator=ss.Integrator(step=step))
    return got.y, got.flags, got.result


def _method(structure, program, n, ts, rng):
    got = program.run(n, ts, integrator=ss.Integrator("tsit5", ss.AdaptiveStep(1e-9)))
    return got.y, got.flags, got.result


def _batch(structure, program, n, ts, rng):
    """Beside lanes of other numbers in one program."""
    lanes = [n, *(numbers(structure, rng) for _ in range(3))]
    values = {k: jnp.array([m.values[k] for m in lanes]) for k in structure.parameters}
    start = {k: jnp.array([m.start[k] for m in lanes]) for k in structure.components}
    grid = jnp.array([np.linspace(0.0, m.end, TIMES) for m in lanes])

    def run(values, start, ts):
        return program.solution(Numbers(values, start, 0.0), ts)

    found = jax.jit(jax.vmap(run))(values, start, grid)
    got = program.outcome(jax.tree.map(lambda a: a[0], found))
    return got.y, got.flags, got.result


def _default(structure, program, n, ts, rng):
    """`args` left out, beside `args` that are their defaults."""
    kinds = {p.where for p in structure.parameters.values()}
    if "default" not in kinds or "args" in kinds:
        return None
    defaults = {k: p.default for k, p in structure.parameters.items() if p.where == "default"}
    m = n._replace(values={**n.values, **defaults})
    y, _ = March(structure, m).run(ts)
    got = program.run(m, ts, bare=True)
    given = program.run(n, ts)
    return given.y + (got.y - y), got.flags, got.result


def _other(name):
    def check(structure, program, n, ts, rng):
        other = OF_STRUCTURES[name](structure, n, rng)
        if other is None:
            return None
        s, m, back = other
        got = Program(s).run(m, ts)
        return _named(structure, s, got, back, ts), got.flags, got.result

    return check


def _derivative(structure, program, runs, rng):
    """Along a random direction in all parameters and the start, beside differences."""
    names, kept = list(structure.parameters), structure.components

    def end(x, n):
        values = dict(zip(names, x[: len(names)], strict=True))
        start = dict(zip(kept, x[len(names) :], strict=True))
        found = program.solution(Numbers(values, start, n.end), jnp.linspace(0.0, n.end, TIMES))
        y = program.bare(found.y1)
        return jnp.stack([getattr(y, c) for c in kept]), (found.flags, found.sequence, found.successful)

    for n, got, _ in runs:
        x = np.array([*(n.values[k] for k in names), *(n.start[c] for c in kept)])
        # What is at a border of what is allowed stays there.
        away = rng.normal(size=x.size) * np.where(x == 1.0, 0.0, np.abs(x))
        if got.flags or not away.any():
            continue
        sides = [end(jnp.asarray(x + h * away), n) for h in (1e-6, -1e-6, 1e-5, -1e-5)]
        same = len({(int(s), int(f)) for _, (f, s, _) in sides} | {(got.sequence, 0)}) == 1
        if not same or not all(bool(fine) for *_, (_, _, fine) in sides):
            continue
        (a, _), (b, _), (c, _), (d, _) = sides
        coarse, fine = np.asarray(c - d) / 2e-5, np.asarray(a - b) / 2e-6
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                slope = jax.jvp(lambda x, n=n: end(x, n)[0], (jnp.asarray(x),), (jnp.asarray(away),))[1]
        except Exception as error:
            return refusal_of(error, "derivative", n)
        size = np.abs(coarse).max() + 1e-6
        doubt = np.abs(coarse - fine).max() / size
        ways = [coarse]
        if len({*n.values.values()}) < len(n.values):
            # Equal parameters may be a bend, as of the greater of two: the slope is that of one side.
            here = np.asarray(end(jnp.asarray(x), n)[0])
            ways += [np.asarray(a - here) / 1e-6, np.asarray(here - b) / 1e-6]
        error = float(min(np.abs(np.asarray(slope) - way).max() for way in ways) / size)
        if error <= SLOPES:
            return Finding(RIGHT, "derivative", "", n)
        verdict = UNDECIDED if error <= 10 * doubt + SLOPES else WRONG
        return Finding(verdict, "derivative", f"off by {error:.1e}, differences by {doubt:.1e}", n)
    return None


def again(structure: Structure, n: Numbers, check: str) -> Finding:
    """One comparison by its name, of these numbers, as the shrinking asks it."""
    rng, ts = np.random.default_rng(0), np.linspace(0.0, n.end, TIMES)
    truth = truth_of(structure, n)
    program = Program(structure)
    got = program.run(n, ts)
    verdict, words = beside_truth(got, truth, n)
    if check == "reference" or verdict not in (RIGHT, FLAGGED):
        return Finding(verdict if check == "reference" else UNDECIDED, check, words, n)
    if check == "derivative":
        found = _derivative(structure, program, [(n, got, truth)], rng)
    else:
        found = _beside(check, CHECKS[check], structure, program, n, got, truth, ts, rng)
    return found or Finding(UNDECIDED, check, "", n)


CHECKS = {
    "units": _units, "split": _split, "tolerance": _tolerance, "batch": _batch, "method": _method,
    "default": _default, **{name: _other(name) for name in OF_STRUCTURES},
}  # fmt: skip
