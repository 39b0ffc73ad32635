"""Pages that nobody writes by hand: the reference of every public name, glossary and gallery."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

from experiments._experiment import natural
from stickslip._descriptions import docstring_of, methods_of, signature_of
from stickslip._glossary import glossary
from stickslip._public import PACKAGES, Public, first_sentence, public_names
from stickslip._sources import docstring_of_module

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
        about = first_sentence(docstring_of_module(package))
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
    yield f"# {package}\n"
    yield markdown(docstring_of_module(package))
    yield f"\n```{{py:currentmodule}} {package}\n```\n"
    for entry in public_names(package):
        yield from _entry(entry)


def _entry(entry: Public) -> Iterator[str]:
    source = entry.source
    yield f"\n## {entry.name}\n"
    if entry.is_class or entry.is_function:
        kind = "py:class" if entry.is_class else "py:function"
        yield f"{_FENCE}{{{kind}}} {entry.name}{signature_of(source)}\n"
        yield markdown(docstring_of(source))
    else:
        yield f"{_FENCE}{{py:data}} {entry.name}\n"
        yield f"`{entry.summary}`"
    for name, method in sorted(methods_of(source).items()):
        kind = "py:property" if method.is_property else "py:method"
        call = "" if method.is_property else signature_of(method.source, bound=True)
        yield f"\n{_FENCE[:-1]}{{{kind}}} {name}{call}\n"
        yield markdown(method.docstring)
        yield _FENCE[:-1]
    yield _FENCE


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
