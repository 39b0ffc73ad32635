"""The rules of the house, checked over the files themselves."""

import importlib
import inspect
import pkgutil
import re
from pathlib import Path
from types import ModuleType

import equinox as eqx
import pytest

from tests.house._repository import PACKAGES, ROOT, imported_modules, imported_names, tracked_files

LONGEST_FILE = 450
TOP_LEVEL = {
    "pyproject.toml",
    "corexy_jax",
    "stickslip",
    "experiments",
    "tests",
    "notebooks",
    "README.md",
    "Makefile",
    "LICENSE",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "CITATION.cff",
    "requirements.lock",
}


def python_files(package: str):
    return [p for p in tracked_files() if p.suffix == ".py" and p.is_relative_to(ROOT / package)]


def package_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).parts[:-1])


def modules(package: str) -> list[ModuleType]:
    root = importlib.import_module(package)
    names = [info.name for info in pkgutil.walk_packages(root.__path__, f"{package}.")]
    return [root, *map(importlib.import_module, names)]


def public_objects(package: str):
    """What a user reaches without an underscore: classes and functions that are ours."""
    for module in modules(package):
        if any(part.startswith("_") for part in module.__name__.split(".")):
            continue
        for name in getattr(module, "__all__", vars(module)):
            thing = getattr(module, name)
            named_by_us = getattr(thing, "__module__", None) or ""
            if (
                not name.startswith("_")
                and (inspect.isclass(thing) or callable(thing))
                and named_by_us.split(".")[0] in PACKAGES
            ):
                yield f"{module.__name__}.{name}", thing


def modules_of_our_own(package: str) -> set[type]:
    return {
        thing
        for module in modules(package)
        for thing in vars(module).values()
        if inspect.isclass(thing)
        and issubclass(thing, eqx.Module)
        and thing.__module__.split(".")[0] in PACKAGES
    }


@pytest.mark.parametrize(
    ("package", "forbidden"),
    [
        ("stickslip", {"corexy_jax", "experiments", "tests"}),
        ("corexy_jax", {"experiments", "tests"}),
        ("experiments", {"tests"}),
    ],
)
def test_imports_point_one_way(package, forbidden):
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in python_files(package)
        for line, name in imported_modules(path.read_text(encoding="utf-8"), package_of(path))
        if name.split(".")[0] in forbidden
    ]
    assert wrong == []


def hidden(name: str) -> bool:
    """Whether a module is private: a part of its name begins with one underscore."""
    return any(part.startswith("_") and not part.startswith("__") for part in name.split("."))


@pytest.mark.parametrize(
    ("package", "others"),
    [("corexy_jax", {"stickslip"}), ("experiments", {"stickslip", "corexy_jax"})],
)
def test_who_builds_on_a_package_uses_its_public_names(package, others):
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {name}"
        for path in python_files(package)
        for line, name in imported_names(path.read_text(encoding="utf-8"), package_of(path))
        if name.split(".")[0] in others and hidden(name)
    ]
    assert wrong == []


def test_packages_of_the_toolkit_use_public_names_of_each_other():
    """A module without an underscore, as `hybrid/components.py`, is what other packages may use."""
    wrong = []
    for path in python_files("stickslip"):
        own = package_of(path)
        for line, name in imported_names(path.read_text(encoding="utf-8"), own):
            parts = name.split(".")
            other = ".".join(parts[:2])
            elsewhere = (ROOT / "stickslip" / parts[1]).is_dir() if len(parts) > 1 else False
            if parts[0] == "stickslip" and elsewhere and other != own and hidden(name):
                wrong.append(f"{path.relative_to(ROOT)}:{line} imports {name}")
    assert wrong == []


ABOVE = ("analysis", "basin", "continuation", "control", "estimation", "plot", "structure")
MACHINES = ("friction", "contact", "mechanism", "structure", "systems", "control")
# What each package of the toolkit does not know, whatever it builds on itself.
UNKNOWN_TO = {
    "hybrid": {"friction", "contact", "mechanism", "systems", "derived", "sweep", *ABOVE},
    "friction": {"contact", "mechanism", "systems", "derived", "sweep", *ABOVE},
    "derived": {"friction", "contact", "mechanism", "systems", "sweep", *ABOVE},
    "mechanism": {"systems", "derived", "sweep", *ABOVE},
    "analysis": {*MACHINES, "basin", "continuation", "estimation", "plot"},
    "basin": {*MACHINES, "estimation", "plot"},
    "continuation": {*MACHINES, "basin", "estimation", "plot"},
    "control": {"basin", "continuation", "estimation", "plot"},
    "estimation": {*MACHINES, "basin", "continuation", "plot"},
    "identification": {"systems", "analysis", "basin", "continuation"},
    "sweep": {"friction", "contact", "mechanism", "systems", "derived", *ABOVE},
}


@pytest.mark.parametrize("name", UNKNOWN_TO)
def test_no_layer_knows_those_above_it(name):
    above = {f"stickslip.{other}" for other in UNKNOWN_TO[name] | {"identification"} - {name}}
    wrong = [
        f"{path.relative_to(ROOT)}:{line} imports {module}"
        for path in python_files(f"stickslip/{name}")
        for line, module in imported_modules(path.read_text(encoding="utf-8"), package_of(path))
        if any(module == other or module.startswith(f"{other}.") for other in above)
    ]
    assert wrong == []


def test_private_imports_are_seen():
    source = "from a._b import c\nfrom a import _d, e\nimport a.f._g\nfrom a import __version__\n"
    seen = [name for _, name in imported_names(source, "p") if hidden(name)]
    assert seen == ["a._b.c", "a._d", "a.f._g"]


def test_every_form_of_import_is_seen():
    source = "import a.b\ndef f():\n    from ..c import d\nfrom . import e\n"
    assert set(imported_modules(source, "p.q")) == {(1, "a.b"), (3, "p.c"), (4, "p.q")}


def test_no_file_is_too_long():
    watched = {".py", ".md", ".toml", ""}
    lengths = {
        str(path.relative_to(ROOT)): len(path.read_text(encoding="utf-8").splitlines())
        for path in tracked_files()
        if path.suffix in watched
    }
    assert {name: n for name, n in lengths.items() if n > LONGEST_FILE} == {}


def test_no_path_of_a_machine():
    # Written so that it does not find itself.
    pattern = re.compile(rb"(?<![\w.])/(?:work|root|farm|home)/")
    wrong = [str(p.relative_to(ROOT)) for p in tracked_files() if pattern.search(p.read_bytes())]
    assert wrong == []


def test_top_level_is_the_agreed_tree():
    names = {path.relative_to(ROOT).parts[0] for path in tracked_files()}
    assert {name for name in names if not name.startswith(".")} <= TOP_LEVEL


@pytest.mark.parametrize("package", PACKAGES)
def test_what_is_public_is_documented(package):
    undocumented = [
        name
        for name, thing in public_objects(package)
        # A dataclass without a docstring gets its signature as one.
        if not thing.__doc__ or thing.__doc__.startswith(f"{thing.__name__}(")
    ]
    assert undocumented == []


@pytest.mark.parametrize("package", PACKAGES)
def test_modules_are_abstract_or_final(package):
    """Only classes called `Abstract...` have heirs, so the method that runs is the one you read."""
    wrong = [
        f"{thing.__qualname__} inherits from {base.__qualname__}"
        for thing in modules_of_our_own(package)
        for base in thing.__bases__
        if base.__module__.split(".")[0] in PACKAGES
        and not base.__name__.lstrip("_").startswith("Abstract")
    ]
    assert wrong == []
