"""The documentation site: every public name has an entry, examples stay whole, no link is broken."""

import importlib
import os
import re
import subprocess
import sys

import pytest

from stickslip._public import PACKAGES, public_names
from tests.house._repository import ROOT
from tests.house.test_readme import EXAMPLE, README, text_of

SITE = ROOT / "notebooks" / "_site"


@pytest.fixture
def pages(monkeypatch):
    monkeypatch.syspath_prepend(SITE)
    return importlib.import_module("pages")


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


def test_the_gallery_shows_every_record_by_topic_with_its_command(pages, tmp_path):
    pages.write_pages(tmp_path)
    text = (tmp_path / "gallery.md").read_text(encoding="utf-8")
    shown = re.findall(r"`python -m experiments (.*)`", text)
    assert sorted(shown) == sorted(path.stem for path in pages.RECORDS.glob("*.png"))
    assert shown.index("beam-fig2.2") < shown.index("beam-fig2.10") < shown.index("mechanism-brake")
    pictures = re.findall(r"\{image\} \.\./(.*)", text)
    assert len(pictures) == len(shown)
    assert [picture for picture in pictures if not (ROOT / picture).exists()] == []
    assert sum(picture.endswith(".gif") for picture in pictures) == 3


def test_pictures_that_move_are_small(pages):
    assert max(path.stat().st_size for path in pages.PICTURES.iterdir()) < 300e3


def test_the_reference_leads_to_its_names_and_so_does_the_glossary(pages, tmp_path):
    pages.write_pages(tmp_path)
    index = (tmp_path / "api" / "index.md").read_text(encoding="utf-8")
    for package in PACKAGES:
        for entry in public_names(package):
            assert f"{{py:obj}}`{entry.name} <{package}.{entry.name}>`" in index
    text = (tmp_path / "glossary.md").read_text(encoding="utf-8")
    assert "{py:obj}`plot.branch <stickslip.plot.branch>`" in text
    assert "{py:obj}`backlash(x, gap) <stickslip.backlash>`" in text
    for word in ("damper", "friction damper", "planar friction", "controller", "Jenkins element"):
        assert f"\n{word}\n" in text


def test_the_home_page_shows_what_the_tests_of_the_readme_run():
    home = (ROOT / "notebooks" / "index.md").read_text(encoding="utf-8")
    parts = []
    for begin, end in re.findall(r'README\.md\n:start-after: "(.*)"\n:end-before: "(.*)"', home):
        assert text_of(README).count(begin) == text_of(README).count(end) == 1
        parts.append(text_of(README).partition(begin)[2].partition(end)[0])
    assert "pip install ." in parts[0]
    assert EXAMPLE.findall(parts[1]) == EXAMPLE.findall(text_of(README))[:1]


def test_docstrings_are_turned_into_pages(pages):
    text = (
        'Says.\n\n>>> f(1)\n2\n\nMore on [`g`][].\n\n    ??? cite "Reference"\n\n'
        "        A. Author, 1999.\n\nEnd."
    )
    assert pages.markdown(text).splitlines() == [
        "Says.", "", "", "```pycon", ">>> f(1)", "2", "```", "", "", "More on `g`.", "",
        "", "    **Reference.**", "    ", "    A. Author, 1999.", "    ", "End.",
    ]  # fmt: skip


@pytest.mark.more
def test_the_site_builds_without_a_warning(tmp_path):
    pytest.importorskip("myst_nb", reason="the extra `docs` is not installed")
    command = [
        sys.executable, "-m", "sphinx", "-W", "--keep-going", "-n", "-q", "-c", str(SITE),
        "-d", str(tmp_path / "trees"), str(ROOT / "notebooks"), str(tmp_path / "site"),
    ]  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "api" / "stickslip.html").exists()
    assert "cdn" not in re.findall(r'src="([^"]*)"', (tmp_path / "site" / "index.html").read_text())
