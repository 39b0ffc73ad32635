"""The code in the README runs and prints what the README says it prints."""

import re

from tests.house._repository import ROOT, run_python

EXAMPLES = re.findall(
    r"^```python\n(.*?)^```\s*^```text\n(.*?)^```",
    (ROOT / "README.md").read_text(encoding="utf-8"),
    flags=re.MULTILINE | re.DOTALL,
)


def test_examples_print_what_they_say():
    """In a process of its own: the compiler aborts it where the fused executor goes wrong."""
    for code, output in EXAMPLES:
        done = run_python(code)
        assert done.returncode == 0, done.stderr
        assert done.stdout.strip() == output.strip()


def test_every_python_block_has_its_output():
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(re.findall(r"^```python$", text, flags=re.MULTILINE)) == len(EXAMPLES)
