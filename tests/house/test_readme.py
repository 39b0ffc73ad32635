"""The code on the README and the pages prints what they say, and what they point to is there."""

import re
from pathlib import Path

import pytest

from tests.house._repository import ROOT, run_python, tracked_files

README = ROOT / "README.md"
PAGES = [README, ROOT / "CONTRIBUTING.md", *sorted((ROOT / "notebooks").glob("*.md"))]
LONGEST = 130  # lines of the README
EXAMPLE = re.compile(
    r"^```python\n(.*?)^```\s*^```text\n(.*?)^```", flags=re.MULTILINE | re.DOTALL
)  # fmt: skip


def text_of(page):
    return page.read_text(encoding="utf-8")


# The README's own run in the quick suite, and one that takes minutes only with everything else.
LONG = ("basins-0",)


def marks_of(page: Path, number: int) -> list:
    """When an example runs."""
    if f"{page.stem}-{number}" in LONG:
        return [pytest.mark.slow]
    return [] if page == README else [pytest.mark.more]


EXAMPLES = [
    pytest.param(code, output, id=f"{page.stem}-{number}", marks=marks_of(page, number))
    for page in PAGES
    for number, (code, output) in enumerate(EXAMPLE.findall(text_of(page)))
]


@pytest.mark.parametrize(("code", "output"), EXAMPLES)
def test_examples_print_what_they_say(code, output):
    """In a process of its own: the compiler aborts it where the fused executor goes wrong."""
    done = run_python(code)
    assert done.returncode == 0, done.stderr
    assert _without_steps(done.stdout) == _without_steps(output)


def _without_steps(text):
    """How often a step is tried again is a matter of the last digit, and of the processor."""
    return re.sub(r"\d+ steps accepted of \d+", "steps", text.strip())


def test_every_python_block_has_its_output():
    blocks = [re.findall(r"^```python$", text_of(page), flags=re.MULTILINE) for page in PAGES]
    assert sum(map(len, blocks)) == len(EXAMPLES)


def test_the_readme_is_short_and_its_example_has_twelve_lines():
    assert len(text_of(README).splitlines()) <= LONGEST
    code, _ = EXAMPLE.findall(text_of(README))[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 12


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_points_to_is_in_the_repository(page):
    """Links and pictures."""
    tracked = {path.resolve() for path in tracked_files()}
    targets = re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text_of(page))
    targets = [t for t in targets if not t.startswith("http")]
    assert [t for t in targets if (page.parent / t).resolve() not in tracked] == []
