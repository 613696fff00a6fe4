"""Tables: columns by name; into pandas, polars and Arrow, to Parquet and CSV, and back."""

from __future__ import annotations

import csv
import os
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot

if TYPE_CHECKING:
    import pandas
    import polars


class Table(Mapping[str, npt.NDArray[Any]]):
    """Columns by name, each an array with an entry for each row: a mapping.

    >>> table = Table({"seed": np.array([1, 2]), "passed": np.array([True, False])})
    >>> float(table["passed"].mean()), len(table), table.rows
    (0.5, 2, 2)
    >>> table.row(1)
    {'seed': 2, 'passed': False}
    """

    def __init__(self, columns: Mapping[str, npt.NDArray[Any]]) -> None:
        self._columns = dict(columns)
        lengths = {len(column) for column in self._columns.values()}
        if len(lengths) > 1:
            raise ValueError(f"columns of different lengths: {sorted(lengths)}")
        self._rows = lengths.pop() if lengths else 0

    @property
    def rows(self) -> int:
        """How many rows there are."""
        return self._rows

    def row(self, index: int) -> dict[str, Any]:
        """One row, as plain values."""
        return {name: column[index].item() for name, column in self._columns.items()}

    def __getitem__(self, name: str) -> npt.NDArray[Any]:
        try:
            return self._columns[name]
        except KeyError:
            raise KeyError(f"no column {name!r}: there are {', '.join(self._columns)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def equals(self, other: Table) -> bool:
        """Whether both hold the same names, types and bits in the same order."""
        if not isinstance(other, Table) or list(self) != list(other):
            return False
        pairs = ((self[name], other[name]) for name in self)
        return all(
            a.dtype.kind == b.dtype.kind
            and a.shape == b.shape
            and (
                a.tobytes() == b.tobytes() if a.dtype.kind == "f" else bool(np.array_equal(a, b))
            )
            for a, b in pairs
        )

    def to_pandas(self) -> pandas.DataFrame:
        """A pandas DataFrame (`pip install bikebot[pandas]`)."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("to_pandas needs pandas: pip install bikebot[pandas]") from error
        frame: pandas.DataFrame = pandas.DataFrame(
            {name: _plain(column) for name, column in self._columns.items()}
        )
        return frame

    def to_polars(self) -> polars.DataFrame:
        """A polars DataFrame (`pip install bikebot[polars]`)."""
        try:
            import polars
        except ImportError as error:
            raise ImportError("to_polars needs polars: pip install bikebot[polars]") from error
        columns = self._columns.items()
        return polars.DataFrame(
            {name: it if it.dtype.kind in "bif" else it.tolist() for name, it in columns}
        )

    def to_arrow(self) -> Any:
        """A `pyarrow.Table` (`pip install bikebot[arrow]`); NaN stays NaN."""
        pyarrow = _pyarrow("to_arrow")
        columns = {}
        for name, column in self._columns.items():
            columns[name] = pyarrow.array(_plain(column), from_pandas=False)
        return pyarrow.table(columns)

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Writes the rows as CSV; numbers keep all their digits, what does not apply is empty."""
        names = list(self)
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(names)
            for values in zip(*(self[name].tolist() for name in names), strict=True):
                writer.writerow([_field(value) for value in values])

    @staticmethod
    def from_csv(path: str | os.PathLike[str]) -> Table:
        """Reads what `to_csv`, or `bikebot sweep`, wrote: the same numbers to the last bit.

        What was varied comes as whole numbers, numbers or text, whichever fits all rows; lists come as text. Raises `OSError`, and
        `ValueError` for a file that is no such table.
        """
        with open(path, encoding="utf-8", newline="") as file:
            lines = csv.reader(file)
            names = next(lines, [])
            rows = list(lines)
        if not names or any(len(row) != len(names) for row in rows):
            found = next((i for i, row in enumerate(rows, 2) if len(row) != len(names)), 1)
            raise ValueError(f"{os.fspath(path)}: line {found} does not have a field for each column")
        texts = {name: [row[index] for row in rows] for index, name in enumerate(names)}
        try:
            return Table({name: _read(name, column) for name, column in texts.items()})
        except ValueError as error:
            raise ValueError(f"{os.fspath(path)}: {error}") from None

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Writes the rows as Parquet (`pip install bikebot[arrow]`)."""
        _pyarrow("to_parquet")
        table = self.to_arrow()
        import pyarrow.parquet

        pyarrow.parquet.write_table(table, path)

    @staticmethod
    def from_parquet(path: str | os.PathLike[str]) -> Table:
        """Reads what `to_parquet` wrote: the same bits and types (`pip install bikebot[arrow]`)."""
        _pyarrow("from_parquet")
        import pyarrow.parquet

        table = pyarrow.parquet.read_table(path)
        columns = zip(table.column_names, table.columns, strict=True)
        return Table({name: _from_arrow(column) for name, column in columns})

    def __repr__(self) -> str:
        return f"Table({self.rows} rows, {len(self)} columns)"

    def _repr_html_(self) -> str:
        shown = [
            name
            for name, column in self._columns.items()
            if not (column.dtype.kind == "f" and np.isnan(column).all())
        ]
        head = "".join(f"<th>{_escaped(name)}</th>" for name in shown)
        body = "".join(
            "<tr>" + "".join(f"<td>{_cell(self[name][row])}</td>" for name in shown) + "</tr>"
            for row in range(min(self.rows, 20))
        )
        more = f"<p>… {self.rows} rows in all</p>" if self.rows > 20 else ""
        return f"<table><tr>{head}</tr>{body}</table>{more}"


def _plain(column: npt.NDArray[Any]) -> Any:
    return column.astype(object) if column.dtype.kind == "U" else column


def _field(value: Any) -> Any:
    if isinstance(value, float):
        return "" if value != value else repr(value)
    if isinstance(value, bool):
        return "true" if value else "false"
    return value


def _escaped(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _cell(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, np.floating) else _escaped(str(value)[:40])


def _pyarrow(what: str) -> Any:
    try:
        import pyarrow
    except ImportError as error:
        raise ImportError(f"{what} needs pyarrow: pip install bikebot[arrow]") from error
    return pyarrow


def _from_arrow(column: Any) -> npt.NDArray[Any]:
    kind = str(column.type)
    if kind in ("string", "large_string", "string_view"):
        return np.array(column.to_pylist(), dtype=np.str_)
    if kind.startswith(("int", "uint", "float", "double", "bool")):
        return np.asarray(column.to_numpy())
    return column_of(column.to_pylist())


#: Columns of every sweep that are no metrics.
_TEXTS = ("outcome", "reason", "result_hash", "error")


def _read(name: str, texts: list[str]) -> npt.NDArray[Any]:
    """A column of a CSV file."""
    if name in _TEXTS:
        return np.array(texts, dtype=np.str_)
    if name in _bikebot._metric_names():
        return np.array([float(text) if text else np.nan for text in texts], dtype=np.float64)
    if texts and set(texts) <= {"true", "false"}:
        return np.array([text == "true" for text in texts])
    for kind in (np.int64, np.float64):
        try:
            return np.array(texts, dtype=np.str_).astype(kind)
        except (ValueError, OverflowError):
            continue
    return np.array(texts, dtype=np.str_)


def column_of(values: list[Any]) -> npt.NDArray[Any]:
    """Values as a column; lists and dicts stay objects."""
    if any(isinstance(value, (list, tuple, dict, np.ndarray)) for value in values):
        column = np.empty(len(values), dtype=object)
        # One by one: lists of one length would be taken for rows of a matrix.
        for index, value in enumerate(values):
            column[index] = value
        return column
    return np.array(values)
