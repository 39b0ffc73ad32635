"""The code in the README runs and prints what the README says it prints."""

import contextlib
import io
import re

from tests.house._repository import ROOT

EXAMPLES = re.findall(
    r"^```python\n(.*?)^```\s*^```text\n(.*?)^```",
    (ROOT / "README.md").read_text(encoding="utf-8"),
    flags=re.MULTILINE | re.DOTALL,
)


def printed_by(code: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as printed:
        exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    return printed.getvalue()


def test_examples_print_what_they_say():
    for code, output in EXAMPLES:
        assert printed_by(code).strip() == output.strip()


def test_every_python_block_has_its_output():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^```python$", text, flags=re.MULTILINE)) == len(EXAMPLES)
