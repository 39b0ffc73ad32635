"""What the tests of the house look at: the tracked files and the syntax trees of this checkout."""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("stickslip", "corexy_jax")
_UNTRACKED = {".git", ".venv", "__pycache__", ".pytest_cache", ".ruff_cache", ".hypothesis"}


def tracked_files() -> list[Path]:
    """Files under version control; in an unpacked archive, every file that is no by-product."""
    if (ROOT / ".git").exists():
        listing = subprocess.run(
            ["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True
        ).stdout
        files = [ROOT / name for name in listing.split("\0") if name]
    else:
        files = [
            path
            for path in ROOT.rglob("*")
            if path.is_file() and not _UNTRACKED.intersection(path.relative_to(ROOT).parts)
        ]
    # A file deleted but not yet committed is still listed.
    return sorted(path for path in files if path.exists())


def imported_modules(source: str, package: str) -> Iterator[tuple[int, str]]:
    """Line and full module name of every import in a file of `package`, the indented ones too."""
    yield from dict.fromkeys((line, module) for line, module, _ in _imports(source, package))


def imported_names(source: str, package: str) -> Iterator[tuple[int, str]]:
    """The same with the name that is taken from the module, where one is."""
    for line, module, name in _imports(source, package):
        yield line, ".".join(filter(None, (module, name)))


def _imports(source: str, package: str) -> Iterator[tuple[int, str, str]]:
    parents = package.split(".")
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield node.lineno, alias.name, ""
        elif isinstance(node, ast.ImportFrom):
            base = parents[: len(parents) - node.level + 1] if node.level else []
            module = ".".join([*base, node.module] if node.module else base)
            for alias in node.names:
                yield node.lineno, module, alias.name


def make_targets() -> set[str]:
    """Targets a user may call."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    return set(re.findall(r"^([a-z-]+):.*##", text, flags=re.MULTILINE))


def run_python(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in an interpreter of its own, with JAX and XLA set as on a user's machine."""
    inherited = {k: v for k, v in os.environ.items() if k not in {"JAX_ENABLE_X64", "XLA_FLAGS"}}
    return subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env=inherited | environment,
        capture_output=True,
        text=True,
        check=False,
    )
