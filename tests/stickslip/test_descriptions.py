"""What is read from the sources, against what Python finds when it imports them."""

import ast
import importlib
import inspect
import subprocess
import sys
from functools import cached_property
from types import FunctionType, ModuleType

import pytest

from stickslip._descriptions import docstring_of, methods_of, signature_of
from stickslip._public import PACKAGES, public_names

OURS = ("stickslip", "corexy_jax")


def names_found_by_python(package):
    """Names of ours that a package has when it is imported, without those that the root has too."""
    module = importlib.import_module(package)
    root = importlib.import_module(package.split(".")[0])
    found = {}
    for name in getattr(module, "__all__", None) or vars(module):
        thing = getattr(module, name)
        described = inspect.isclass(thing) or inspect.isroutine(thing)
        where = (getattr(thing, "__module__", None) or "").split(".")[0]
        if name.startswith("_") or name == "TYPE_CHECKING" or isinstance(thing, ModuleType):
            continue
        if module is not root and vars(root).get(name) is thing:
            continue
        if not described or where == package.split(".")[0]:
            found[name] = thing
    return found


def parameters_in(text):
    """Name, kind and default of the parameters of a signature as it is written."""
    if not text:
        return []
    given = ast.parse(f"def f{text}: pass").body[0].args
    places = [*given.posonlyargs, *given.args]
    defaults = [None] * (len(places) - len(given.defaults)) + given.defaults
    kinds = ["POSITIONAL_ONLY"] * len(given.posonlyargs) + ["POSITIONAL_OR_KEYWORD"] * len(given.args)
    found = [(a.arg, kind, d) for a, kind, d in zip(places, kinds, defaults, strict=True)]
    found += [(a.arg, "VAR_POSITIONAL", None) for a in [given.vararg] if a]
    found += [
        (a.arg, "KEYWORD_ONLY", d) for a, d in zip(given.kwonlyargs, given.kw_defaults, strict=True)
    ]
    return found + [(a.arg, "VAR_KEYWORD", None) for a in [given.kwarg] if a]


def is_enumeration(thing):
    return hasattr(thing, "promote")


def check_signature(thing, text):
    """Same parameters as Python's; the same defaults where they are numbers, words or None."""
    try:
        expected = list(inspect.signature(thing).parameters.values())
    except ValueError:  # exceptions
        assert text == ""
        return
    found = parameters_in(text)
    assert [(n, k) for n, k, _ in found] == [(p.name, p.kind.name) for p in expected]
    for (name, _, default), parameter in zip(found, expected, strict=True):
        assert (default is None) == (parameter.default is parameter.empty), name
        if isinstance(default, ast.Constant):
            assert default.value == parameter.default, name


@pytest.mark.parametrize("package", PACKAGES)
def test_names_signatures_and_docstrings_are_those_of_python(package):
    expected = names_found_by_python(package)
    entries = {entry.name: entry for entry in public_names(package)}
    assert set(entries) == set(expected)
    for name, entry in entries.items():
        thing = expected[name]
        if is_enumeration(thing):  # made by a call of Equinox, which tells nothing of the class
            assert signature_of(entry.source) == ""
        elif entry.is_class or entry.is_function:
            check_signature(thing, signature_of(entry.source))
        else:  # values have neither
            assert not inspect.isroutine(thing)
            continue
        assert docstring_of(entry.source) == (inspect.getdoc(thing) or "").rstrip(), name


def methods_found_by_python(cls):
    """Functions and properties of our classes, the nearest one of each name."""
    found = {}
    for base in cls.__mro__:
        for name, value in vars(base).items() if base.__module__.split(".")[0] in OURS else ():
            found.setdefault(name, getattr(value, "method", value))  # as Equinox wraps them
    kinds = (property, cached_property, classmethod, staticmethod, FunctionType)
    return {name for name, value in found.items() if isinstance(value, kinds) and name[0] != "_"}


@pytest.mark.parametrize("package", PACKAGES)
def test_methods_are_those_of_python(package):
    things = names_found_by_python(package)
    for entry in public_names(package):
        if not entry.is_class or is_enumeration(things[entry.name]):
            continue
        expected, found = methods_found_by_python(things[entry.name]), methods_of(entry.source)
        assert set(found) == expected, entry.name
        for name, method in found.items():
            value = getattr(things[entry.name], name)
            assert method.is_property == (not callable(value)), name
            if not method.is_property:
                check_signature(value, signature_of(method.source))


def run(code, **options):
    return subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, **options
    ).stdout


def test_a_page_is_shown_without_importing_jax():
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "stickslip", "Problem.fit"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout.startswith("stickslip.identification.Problem.fit(self, *, method=None")
    imported = {line.split("|")[-1].strip() for line in done.stderr.splitlines()}
    assert "stickslip._sources" in imported
    assert not imported & {"jax", "numpy", "equinox", "stickslip.hybrid"}


@pytest.mark.more
def test_a_command_that_needs_more_imports_the_whole_package_in_double_precision():
    out = run(
        "import sys\n"
        "sys.argv, sys.orig_argv = ['-m'], [sys.executable, '-m', 'stickslip', 'STATUS']\n"
        "import stickslip\n"
        "assert 'jax' not in sys.modules\n"
        "sys.argv = ['stickslip/__main__.py', 'STATUS']\n"
        "from stickslip.__main__ import main\n"
        "assert main() == 0\n"
        "import jax.numpy\n"
        "print(stickslip.simulate.__name__, jax.numpy.ones(1).dtype)\n"
    )
    assert out.startswith("stickslip.analysis.STATUS\n\n('ok', 'left_domain'")
    assert out.endswith("simulate float64\n")


@pytest.mark.more
def test_another_command_that_imports_the_package_gets_all_of_it(tmp_path):
    """Also while Python only looks for that command, when the package looks as if it were called."""
    package = tmp_path / "stickslip_user"
    package.mkdir()
    (package / "__init__.py").write_text("import stickslip\nfound = hasattr(stickslip, 'simulate')\n")
    (package / "__main__.py").write_text("from stickslip_user import found\nprint(found)\n")
    done = subprocess.run(
        [sys.executable, "-m", "stickslip_user", "-m", "stickslip"],
        capture_output=True, text=True, check=True, cwd=tmp_path,
    )  # fmt: skip
    assert done.stdout == "True\n"
