"""`python -m stickslip`: the list of what there is, and one page of it."""

import re
import subprocess
import sys

import pytest

from stickslip.__main__ import main
from stickslip._glossary import glossary
from stickslip._public import FOR_BUILDERS, PACKAGES, first_sentence, public_names
from stickslip._sources import bound_names
from tests.house._repository import ROOT


@pytest.mark.more
def test_every_public_name_is_listed_once_with_what_it_does(capsys):
    assert main([]) == 0
    lines = capsys.readouterr().out.splitlines()
    *heads, last = [line for line in lines if line and not line.startswith(" ")]
    assert heads == [package for package in PACKAGES if package not in FOR_BUILDERS]
    assert last == f"For packages that are built on these: {', '.join(FOR_BUILDERS)}"
    entries = [entry for package in heads for entry in public_names(package)]
    assert sum(line.startswith("  ") for line in lines) == len(entries)
    assert not [f"{e.package}.{e.name}" for e in entries if not e.summary]
    root = {entry.name for entry in public_names("stickslip")}
    assert {"simulate", "Section", "map_lanes", "RESULTS"} <= root
    assert "map_lanes" not in {entry.name for entry in public_names("stickslip.sweep")}


@pytest.mark.parametrize("name", ["simulate", "stickslip.simulate", "friction.Stribeck", "scenario"])
def test_a_name_is_shown_with_its_signature(name, capsys):
    assert main([name]) == 0
    head, *rest = capsys.readouterr().out.splitlines()
    assert head.split("(")[0].endswith(name)
    assert len(rest) > 3


def test_a_class_lists_its_methods_and_shows_one(capsys):
    assert main(["Problem"]) == 0
    head, _, methods = capsys.readouterr().out.partition("\nMethods and properties:\n")
    assert head.startswith("stickslip.identification.Problem(")
    assert "  fit()   " in methods
    assert "  unknowns   " in methods  # a property
    assert "__init__" not in methods
    assert main(["identification.Problem.fit"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("stickslip.identification.Problem.fit(self, *, method=None")
    assert main(["Problem.nothing"]) == 2


def test_a_package_is_listed_alone(capsys):
    assert main(["friction"]) == 0
    text = capsys.readouterr().out
    assert text.startswith("stickslip.friction\n")
    assert "  Stribeck  " in text
    assert "  check_friction_law()  " in text
    assert "simulate" not in text


def test_a_name_that_is_not_there_is_answered_with_those_like_it(capsys):
    assert main(["stribek"]) == 2
    assert "'stribek': it must be a public name" in capsys.readouterr().err
    assert main(["lyapunov"]) == 2
    assert "stickslip.analysis.lyapunov_spectrum" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "first"),
    [
        ("Holds. And more.", "Holds."),
        ("Simplified model, Eqs. (1) to (4).\nMore.", "Simplified model, Eqs. (1) to (4)."),
        ("A rule, e.g. Dahl's, for $h$. `a` is one.", "A rule, e.g. Dahl's, for $h$."),
        ("In its unit,\n\n$$x$$", "In its unit"),
        (None, ""),
    ],
)
def test_first_sentences(text, first):
    assert first_sentence(text) == first


@pytest.mark.more
def test_a_reader_that_has_seen_enough_is_no_error():
    command = f"{sys.executable} -m stickslip | head -n 1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert done.stdout == "stickslip\n"
    assert "Traceback" not in done.stderr


WORDS = (
    "stiction, Jenkins, Masing, Iwan, Stribeck, presliding, hunting, squeal, backlash, Karnopp, "
    "planar, complementarity, time stepping, Filippov, saltation matrix, Poincaré section, "
    "grazing, chattering, Zeno, limit cycle, Floquet, isola, basin, regularisation, LuGre, "
    "Dahl, bristle, damper, dead zone, dead band, breakaway, controller"
).split(", ")


@pytest.mark.parametrize("word", WORDS)
def test_words_of_the_field_are_found(word, capsys):
    assert main(["--find", word]) == 0
    assert word.lower() in capsys.readouterr().out.splitlines()[0].lower()


def test_names_and_docstrings_are_found_with_the_words(capsys):
    assert main(["--find", "FOLD orbit"]) == 0
    assert "stickslip.continuation.continue_orbit" in capsys.readouterr().out
    assert main(["--find", "zzz"]) == 2
    assert "'zzz': no such word" in capsys.readouterr().err
    assert main(["--find", " "]) == 2


def test_the_glossary_is_sorted_and_names_what_is_there():
    """Each name in backticks that looks like one of ours is one; every page that is linked exists."""
    words = [term.words.lower() for term in glossary()]
    assert words == sorted(words)
    single = [word for line in words for word in line.split(", ")]
    assert [word for word in single if single.count(word) > 1] == []
    known = {name for package in PACKAGES for name in bound_names(package)}
    for term in glossary():
        assert term.meaning.endswith(".")
        assert term.here.endswith(".")
        named = re.findall(r"`(?:\w+\.)*([A-Z]\w+|[a-z]+_\w+)", term.here)
        assert [n for n in named if n not in known and not is_word_of_a_user(n)] == []
        pages = re.findall(r"\]\(([^)]+)\)", term.here)
        assert [page for page in pages if not (ROOT / "notebooks" / page).exists()] == []


def is_word_of_a_user(name):
    """Methods, fields and labels, not names of packages."""
    methods = {"first_order", "mass_matrix", "static_coefficient", "contact_directions", "rest_speed"}
    words = {
        "forcing_period",
        "from_table",
        "from_units",
        "guard_names",
        "per_record",
        "GR",
        "HB",
        "PD",
    }
    return name in methods | words
