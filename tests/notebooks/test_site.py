"""The documentation site: every public name has an entry, examples stay whole, no link is broken."""

import importlib.util
import os
import re
import subprocess
import sys

import pytest

from stickslip._public import PACKAGES, public_names
from tests.house._repository import ROOT

SITE = ROOT / "notebooks" / "_site"


@pytest.fixture(scope="module")
def pages():
    spec = importlib.util.spec_from_file_location("pages", SITE / "pages.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_public_name_has_an_entry_and_nothing_is_left_of_other_dialects(pages, tmp_path):
    pages.write_pages(tmp_path)
    for package in PACKAGES:
        text = (tmp_path / "api" / f"{package}.md").read_text(encoding="utf-8")
        for entry in public_names(package):
            assert f"\n## {entry.name}\n" in text
        assert "???" not in text
        assert "][]" not in text
        # A prompt outside of a fence would be a quotation in a quotation in a quotation.
        outside = re.sub(r"```.*?```", "", text, flags=re.S)
        assert ">>>" not in outside
        assert text.count("```") % 2 == 0


def test_the_gallery_shows_at_least_twenty_pictures_with_their_commands(pages, tmp_path):
    pages.write_pages(tmp_path)
    text = (tmp_path / "gallery.md").read_text(encoding="utf-8")
    assert text.count("![") == text.count("python -m experiments ") >= 20
    for picture in re.findall(r"\]\(\.\./(.*?)\)", text):
        assert (ROOT / picture).exists()


def test_docstrings_are_turned_into_pages(pages):
    text = (
        'Says.\n\n>>> f(1)\n2\n\nMore on [`g`][].\n\n    ??? cite "Reference"\n\n'
        "        A. Author, 1999.\n\nEnd."
    )
    assert pages.markdown(text).splitlines() == [
        "Says.", "", "", "```pycon", ">>> f(1)", "2", "```", "", "", "More on `g`.", "",
        "", "    **Reference.**", "    ", "    A. Author, 1999.", "    ", "End.",
    ]  # fmt: skip


def test_signatures_show_what_a_reader_would_write(pages):
    def f(self, a: int, *, b=1.5, call=len, rest=tuple(range(40))): ...

    assert pages.signature(f, bound=True) == "(a, *, b=1.5, call=len, rest=tuple(...))"


@pytest.mark.slow
def test_the_site_builds_without_a_warning(tmp_path):
    """The pages alone; `make docs` executes the notebooks too."""
    pytest.importorskip("myst_nb", reason="the extra `docs` is not installed")
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-c", str(SITE),
        "-D", "nb_execution_mode=off", "-d", str(tmp_path / "trees"),
        str(ROOT / "notebooks"), str(tmp_path / "site"),
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "api" / "stickslip.html").exists()
    assert "cdn" not in re.findall(r'src="([^"]*)"', (tmp_path / "site" / "index.html").read_text())
