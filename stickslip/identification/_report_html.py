"""A report as one page that holds everything it shows."""

import html
import io
import os
from typing import Any

STYLE = """
body { font: 15px/1.45 system-ui, sans-serif; max-width: 1180px; margin: 2em auto; padding: 0 1em;
       color: #222 }
h1 { font-size: 1.5em } h2 { font-size: 1.1em; margin-top: 1.6em }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: .25em .9em .25em 0; border-bottom: 1px solid #ddd }
th { font-weight: 600 } .no { color: #c0392b; font-weight: 600 }
.wide { overflow-x: auto } svg { width: 100%; height: auto } pre { overflow-x: auto }
"""


def page(report: Any, path: str) -> None:
    """Write it to `path`, all of it or nothing."""
    sentences = "".join(f"<li>{_with_marks(s)}</li>" for s in report.statements())
    parts = [
        f"<h1>{html.escape(report.title)}</h1>",
        "<h2>Estimates</h2>", _table(report.rows()),
        "<h2>Findings</h2>", f"<ul>{sentences}</ul>",
        "<h2>Correlation of the estimates</h2>", _table(report.correlation_rows()),
    ]  # fmt: skip
    if report.comparison is not None:
        parts += ["<h2>Models compared</h2>", f"<pre>{html.escape(str(report.comparison))}</pre>"]
    parts += ["<h2>Pictures</h2>", _picture(report.plot())]
    text = (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{html.escape(report.title)}</title><style>{STYLE}</style></head>"
        f"<body>{''.join(parts)}</body></html>\n"
    )
    temporary = f"{path}.part"
    with open(temporary, "w", encoding="utf-8") as file:
        file.write(text)
    os.replace(temporary, path)


def _with_marks(sentence: str) -> str:
    text = html.escape(sentence)
    return text.replace("NOT", '<span class="no">not</span>').replace(
        "NO derivative", '<span class="no">no</span> derivative'
    )


def _table(rows: list[list[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in rows[0])
    body = "".join(
        "<tr>" + "".join(_cell(cell) for cell in row) + "</tr>" for row in rows[1:]
    )  # fmt: skip
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def _cell(text: str) -> str:
    mark = ' class="no"' if "not identifiable" in text or text.startswith("at the ") else ""
    return f"<td{mark}>{html.escape(text)}</td>"


def _picture(figure: Any) -> str:
    """As a drawing inside of the page."""
    out = io.StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return out.getvalue().partition("<svg")[1] + out.getvalue().partition("<svg")[2]
