"""What is fed to every argument, and what of it an argument may take: the one table of exceptions."""

import datetime
import decimal
import fractions
import math
import pathlib
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


class Table:
    """What looks like a table of pandas: NumPy makes an array of it."""

    columns = ("a", "b")
    shape = (2, 2)
    dtypes = (float, float)

    def __array__(self, dtype=None, copy=None):
        return np.ones(self.shape, dtype)


def kinds() -> dict[str, Any]:
    """Nonsense by name, new each time."""
    return {
        "None": None,
        "''": "",
        "'abc'": "abc",
        "b'x'": b"x",
        "object": object(),
        "lambda": lambda *a, **k: 0,
        "class": Table,
        "built-in class": dict,
        "True": True,
        "numpy True": np.True_,
        "nan": math.nan,
        "inf": math.inf,
        "-inf": -math.inf,
        "-1": -1,
        "0": 0,
        "1e300": 1e300,
        "10**30": 10**30,
        "10**5000": 10**5000,
        "1j": 1j,
        "[]": [],
        "()": (),
        "{}": {},
        "{'a': 1}": {"a": 1},
        "{0: 1, 'a': 1}": {0: 1, "a": 1},
        "{1}": {1},
        "[None]": [None],
        "['abc']": ["abc"],
        "[1.0, 2.0]": [1.0, 2.0],
        "[nan]": [math.nan],
        "ragged": [[1.0], [1.0, 2.0]],
        "table": Table(),
        "masked": np.ma.masked_array([1.0, 2.0], [False, True]),
        "no rows": np.zeros(0),
        "3 x 2": np.ones((3, 2)),
        "texts": np.array(["a", "b"]),
        "objects": np.array([object(), None]),
        "complex array": np.ones(2, complex),
        "booleans": np.array([True, False]),
        "nans": jnp.array([1.0, jnp.nan]),
        "dates": np.array(["2020-01-01"], "M8[D]"),
        "float32": np.float32(0.5),
        "float32 array": np.full(2, 0.5, np.float32),
        "float32 of JAX": jnp.full((), 0.5, jnp.float32),
        "key": jax.random.key(0),
        "datetime": datetime.datetime(2020, 1, 1),
        "Decimal": decimal.Decimal(1),
        "Fraction": fractions.Fraction(1, 2),
        "generator": (x for x in (1.0,)),
        "range": range(3),
        "slice": slice(3),
        "...": ...,
        "module": math,
        "path": pathlib.Path("x"),
    }


EVERYTHING = frozenset(kinds())
FINITE = frozenset({"-1", "0", "1e300"})
ARRAYS = frozenset({"[1.0, 2.0]", "3 x 2", "float32 array"})
FLOAT32 = frozenset({"float32", "float32 of JAX"})
TREES = frozenset({"None", "[None]", "()", "[]", "{}", "{'a': 1}", "ragged"})
UNTRACEABLE = frozenset({"{0: 1, 'a': 1}", "{1}", "masked", "texts", "objects", "dates"})

# Equinox sorts the keys of what a module without a constructor of its own is given, before any check of
# ours; JAX's error names the keys that have no order.
BY_EQUINOX = frozenset({"{0: 1, 'a': 1}"})

# What an argument may take, by what it is, and why it is right: everything else must be refused.
TAKEN: dict[str, tuple[frozenset[str], str]] = {
    "none": (frozenset({"None"}), "the argument may be left out, and None says so"),
    "finite": (FINITE, "any finite real number"),
    "not negative": (FINITE - {"-1"}, "finite numbers from 0 on"),
    "positive": (frozenset({"1e300"}), "finite numbers above 0"),
    "infinite": (frozenset({"inf"}), "infinity means no bound"),
    "zero": (frozenset({"0"}), "the end of the interval belongs to it"),
    "float32": (
        FLOAT32,
        "a parameter in float32 has a value, which float64 holds exactly; only states and times, whose "
        "digits were computed, must not have lost them",
    ),
    "tolerances": (
        frozenset({"{}", "{'a': 1}", "ragged"}),
        "tolerances by names of components, or in a pytree; the state that says which is not known yet",
    ),
    "batch": (
        ARRAYS,
        "parameters may be arrays, to be mapped over; their shapes meet when they are used",
    ),
    "row": (ARRAYS - {"3 x 2"}, "a row of numbers, in float32 too, as above"),
    "residuals": (
        frozenset({"[1.0, 2.0]", "float32 array", "nans"}),
        "a row of two residuals, NaN where a run failed",
    ),
    "table": (frozenset({"3 x 2"}), "three rows of two numbers"),
    "circles": (frozenset({"[1.0, 2.0]"}), "a period for each of two observables"),
    "nan row": (frozenset({"nans"}), "a row of numbers; what is not finite tells nothing"),
    "times": (frozenset({"[1.0, 2.0]"}), "a row of times"),
    "no times": (frozenset({"[]", "()", "no rows"}), "no output times"),
    "mask": (frozenset({"booleans"}), "one boolean for each of the two contacts"),
    "count": (frozenset({"0"}), "counts from 0 on"),
    "whole": (frozenset({"0"}), "number of a mode, a guard or the like, which begins with 0"),
    "turn": (frozenset({"-1"}), "an angle to the left or to the right"),
    "axis": (frozenset({"-1", "0"}), "number of an axis or an orbit; below 0 from the last one"),
    "any whole": (frozenset({"-1"}), "as documented: below 0 the first function is taken"),
    "reals": (
        FINITE | ARRAYS | FLOAT32
        | {"nan", "inf", "-inf", "[nan]", "nans", "[]", "()", "no rows"},
        "a number or an array of them, of any value: logs have NaN in rows that were never reached",
    ),
    "real": (
        FINITE | FLOAT32 | {"nan", "inf", "-inf"}, "one number of any value, since logs have NaN"
    ),
    "senses": (
        frozenset({"-1", "0", "nan", "[nan]", "nans", "3 x 2", "[]", "()", "no rows"}),
        "+1 or -1, 0 at rest, and NaN where the motion is NaN",
    ),
    "modes": (frozenset({"-1", "0"}), "number of a mode or guard; -1 in rows never reached"),
    "pieces": (
        (FINITE | ARRAYS | {"nan", "inf", "-inf", "[nan]", "nans", "[]", "()", "no rows"})
        - {"float32 array"},
        "whole numbers, and what a voltage makes of times that are no numbers",
    ),
    "no state": (frozenset({"()", "[]"}), "a law without internal state has none"),
    "one state": (frozenset({"[nan]"}), "one deflection, NaN in rows that were never reached"),
    "unused": (EVERYTHING, "no reference system takes arguments: they are never looked at"),
    "flag": (frozenset({"True"}), "it is a switch"),
    "text": (frozenset({"'abc'"}), "a name is free"),
    "empty text": (frozenset({"''"}), "a dimensionless unit, a long name that says nothing"),
    "path": (frozenset({"'abc'", "path"}), "the path of a directory, made if absent"),
    "function": (
        frozenset({"lambda"}),
        "it can be called so; what it gives is looked at when it is traced",
    ),
    "any function": (
        frozenset({"lambda", "class", "built-in class"}),
        "how it will be called is not known yet",
    ),
    "pair": (frozenset({"[1.0, 2.0]", "ragged"}), "a number or a row for each of the two motors"),
    "two numbers": (frozenset({"[1.0, 2.0]"}), "a number for each of the two motors"),
    "constant": (
        frozenset({"lambda"}),
        "a function of any arguments that gives the number 0: a section that is never crossed",
    ),
    "mapping": (frozenset({"{}"}), "no entries"),
    "entries": (frozenset({"{}", "{'a': 1}"}), "names and values are free"),
    "none of them": (frozenset({"()", "[]"}), "none"),
    "unknowns": (frozenset({"{'a': 1}"}), "an unknown or a frequency of that name"),
    "results": (frozenset({"{'a': 1}"}), "which results a function has is seen when it is traced"),
    "key": (frozenset({"key"}), "it is a key"),
    "states": (
        FINITE | {"{'a': 1}", "[1.0, 2.0]", "ragged", "3 x 2"},
        "a pytree of finite numbers is a state of a map",
    ),
    "lanes": (
        frozenset(
            {"[1.0, 2.0]", "3 x 2", "booleans", "float32 array", "complex array", "nans", "range"}
        )
        | {"[nan]"},
        "arrays with lanes in front, of what type is the business of the function",
    ),
    "numbers": (
        FINITE | ARRAYS | FLOAT32 | TREES
        | {"True", "numpy True", "nan", "inf", "-inf", "1j", "[nan]", "no rows", "complex array",
           "booleans", "nans", "key"},
        "a pytree of arrays of any type, handed to the functions of the user",
    ),
    "shared": (
        FINITE | ARRAYS | FLOAT32 | TREES,
        "a pytree of arrays of finite numbers, handed to the residual",
    ),
    "handed on": (
        EVERYTHING - UNTRACEABLE,
        "handed unread to the functions of the user: any pytree of what JAX traces or Python hashes",
    ),
}  # fmt: skip


def allowed(groups: tuple[str, ...]) -> frozenset[str]:
    """Names of the nonsense that an argument of these groups may take."""
    return frozenset().union(*(TAKEN[group][0] for group in groups))
