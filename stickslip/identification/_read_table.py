"""Tables of numbers from the files that measuring instruments and MATLAB write."""

import itertools
import os
import pathlib
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .._types import Given
from .._validation import check_count, check_in, check_type, refusal

SEPARATORS = (";", "\t", ",")
LEFT_OUT = (
    "{}: left out {}, which are neither numbers nor texts. In MATLAB, char(...) makes a text of a "
    "string, table2struct(..., 'ToScalar', true) a structure of a table."
)


def read_table(
    path: Given[str | os.PathLike],
    *,
    columns: Given[Sequence[str] | None] = None,
    decimal: str = ".",
    skip: int = 0,
) -> dict[str, np.ndarray]:
    """Columns by name of a table of text, or variables of a MATLAB file, for `Record.from_table`.

    **Text** (any ending but `.mat`): columns are separated by semicolons, tabs, commas or spaces,
    whichever of them the first line holds; lines that begin with `#` are comments. The first line has
    the names, unless `columns` states them. **MATLAB** (`.mat`, also of version 7.3): variables of
    numbers and texts; those of a structure are named `data.position`, of cells `runs[0]`, and cells
    of texts are a row of them. A single row or column is one row. A warning names what a file has
    beside these, as tables, strings in double quotes and other objects of MATLAB.

    **Arguments:** `path`; `columns`: names for a table whose first line has none; `decimal`: the
    decimal point, `"."` or `","`; `skip`: how many lines of text come before the table. **Returns**
    arrays by name; text stays text. **Raises** `ValueError` for a file that is not such a
    table, or not there, `TypeError` for other arguments, `OSError` where it cannot be read.
    """
    if not isinstance(path, str | os.PathLike) or not os.fspath(path):
        raise refusal("path", path, "the path of a file", TypeError)
    check_in("decimal", decimal, (".", ","))
    check_count("skip", skip, 0)
    names = columns
    if names is not None:
        if isinstance(names, str) or not isinstance(names, Sequence) or not len(names):
            raise refusal("columns", columns, "a list of names, or None", TypeError)
        for name in names:
            check_type("columns", name, str, "a list of names")
    file = pathlib.Path(path)
    if not file.is_file():
        raise refusal("path", str(file), "the path of a table", but="no file")
    if file.suffix.lower() == ".mat":
        if names is not None:
            raise refusal("columns", columns, "None for a .mat file, whose variables have names")
        rows, others = _matlab(file)
        if others:
            warnings.warn(LEFT_OUT.format(file, ", ".join(others)), stacklevel=2)
        return rows
    return _text(file, names, decimal, skip)


def _text(
    file: pathlib.Path, names: Sequence[str] | None, decimal: str, skip: int
) -> dict[str, np.ndarray]:
    import pandas as pd

    encoding = _encoding(file)
    with file.open(encoding=encoding, errors="replace") as lines:
        rest = itertools.islice(lines, skip, None)
        first = next((line for line in rest if line.strip() and not line.startswith("#")), "")
    marks = [mark for mark in SEPARATORS if mark in first and mark != decimal]
    reads: Any = pd.read_csv
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # of numbers without a column
            table = reads(
                file, sep=marks[0] if marks else r"\s+", decimal=decimal, comment="#",
                skiprows=skip, names=None if names is None else list(names), index_col=False,
                skipinitialspace=True, encoding=encoding, encoding_errors="replace",
            )  # fmt: skip
    except (pd.errors.ParserError, pd.errors.ParserWarning, pd.errors.EmptyDataError) as error:
        told = str(error).strip().splitlines()[0]
        if names is not None and isinstance(error, pd.errors.ParserWarning):
            allowed = f"a name for each column of {file}"
            raise refusal("columns", list(names), allowed) from None
        allowed = "a table of text; skip=N leaves out N lines before it"
        raise refusal("path", str(file), allowed, but=f"unreadable ({told})") from None
    heads = [str(head).strip() for head in table.columns]
    if names is None and all(_is_number(head) for head in heads):
        allowed = "a table whose first line names its columns, or columns=(...) must be given"
        raise refusal("path", str(file), allowed, but=f"which begins with {first.strip()[:60]!r}")
    if not len(table):
        raise refusal("path", str(file), "a table with rows", but="without any")
    found = {head: np.asarray(table.iloc[:, i]) for i, head in enumerate(heads)}
    for head, column in found.items():
        sample = str(column[0])
        is_text = column.dtype.kind not in "biuf"
        if decimal == "." and is_text and "," in sample and _is_number(sample):
            raise refusal("decimal", decimal, "',' for this file", but=f"and {head} holds {sample!r}")
    return found


def _encoding(file: pathlib.Path) -> str:
    """UTF-8, or what instruments wrote before it."""
    with file.open("rb") as data:
        begin = data.read(65536)
    try:
        begin.decode()
    except UnicodeDecodeError as error:
        if error.start < len(begin) - 4:  # not a sign that is cut in two
            return "latin-1"
    return "utf-8-sig"


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _matlab(file: pathlib.Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Numbers and texts by name, and names of all else."""
    import scipy.io

    try:
        found = scipy.io.loadmat(file, simplify_cells=True)
    except NotImplementedError:  # version 7.3
        return _hdf5(file)
    except (ValueError, TypeError, EOFError) as error:
        raise refusal("path", str(file), "a MATLAB file", but=f"unreadable ({error})") from None
    rows: dict[str, np.ndarray] = {}
    others: list[str] = []

    def gather(name: str, value: Any) -> None:
        array = None if isinstance(value, Mapping | list) else np.asarray(value)
        if isinstance(value, Mapping):
            for part, inner in value.items():
                gather(f"{name}.{part}", inner)
        elif array is None or array.dtype.kind == "O":
            _cells(name, list(value), rows, gather)
        elif array.dtype.kind in "biufcU":
            rows[name] = array
        else:
            others.append(name)

    for name, value in found.items():
        if not name.startswith("__"):
            gather(name, value)
    # Objects of MATLAB come without a name.
    others = [name if name != "None" else "an object of MATLAB" for name in others]
    return rows, others


def _cells(name: str, cells: list[Any], rows: dict[str, np.ndarray], gather: Any) -> None:
    """Cells one by one; as one row if all are texts."""
    if cells and all(isinstance(cell, str) for cell in cells):
        rows[name] = np.asarray(cells)
        return
    for i, cell in enumerate(cells):
        gather(f"{name}[{i}]", cell)


def _hdf5(file: pathlib.Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """The same of a file of version 7.3: all of it lies by columns, and cells are references."""
    import h5py

    rows: dict[str, np.ndarray] = {}
    others: list[str] = []

    def gather(name: str, value: Any) -> None:
        if isinstance(value, str):
            rows[name] = np.asarray(value)
        elif isinstance(value, h5py.Group):
            for part, inner in value.items():
                gather(f"{name}.{part}", inner)
        else:
            dataset(name, value)

    def dataset(name: str, node: Any) -> None:
        kind, of_class = node.dtype.kind, _word(node.attrs.get("MATLAB_class", b"double"))
        if "MATLAB_object_decode" in node.attrs or kind not in "biufVO":
            others.append(name)
        elif node.attrs.get("MATLAB_empty", 0):  # what is stored is its shape
            rows[name] = np.asarray("") if of_class == "char" else np.zeros(0)
        elif kind == "O":
            cells = [node.file[reference] for reference in np.ravel(np.asarray(node).T)]
            _cells(name, [text_of(cell) for cell in cells], rows, gather)
        elif kind == "V" and node.dtype.names == ("real", "imag"):
            numbers = np.asarray(node)
            rows[name] = np.squeeze((numbers["real"] + 1j * numbers["imag"]).T)
        elif kind == "V":
            others.append(name)
        else:
            text = text_of(node)
            rows[name] = np.asarray(text) if of_class == "char" else np.squeeze(np.asarray(node).T)

    def text_of(node: Any) -> Any:
        """The text of a node that holds one, else the node; of several lines with their breaks."""
        if not isinstance(node, h5py.Dataset) or _word(node.attrs.get("MATLAB_class", "")) != "char":
            return node
        if node.attrs.get("MATLAB_empty", 0):
            return ""
        letters = np.atleast_2d(np.asarray(node).T)
        return "\n".join("".join(map(chr, line)) for line in letters)

    try:
        with h5py.File(file, "r") as data:
            for name, node in data.items():
                if not name.startswith("#"):
                    gather(name, node)
    except OSError as error:
        raise refusal("path", str(file), "a MATLAB file", but=f"unreadable ({error})") from None
    return rows, others


def _word(text: Any) -> str:
    return text.decode() if isinstance(text, bytes) else str(text)
