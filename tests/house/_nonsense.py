"""Nonsense for every argument of every public callable; prints what is not refused properly.

Run as a program, so that the annotations checked in the other tests do not catch the nonsense first.
What lies behind the checks is replaced by `Reached`: a value that is allowed costs nothing.

    python -m tests.house._nonsense [SHARE] [FILE]

feeds one in SHARE of the kinds of nonsense to each argument, chosen by name, all if it is 1, and writes
what it found and counted to FILE as JSON.
"""

import collections
import json
import os
import pathlib
import re
import sys
import tempfile
import time
import traceback
import warnings
import zlib
from typing import Any

os.environ["STICKSLIP_EXECUTOR"] = "portable"

import jax

import corexy_jax
import stickslip
from corexy_jax import _feedforward as machine_feedforward
from corexy_jax import _feedforward_along as machine_along
from corexy_jax import _outputs as machine_outputs
from corexy_jax import _simulate as machine
from corexy_jax.elastic import _expected_errors as expected_errors
from corexy_jax.elastic import _fit_belts as fit_belts
from stickslip import _compilation_cache
from stickslip.analysis import _attractor, _volume
from stickslip.basin import _border, _border_shares, _judged
from stickslip.contact import _dead_zone, _zonotope
from stickslip.continuation import _continue
from stickslip.control import _hunting
from stickslip.estimation import _kalman_filter, _smooth
from stickslip.friction import _contract
from stickslip.hybrid import _interpolate, _saltation, _simulate
from stickslip.identification import (
    _input_design,
    _many_starts,
    _methods,
    _posterior,
    _problem,
    _profile,
    _report,
    _sensitivity,
)
from stickslip.plot import _axes, _movie
from stickslip.sweep import evaluate
from tests.house import (
    _nonsense_analyses,
    _nonsense_basin,
    _nonsense_continuation,
    _nonsense_control,
    _nonsense_elastic,
    _nonsense_engine,
    _nonsense_estimation,
    _nonsense_identification,
    _nonsense_laws,
    _nonsense_machine,
    _nonsense_methods,
    _nonsense_plot,
    _nonsense_report,
    _nonsense_structure,
)  # fmt: skip
from tests.house._nonsense_kinds import BY_EQUINOX, allowed, kinds
from tests.house._nonsense_public import arguments_of, public_callables, public_methods
from tests.house._nonsense_target import Reached, Target, reached

TARGETS: list[Target] = [
    *_nonsense_laws.TARGETS,
    *_nonsense_engine.TARGETS,
    *_nonsense_analyses.TARGETS,
    *_nonsense_continuation.TARGETS,
    *_nonsense_identification.TARGETS,
    *_nonsense_machine.TARGETS,
    *_nonsense_report.TARGETS,
    *_nonsense_plot.TARGETS,
    *_nonsense_methods.TARGETS,
    *_nonsense_structure.TARGETS,
    *_nonsense_control.TARGETS,
    *_nonsense_estimation.TARGETS,
    *_nonsense_basin.TARGETS,
    *_nonsense_elastic.TARGETS,
]
OURS = tuple(str(pathlib.Path(m.__file__).parent) + os.sep for m in (stickslip, corexy_jax))
LIMIT = 2.0  # s of the processor, so that a busy machine does not count
COMPILING = "/jax/core/compile/backend_compile_duration"
BEHIND = (
    (_simulate, "core"),
    (_continue, "begin"),
    (_hunting, "map_lanes"),
    (_judged.Judged, "follow"),
    (_border, "Judged"),
    (_border_shares, "Judged"),
    (_border_shares, "simulate"),
    (evaluate.Evaluate, "program"),
    (_compilation_cache, "_here"),
    (_methods.AbstractIterativeMethod, "solve"),
    (_many_starts, "many_fits"),
    (_many_starts, "evaluator"),
    (_input_design, "evaluator"),
    (_sensitivity, "evaluation"),
    (_posterior, "with_operands"),
    (_profile, "with_operands"),
    (_report, "page"),
    (_problem, "residual_of"),
    (_problem, "motion_of"),
    (_problem, "solve_run"),
    (_problem, "many_fits"),
    (_saltation, "ravel_pytree"),
    (_volume, "ravel_pytree"),
    (_interpolate, "as_stepper"),
    (_attractor, "_away_from_last_round"),
    (_contract, "_form"),
    (_dead_zone, "_project"),
    (_zonotope, "_vertices"),
    (_axes, "canvas"),
    (_kalman_filter, "_compiled"),
    (_smooth, "_compiled"),
    (_movie.Movie, "_animation"),
    (machine, "march"),
    (expected_errors, "_slopes"),
    (fit_belts, "_nearest"),
    (machine_feedforward, "_plan"),
    (machine_along, "cut"),
    (machine_outputs, "_columns"),
)


class Compilations:
    """Counts them."""

    def __init__(self):
        self.count = 0
        jax.monitoring.register_event_duration_secs_listener(self)

    def __call__(self, event: str, *_: Any, **__: Any) -> None:
        self.count += event == COMPILING


COMPILATIONS = Compilations()


def says_it(text: str, target: Target, name: str) -> bool:
    """Whether a message begins with the argument, its value, and says what is allowed.

    Of two arguments that do not go together, either may come first.
    """
    form = r"(?s)(\w+\.)?({})\b[^=]* = .*: it must be .+\.\Z"
    if re.match(form.format(name), text):
        return True
    other = re.match(form.format("|".join(target.arguments)), text)
    return bool(other and re.search(rf"\b{name}\b", text))


def outcome(target: Target, name: str, kind: str, value: Any) -> tuple[str, str]:
    """What became of the call, in one word, and what is wrong about it."""
    begin, compiled = time.process_time(), COMPILATIONS.count
    try:
        target({name: value})
        result = "accepted"
    except Reached:
        result = "accepted"
    except (ValueError, TypeError) as error:
        text = str(error)
        inner = traceback.extract_tb(error.__traceback__)[-1].filename
        if not inner.startswith(OURS):
            frames = traceback.extract_tb(error.__traceback__)
            if kind in BY_EQUINOX and any("equinox" in frame.filename for frame in frames):
                return "refused", ""
            return "unclear", f"raised in {inner}: {type(error).__name__}: {text[:200]}"
        if not says_it(text, target, name):
            return "unclear", f"{type(error).__name__}: {text[:200]}"
        if COMPILATIONS.count > compiled:
            return "unclear", f"after {COMPILATIONS.count - compiled} compilations: {text[:200]}"
        result = "refused"
    except Exception as error:
        inner = traceback.extract_tb(error.__traceback__)[-1]
        text = f"{type(error).__name__} in {inner.filename}:{inner.lineno}: {str(error)[:200]}"
        return "unclear", text
    took = time.process_time() - begin
    if took > LIMIT:
        return "slow", f"{result} after {took:.1f} s"
    if result == "accepted" and kind not in allowed(target.arguments[name].takes):
        return "accepted", "accepted, and not in the table of what may be"
    return ("refused" if result == "refused" else "right"), ""


def missing() -> list[str]:
    """Public callables without a template, and arguments that no template of theirs gives."""
    given: dict[str, set[str]] = {}
    for target in TARGETS:
        given.setdefault(target.name, set()).update(target.arguments)
    lost = []
    for name, thing in {**public_callables(), **public_methods()}.items():
        # A method that a class inherits has the name of the class that defines it.
        known = given.get(name, given.get(getattr(thing, "__qualname__", name)))
        lost += [name] if known is None else [
            f"{name}({argument})" for argument in sorted(arguments_of(name, thing) - known)
        ]  # fmt: skip
    return lost


def chosen(target: Target, name: str, share: int) -> list[str]:
    """Names of the nonsense fed to an argument: other ones to each, the same each time."""
    first = zlib.crc32(f"{target.name} {name}".encode())
    return [kind for i, kind in enumerate(kinds()) if (first + i) % share == 0]


def first_of_each(targets: list[Target]) -> list[Target]:
    """Without a method that objects of several classes inherit, but for the first of them."""
    methods, seen = set(map(id, _nonsense_methods.TARGETS)), set()
    fresh = []
    for target in targets:
        if id(target) not in methods or target.name not in seen:
            fresh.append(target)
        seen.add(target.name)
    return fresh


def main(share: int) -> dict[str, Any]:
    """Complaints and counts."""
    for place, name in BEHIND:
        assert hasattr(place, name), (place, name)
        setattr(place, name, reached)
    methods = {target.name for target in _nonsense_methods.TARGETS}
    counts = collections.Counter(
        callables=len({target.name for target in TARGETS} - methods), methods=len(methods)
    )
    complaints = []
    for target in TARGETS if share == 1 else first_of_each(TARGETS):
        if target.of is corexy_jax.simulate:
            # Its engine has been asked often enough, and the initial mode of the machine takes long.
            _simulate.the_start = reached
        try:
            target({})
        except Reached:
            pass
        except Exception as error:
            complaints.append([target.name, "", "", "good", f"{type(error).__name__}: {error}"[:300]])
            continue
        for name in target.arguments:
            counts["arguments"] += 1
            fresh = kinds()
            for kind in chosen(target, name, share):
                counts["calls"] += 1
                word, text = outcome(target, name, kind, fresh[kind])
                counts[word] += 1
                if text:
                    complaints.append([target.name, name, kind, word, text])
    return {
        "counts": counts,
        "complaints": complaints,
        "cpu_s": time.process_time(),
    }


if __name__ == "__main__":
    out = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
    with warnings.catch_warnings(), tempfile.TemporaryDirectory() as place:
        warnings.simplefilter("ignore")
        os.chdir(place)  # where files of nonsensical names come
        found = main(int(sys.argv[1]) if len(sys.argv) > 1 else 1)
        os.chdir("/")
    for target, name, kind, word, text in found["complaints"]:
        print(f"{target}({name}={kind}): {word}: {text}")
    print(json.dumps({k: v for k, v in found.items() if k != "complaints"}))
    if out is not None:
        out.write_text(json.dumps(found, indent=1))
