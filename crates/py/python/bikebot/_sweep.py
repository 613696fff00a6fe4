"""Sweeps: one scenario, many values and seeds, one row each; on threads, or on whatever an executor has.

A sweep is cut into chunks. A `Chunk` is plain data that pickles (a scenario with its files, changes, seeds) and `run_chunk`, a function of
this module, turns it into columns. So any executor will do, in this process or on other machines, and the rows are the same to the
last bit and in the same order whoever runs them.
"""

from __future__ import annotations

import csv
import itertools
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from concurrent.futures import wait as wait_for
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot
from bikebot._progress import reporter

if TYPE_CHECKING:
    import pandas

    from bikebot._bikebot import Scenario
    from bikebot._progress import Progress
    from bikebot._types import Integer

#: Most rows of one sweep.
MAX_ROWS = 1_000_000
#: Chunks a worker of an executor is given on average: enough to even out rides of different lengths.
CHUNKS_PER_WORKER = 8
#: Most cases in a chunk that an executor is given where nothing else is said.
MAX_CHUNK = 256
#: Between two looks at what an executor has done, s: Ctrl-C is heard as often.
LOOK = 0.03

Changes = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Chunk:
    """A part of a sweep: plain data, to be run anywhere by `run_chunk`."""

    scenario: Scenario
    """The scenario, with its changes and files."""
    first: int
    """Number of its first case."""
    varied: tuple[Changes, ...]
    """The changes of each case: pairs of a dotted key and a value in TOML."""
    seeds: tuple[int, ...]
    """The seed of each case."""

    def __len__(self) -> int:
        return len(self.seeds)


def run_chunk(chunk: Chunk, *, threads: int = 1) -> dict[str, npt.NDArray[Any]]:
    """Runs the cases of a chunk: columns by name, a row for each case in order."""
    return _arrays(
        _bikebot._run_cases(
            chunk.scenario,
            [list(changes) for changes in chunk.varied],
            list(chunk.seeds),
            threads=threads,
            progress=None,
        )
    )


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

    def to_arrow(self) -> Any:
        """A `pyarrow.Table` (`pip install bikebot[arrow]`), which polars takes without a copy."""
        try:
            import pyarrow
        except ImportError as error:
            raise ImportError("to_arrow needs pyarrow: pip install bikebot[arrow]") from error
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

    def to_parquet(self, path: str | os.PathLike[str]) -> None:
        """Writes the rows as Parquet (`pip install bikebot[arrow]`)."""
        table = self.to_arrow()
        import pyarrow.parquet

        pyarrow.parquet.write_table(table, path)

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


def _arrays(columns: Mapping[str, Any]) -> dict[str, npt.NDArray[Any]]:
    return {
        name: np.array(column, dtype=np.str_) if isinstance(column, list) else column
        for name, column in columns.items()
    }


def _values(key: str, values: Any) -> list[Any]:
    if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
        raise TypeError(f"vary[{key!r}] takes the values as a list or an array, not {values!r}")
    if isinstance(values, np.ndarray):
        found = values.tolist()
    else:
        found = list(itertools.islice(values, MAX_ROWS + 1))
    if not isinstance(found, list) or not found:
        raise ValueError(f"vary[{key!r}] holds no values")
    return found


def _seeds(seeds: Any, scenario: Scenario) -> list[int]:
    if seeds is None:
        return [scenario.seed]
    if isinstance(seeds, (str, bytes)) or not isinstance(seeds, Iterable):
        raise TypeError(f"seeds takes whole numbers, such as range(20), not {seeds!r}")
    found: list[int] = []
    for seed in seeds:
        if isinstance(seed, bool) or not hasattr(seed, "__index__"):
            raise TypeError(f"seeds holds {seed!r}: it takes whole numbers, such as range(20)")
        number = int(seed.__index__())
        if not 0 <= number < 2**63:
            raise ValueError(f"seeds holds {number}: a seed is from 0 to 2**63 - 1")
        found.append(number)
        if len(found) > MAX_ROWS:
            raise ValueError(f"more than {MAX_ROWS} seeds")
    if not found:
        raise ValueError("seeds is empty: give at least one, such as range(20)")
    return found


def sweep(
    scenario: Scenario,
    *,
    vary: Mapping[str, Sequence[Any] | npt.NDArray[Any]] | None = None,
    seeds: Iterable[Integer] | None = None,
    executor: Executor | None = None,
    threads: Integer | None = None,
    chunk: Integer | None = None,
    progress: Progress | None = None,
) -> Table:
    """Runs a scenario over all combinations of values and seeds: a table with a row for each.

    `vary` maps dotted keys of the scenario to values; `seeds` are the seeds of each combination (the scenario's own where none are given).
    The first key varies slowest, the seed fastest. Columns: `case`, the keys, `seed`, `outcome`, `reason`, `passed`, the metrics (NaN
    where one does not apply), `result_hash`, and `error` for a case that made no sense.

    Without an `executor` it runs on `threads` threads (one per core where not given). An executor is anything of
    `concurrent.futures`, or what Dask's `client.get_executor()` gives; it is handed chunks of `chunk` cases. The rows are the same, bit for bit
    and in the same order, for any of these.

    Raises `ScenarioError` before the first run for a value that a scenario does not have, and whatever a worker raised.

    >>> from bikebot import Scenario
    >>> scenario = Scenario.from_text('''
    ... format = 1
    ... name = "stand"
    ... [plant]
    ... model = "two_link"
    ... [run]
    ... duration_s = 1.0
    ... ''')
    >>> table = sweep(scenario, vary={"start.roll_deg": [1.0, 2.0]}, seeds=range(2))
    >>> table["start.roll_deg"].tolist(), table["seed"].tolist()
    ([1.0, 1.0, 2.0, 2.0], [0, 1, 0, 1])
    """
    if not isinstance(scenario, _bikebot.Scenario):
        raise TypeError(f"scenario takes a bikebot.Scenario, not {type(scenario).__name__}")
    if vary is not None and not isinstance(vary, Mapping):
        raise TypeError(f"vary takes a dict of keys to values, not {type(vary).__name__}")
    if executor is not None and not (hasattr(executor, "submit") and hasattr(executor, "map")):
        raise TypeError(
            f"executor takes a concurrent.futures.Executor, not {type(executor).__name__};"
            " a Dask client gives one by client.get_executor()"
        )
    for name, count in (("threads", threads), ("chunk", chunk)):
        if count is None:
            continue
        if isinstance(count, bool) or not hasattr(count, "__index__"):
            raise TypeError(f"{name} takes a whole number, not {count!r}")
        if not 1 <= int(count.__index__()) <= MAX_ROWS:
            raise ValueError(f"{name} is {count}: it takes a whole number from 1 to {MAX_ROWS}")
    if executor is not None and threads is not None:
        raise ValueError("threads is for sweeps without an executor: the executor has its own")
    keys = {key: _values(key, values) for key, values in (vary or {}).items()}
    for key in keys:
        if not isinstance(key, str):
            raise TypeError(f"vary has the key {key!r}: keys are str")
    if "run.seed" in keys:
        raise ValueError("vary has the key 'run.seed': give the seeds as seeds=…")
    chosen = _seeds(seeds, scenario)
    total = len(chosen)
    for values in keys.values():
        total *= len(values)
    if total > MAX_ROWS:
        raise ValueError(f"the sweep has {total} rows: at most {MAX_ROWS} are run")
    written = {
        key: [_bikebot._toml(f"vary[{key!r}][{i}]", value) for i, value in enumerate(values)]
        for key, values in keys.items()
    }
    combinations = list(itertools.product(*written.values()))
    varied: list[Changes] = [
        tuple(zip(written, combination, strict=True))
        for combination in combinations
        for _ in chosen
    ]
    case_seeds = chosen * len(combinations)
    report = reporter(progress, scenario.name)
    if executor is None:
        count = 0 if threads is None else int(threads.__index__())
        columns = _arrays(
            _bikebot._run_cases(
                scenario, [list(it) for it in varied], case_seeds, threads=count, progress=report
            )
        )
    else:
        _bikebot._check_cases(scenario, [list(it) for it in varied[:: len(chosen)]])
        size = None if chunk is None else int(chunk.__index__())
        columns = _spread(scenario, varied, case_seeds, executor, size, report)
    laid = list(itertools.product(*keys.values()))
    table: dict[str, npt.NDArray[Any]] = {"case": np.arange(total)}
    for index, key in enumerate(keys):
        table[key] = _column([values[index] for values in laid for _ in chosen])
    return Table({**table, **columns})


def _column(values: list[Any]) -> npt.NDArray[Any]:
    """Values of one key; lists and dicts stay objects."""
    if any(isinstance(value, (list, tuple, dict, np.ndarray)) for value in values):
        column = np.empty(len(values), dtype=object)
        column[:] = values
        return column
    return np.array(values)


def cut(
    scenario: Scenario, varied: Sequence[Changes], seeds: Sequence[int], size: int
) -> list[Chunk]:
    """The chunks of a sweep, in order."""
    return [
        Chunk(scenario, first, tuple(varied[first : first + size]), tuple(seeds[first : first + size]))
        for first in range(0, len(seeds), size)
    ]


def _spread(
    scenario: Scenario,
    varied: Sequence[Changes],
    seeds: Sequence[int],
    executor: Executor,
    size: int | None,
    report: Any,
) -> dict[str, npt.NDArray[Any]]:
    if size is None:
        workers = getattr(executor, "_max_workers", None)
        workers = workers if isinstance(workers, int) else (os.cpu_count() or 1)
        size = max(1, min(MAX_CHUNK, -(-len(seeds) // (CHUNKS_PER_WORKER * workers))))
    chunks = cut(scenario, varied, seeds, size)
    futures: list[Future[dict[str, npt.NDArray[Any]]]] = []
    try:
        for chunk in chunks:
            futures.append(executor.submit(run_chunk, chunk))
        pending = set(futures)
        while pending:
            done, pending = wait_for(pending, timeout=LOOK, return_when="FIRST_EXCEPTION")
            for future in done:
                # What a worker raised ends the sweep.
                future.result()
            if report is not None:
                report(1.0 - len(pending) / len(futures))
        parts = [future.result() for future in futures]
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
