"""Sweeps: one scenario, many values and seeds, one row each; on threads, or on whatever an executor has.

A sweep is cut into chunks. A `Chunk` is plain data that pickles (a scenario with its files, changes, seeds) and `run_chunk` turns it into
columns. So any executor will do, in this process or on other machines, and the rows are the same to the last bit and in the same order
whoever runs them.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot
from bikebot._chunks import Changes, Chunk, arrays, cut, run_chunk, told_apart
from bikebot._dask import cluster_of
from bikebot._progress import reporter
from bikebot._resume import Store, identity
from bikebot._spread import Spread, Threads, must_travel
from bikebot._table import Table, column_of

if TYPE_CHECKING:
    from bikebot._bikebot import BalancerView, FollowerView, Scenario
    from bikebot._progress import Progress
    from bikebot._types import Integer, Number, Path

__all__ = ["Chunk", "Table", "cut", "run_chunk", "sweep"]

#: Most rows of one sweep.
MAX_ROWS = 1_000_000


class Client(Protocol):
    """What is used of a Dask client."""

    def get_executor(self) -> Any: ...


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
    executor: Executor | Client | None = None,
    threads: Integer | None = None,
    chunk: Integer | None = None,
    resume: Path | None = None,
    follower: Callable[[FollowerView], Sequence[Number] | npt.NDArray[Any]] | None = None,
    balancer: Callable[[BalancerView], Number] | None = None,
    progress: Progress | None = None,
) -> Table:
    """Runs a scenario over all combinations of values and seeds: a table with a row for each.

    `vary` maps dotted keys of the scenario to values; `seeds` are the seeds of each combination (the scenario's own where none are given).
    The first key varies slowest, the seed fastest. Columns: `case`, the keys, `seed`, `outcome`, `reason`, `passed`, the metrics (NaN
    where one does not apply), `result_hash`, and `error` for a case that made no sense.

    Without an `executor` it runs on `threads` threads (one per core where not given). An executor is anything of
    `concurrent.futures`, a Dask client or what its `get_executor()` gives; it is handed chunks of `chunk` cases, or, where that is not given, of
    about a second's work. Workers that die are replaced. The rows are the same, bit for bit and in the same order, for any of these.

    `resume` names a folder in which what is done is kept: the same call goes on from there after an interruption, a crash or a power
    cut, and reads a finished study back at once.

    `follower` and `balancer` are controllers of your own, as `Scenario.run` takes them; each ride gets a fresh copy. Python runs one of them at a
    time, so without an executor they ride one after another: a `ProcessPoolExecutor` or a cluster uses all cores, and needs functions that pickle.

    Raises `ScenarioError` before the first run for a value that a scenario does not have, `ValueError` for a `resume` that holds another study,
    `SweepError` where cases kill every worker that runs them, and whatever a worker raised.

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
    spread_on = _executor(executor)
    for name, count in (("threads", threads), ("chunk", chunk)):
        if count is None:
            continue
        if isinstance(count, bool) or not hasattr(count, "__index__"):
            raise TypeError(f"{name} takes a whole number, not {count!r}")
        if not 1 <= int(count.__index__()) <= MAX_ROWS:
            raise ValueError(f"{name} is {count}: it takes a whole number from 1 to {MAX_ROWS}")
    if spread_on is not None and threads is not None:
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
    workers = 0 if threads is None else int(threads.__index__())
    own = {"follower": follower, "balancer": balancer}
    for name, function in own.items():
        if function is not None and not callable(function):
            raise TypeError(f"{name} takes a function, not {type(function).__name__}")
    has_own = follower is not None or balancer is not None
    if spread_on is None and resume is None and not has_own:
        columns = arrays(
            _bikebot._run_cases(
                scenario, [list(it) for it in varied], case_seeds, threads=workers, progress=report
            )
        )
    else:
        _bikebot._check_cases(scenario, [list(it) for it in varied[:: len(chosen)]])
        codes = {name: told_apart(function) for name, function in own.items()}
        store = None if resume is None else _store(resume, identity(scenario, written, chosen, codes), total)
        size = None if chunk is None else int(chunk.__index__())
        here = None if spread_on is not None else Threads(1 if has_own else workers or os.cpu_count() or 1)
        on = here or spread_on
        assert on is not None
        try:
            for name, thing in {"scenario": scenario, **own}.items():
                must_travel(name, thing, on)
            columns = Spread(scenario, varied, case_seeds, on, size, store, report, follower, balancer).run()
        finally:
            if here is not None:
                here.end()
    laid = list(itertools.product(*keys.values()))
    table: dict[str, npt.NDArray[Any]] = {"case": np.arange(total)}
    for index, key in enumerate(keys):
        table[key] = column_of([values[index] for values in laid for _ in chosen])
    return Table({**table, **columns})


def _executor(given: Any) -> Executor | None:
    """What runs the chunks: a Dask client stands for its cluster."""
    if given is None:
        return None
    cluster = cluster_of(given)
    if cluster is not None:
        return cluster
    if hasattr(given, "submit") and hasattr(given, "map"):
        return given  # type: ignore[no-any-return]
    raise TypeError(
        f"executor takes a concurrent.futures.Executor or a Dask client, not {type(given).__name__}"
    )


def _store(resume: Any, study: dict[str, Any], rows: int) -> Store:
    if not isinstance(resume, (str, os.PathLike)) or not os.fspath(resume):
        raise TypeError(f"resume takes the path of a folder, not {resume!r}")
    return Store(resume, study, rows)
