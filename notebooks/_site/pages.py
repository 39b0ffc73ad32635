"""Pages that nobody writes by hand: the reference of every public name, and the gallery."""

import importlib
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from stickslip._public import PACKAGES, Public, first_sentence, public_names

ROOT = Path(__file__).parents[2]
RECORDS = ROOT / "experiments" / "records"
_FENCE = ":" * 5
# A call that a reader would not write: the machinery of pytrees and of named tuples.
_INHERITED = {"_asdict", "_make", "_replace", "count", "index"}


def write_pages(source: Path) -> None:
    """Write `api/*.md` and `gallery.md` into the folder of the site's pages."""
    folder = source / "api"
    folder.mkdir(exist_ok=True)
    _write(folder / "index.md", _api_index())
    for package in PACKAGES:
        _write(folder / f"{package}.md", "\n".join(_api_page(package)))
    _write(source / "gallery.md", "\n".join(_gallery()))


def _write(path: Path, text: str) -> None:
    """Write if it changed, so that Sphinx reads again only what did."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def _api_index() -> str:
    rows = []
    for package in PACKAGES:
        about = first_sentence(inspect.getdoc(importlib.import_module(package)))
        names = ", ".join(f"`{entry.name}`" for entry in public_names(package))
        rows.append(f"**[{package}]({package}.md)**: {about} {names}.\n")
    tree = "\n".join(PACKAGES)
    return (
        "# Reference\n\nEvery public name; the same list is printed by `python -m stickslip`.\n\n"
        + "\n".join(rows)
        + f"\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
    )


def _api_page(package: str) -> Iterator[str]:
    module = importlib.import_module(package)
    yield f"# {package}\n"
    yield markdown(inspect.getdoc(module) or "")
    yield f"\n```{{py:currentmodule}} {package}\n```\n"
    for entry in public_names(package):
        yield from _entry(entry)


def _entry(entry: Public) -> Iterator[str]:
    thing = entry.thing
    yield f"\n## {entry.name}\n"
    if inspect.isclass(thing):
        yield f"{_FENCE}{{py:class}} {entry.name}{signature(thing)}\n"
        yield markdown(inspect.getdoc(thing) or "")
        for name, method in _methods(thing):
            kind = "py:property" if isinstance(method, property) else "py:method"
            call = "" if kind == "py:property" else signature(method, bound=True)
            yield f"\n{_FENCE[:-1]}{{{kind}}} {name}{call}\n"
            yield markdown(inspect.getdoc(method) or "")
            yield _FENCE[:-1]
    elif inspect.isroutine(thing):
        yield f"{_FENCE}{{py:function}} {entry.name}{signature(thing)}\n"
        yield markdown(inspect.getdoc(thing) or "")
    else:
        yield f"{_FENCE}{{py:data}} {entry.name}\n"
        yield f"`{entry.summary}`" if not callable(thing) else markdown(inspect.getdoc(thing) or "")
    yield _FENCE


def _methods(cls: type) -> Iterator[tuple[str, Any]]:
    """Public methods and properties of ours, in the order of their names."""
    for name in sorted(dir(cls)):
        owner = next((c for c in cls.__mro__ if name in vars(c)), None)
        if name.startswith("_") or name in _INHERITED or owner is None:
            continue
        if owner.__module__.split(".")[0] not in ("stickslip", "corexy_jax"):
            continue
        thing = inspect.getattr_static(cls, name)
        thing = getattr(thing, "__func__", getattr(thing, "method", thing))
        if isinstance(thing, property) or inspect.isfunction(thing):
            yield name, thing


def signature(thing: Any, *, bound: bool = False) -> str:
    """Names and defaults; what is allowed stands in the docstring."""
    try:
        found = inspect.signature(thing)
    except (TypeError, ValueError):
        return ""
    parameters = list(found.parameters.values())
    if bound and parameters and parameters[0].name in ("self", "cls"):
        parameters = parameters[1:]
    short = [
        p.replace(annotation=p.empty, default=p.default if p.default is p.empty else _Shown(p.default))
        for p in parameters
    ]
    return str(inspect.Signature(short))


class _Shown:
    """A default as a reader would write it."""

    def __init__(self, value: Any):
        text = repr(value)
        if callable(value) or " at 0x" in text or "\n" in text or len(text) > 40:
            text = getattr(value, "__name__", None) or type(value).__name__ + "(...)"
        self.text = text

    def __repr__(self) -> str:
        return self.text


def markdown(text: str) -> str:
    """A docstring as a page of MyST takes it: examples fenced, references as admonitions."""
    lines, out = text.split("\n"), []
    i = 0
    fenced = False
    while i < len(lines):
        line = lines[i]
        if line.lstrip().startswith("```"):
            fenced = not fenced
        if not fenced and line.lstrip().startswith(">>>"):
            block, i = _until_blank(lines, i)
            indent = re.match(r" *", block[0])[0]  # pyright: ignore[reportOptionalSubscript]
            out += ["", f"{indent}```pycon", *block, f"{indent}```", ""]
            continue
        said = re.match(r'( *)\?\?\? \w+ "(.*)"', line)
        if said:
            out += ["", f"{said[1]}**{said[2]}.**"]
            i += 1
            while i < len(lines) and (not lines[i].strip() or lines[i].startswith(said[1] + "    ")):
                out.append(said[1] + lines[i].strip())
                i += 1
            continue
        out.append(line)
        i += 1
    return re.sub(r"\[(`[^`]+`)\]\[\]", r"\1", "\n".join(out))


def _until_blank(lines: list[str], start: int) -> tuple[list[str], int]:
    """An example: prompts, what goes on, and what is printed, up to an empty line."""
    end = start
    while end < len(lines) and lines[end].strip():
        end += 1
    return lines[start:end], end


def _gallery() -> Iterator[str]:
    yield "# Gallery\n"
    yield "Every picture is drawn by the command under it, from a checkout after `make setup`.\n"
    for path in sorted(RECORDS.glob("*.json")):
        picture = path.with_suffix(".png")
        if not picture.exists():
            continue
        title = json.loads(path.read_text(encoding="utf-8")).get("title", path.stem)
        yield f"\n## {path.stem}\n\n{title}\n"
        yield f"![{title}](../experiments/records/{picture.name})\n"
        yield f"```sh\npython -m experiments {path.stem}\n```\n"
