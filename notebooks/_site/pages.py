"""Pages that nobody writes by hand: the reference of every public name, glossary and gallery."""

import importlib
import inspect
import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from experiments._experiment import natural
from stickslip._glossary import glossary
from stickslip._public import PACKAGES, Public, first_sentence, public_names

ROOT = Path(__file__).parents[2]
RECORDS = ROOT / "experiments" / "records"
PICTURES = ROOT / "experiments" / "pictures"
# Of the gallery: the beginning of the names of commands, and what they are of.
TOPICS = {
    "animate": "In motion",
    "block": "Block on a belt",
    "beam": "Jointed beam",
    "corexy": "CoreXY",
    "identify": "Identification",
    "mechanism": "Other mechanisms",
}
_FENCE = ":" * 5
_IMAGES = "_images"  # where the built site has its pictures, seen from a page
# A call that a reader would not write: the machinery of pytrees and of named tuples.
_INHERITED = {"_asdict", "_make", "_replace", "count", "index"}


def write_pages(source: Path) -> None:
    """Write `api/*.md`, `glossary.md` and `gallery.md` into the folder of the site's pages."""
    folder = source / "api"
    folder.mkdir(exist_ok=True)
    _write(folder / "index.md", _api_index())
    for package in PACKAGES:
        _write(folder / f"{package}.md", "\n".join(_api_page(package)))
    _write(source / "glossary.md", "\n".join(_glossary()))
    _write(source / "gallery.md", "\n".join(_gallery()))


def _write(path: Path, text: str) -> None:
    """Write if it changed, so that Sphinx reads again only what did."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def _api_index() -> str:
    rows = []
    for package in PACKAGES:
        about = first_sentence(inspect.getdoc(importlib.import_module(package)))
        names = ", ".join(_link(entry) for entry in public_names(package))
        rows.append(f"**[{package}]({package}.md)**: {about} {names}.\n")
    tree = "\n".join(PACKAGES)
    return (
        "# Reference\n\nEvery public name; the same list is printed by `python -m stickslip`.\n\n"
        + "\n".join(rows)
        + f"\n```{{toctree}}\n:hidden:\n\n{tree}\n```\n"
    )


def _link(entry: Public, title: str = "") -> str:
    return f"{{py:obj}}`{title or entry.name} <{entry.package}.{entry.name}>`"


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


def _glossary() -> Iterator[str]:
    """Every entry, with its names and calls linked to the reference."""
    entries = {}
    for package in PACKAGES:
        for entry in public_names(package):
            whole = f"{package}.{entry.name}"
            # Of names that two packages have, the name alone means the first.
            for name in (whole, whole.removeprefix("stickslip."), entry.name):
                entries.setdefault(name, entry)

    def linked(found: re.Match) -> str:
        entry = entries.get(found[1].split("(")[0])
        return found[0] if entry is None else _link(entry, found[1])

    yield "# Glossary\n"
    yield "Words of the field and where they are; in a terminal `python -m stickslip --find WORD`.\n"
    yield "```{glossary}"
    for term in glossary():
        yield "\n".join(term.words.split(", "))
        for text in (term.meaning, term.here):
            yield "  " + re.sub(r"`([^`]+)`", linked, text) + "\n"
    yield "```"


def _gallery() -> Iterator[str]:
    """Pictures of the records by topic, moving where there is an animation."""
    yield "# Gallery\n"
    yield "The command under a picture draws it in a checkout after `make setup`. Click to enlarge.\n"
    records = [path for path in RECORDS.glob("*.json") if path.with_suffix(".png").exists()]
    records.sort(key=lambda path: natural(path.stem))
    for beginning, topic in TOPICS.items():
        yield f"\n## {topic}\n\n{_FENCE}{{container}} gallery\n"
        for path in records:
            if path.stem.startswith(beginning):
                title = json.loads(path.read_text(encoding="utf-8"))["title"]
                moving = PICTURES / f"{path.stem}.gif"
                picture = (moving if moving.exists() else path.with_suffix(".png")).relative_to(ROOT)
                yield f"{_FENCE[:-1]}{{container}} card\n"
                yield f"```{{image}} ../{picture}\n:target: {_IMAGES}/{picture.name}"
                yield f":alt: {title}\n```\n"
                yield f"{title}\n\n`python -m experiments {path.stem}`\n{_FENCE[:-1]}\n"
        yield _FENCE
