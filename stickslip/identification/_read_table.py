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
    numbers; those of a structure are named `data.position`, of cells `runs[0]`. A single row or column
    is one row.

    **Arguments:** `path`; `columns`: names for a table whose first line has none; `decimal`: the
    decimal point, `"."` or `","`; `skip`: how many lines of text come before the table. **Returns**
    arrays by name; text in a column stays text. **Raises** `ValueError` for a file that is not such a
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
        return _matlab(file)
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


def _matlab(file: pathlib.Path) -> dict[str, np.ndarray]:
    import scipy.io

    try:
        found = scipy.io.loadmat(file, simplify_cells=True)
    except NotImplementedError:  # version 7.3
        return _hdf5(file)
    except (ValueError, TypeError, EOFError) as error:
        raise refusal("path", str(file), "a MATLAB file", but=f"unreadable ({error})") from None
    rows: dict[str, np.ndarray] = {}

    def gather(name: str, value: Any) -> None:
        if isinstance(value, Mapping):
            for part, inner in value.items():
                gather(f"{name}.{part}", inner)
        elif isinstance(value, list) or np.asarray(value).dtype.kind == "O":
            for i, inner in enumerate(value):  # cells
                gather(f"{name}[{i}]", inner)
        elif np.asarray(value).dtype.kind in "biuf":
            rows[name] = np.asarray(value)

    for name, value in found.items():
        if not name.startswith("__"):
            gather(name, value)
    return rows


def _hdf5(file: pathlib.Path) -> dict[str, np.ndarray]:
    import h5py

    rows: dict[str, np.ndarray] = {}

    def gather(name: str, node: Any) -> None:
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "biuf" and name[0] != "#":
            if node.attrs.get("MATLAB_class", b"double") != b"char":
                rows[name.replace("/", ".")] = np.squeeze(np.asarray(node).T)  # stored by columns

    try:
        with h5py.File(file, "r") as data:
            data.visititems(gather)
    except OSError as error:
        raise refusal("path", str(file), "a MATLAB file", but=f"unreadable ({error})") from None
    return rows
