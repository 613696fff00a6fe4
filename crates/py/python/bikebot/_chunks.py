"""Chunks: parts of a sweep as plain data, to be run anywhere."""

from __future__ import annotations

import copy
import hashlib
import pickle
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import CellType, CodeType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot
from bikebot._errors import BikebotError

if TYPE_CHECKING:
    from bikebot._bikebot import Ride, Scenario

#: Pairs of a dotted key and a value in TOML.
Changes = tuple[tuple[str, str], ...]
Columns = dict[str, npt.NDArray[Any]]


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
    follower: Callable[[Any], Any] | None = None
    """A follower of yours, as `Scenario.run` takes it."""
    balancer: Callable[[Any], Any] | None = None
    """A balance law of yours."""

    def __len__(self) -> int:
        return len(self.seeds)


def run_chunk(
    chunk: Chunk, *, threads: int = 1, progress: Callable[[float], object] | None = None
) -> Columns:
    """Runs the cases of a chunk: columns by name, a row for each case in order."""
    if chunk.follower is not None or chunk.balancer is not None:
        return _run_own(chunk, progress)
    return arrays(
        _bikebot._run_cases(
            chunk.scenario,
            [list(changes) for changes in chunk.varied],
            list(chunk.seeds),
            threads=threads,
            progress=progress,
        )
    )


def _run_own(chunk: Chunk, progress: Callable[[float], object] | None) -> Columns:
    """As Rust does it, with controllers of Python: one ride after another, each with a fresh copy of them."""
    reduced: Any = chunk.scenario.__reduce__()
    text, changes, file, folder, files = reduced[1]
    rows: list[Ride | str] = []
    for varied, seed in zip(chunk.varied, chunk.seeds, strict=True):
        all_changes = [*changes, *varied, ("run.seed", str(seed))]
        follower, balancer = _afresh("follower", chunk.follower), _afresh("balancer", chunk.balancer)
        try:
            case = type(chunk.scenario)._restore(text, all_changes, file, folder, files)
            # Asked while it rides, so that it can be ended.
            rows.append(case.run(follower=follower, balancer=balancer, progress=progress))
        except BikebotError as error:
            rows.append(str(error))
    rides = [None if isinstance(row, str) else row for row in rows]

    def text_of(pick: Callable[[Ride], str], other: str) -> npt.NDArray[np.str_]:
        return np.array([other if ride is None else pick(ride) for ride in rides], dtype=np.str_)

    def metric(name: str) -> npt.NDArray[np.float64]:
        return np.array([np.nan if ride is None else ride.metrics.get(name, np.nan) for ride in rides])

    return {
        "seed": np.array(chunk.seeds, dtype=np.int64),
        "outcome": text_of(lambda ride: ride.outcome, "invalid"),
        "reason": text_of(lambda ride: ride.reason, ""),
        "passed": np.array([ride is not None and ride.passed for ride in rides], dtype=np.bool_),
        **{name: metric(name) for name in _bikebot._metric_names()},
        "result_hash": text_of(lambda ride: ride.result_hash, ""),
        "error": np.array([row if isinstance(row, str) else "" for row in rows], dtype=np.str_),
    }


def _afresh(name: str, controller: Callable[[Any], Any] | None) -> Callable[[Any], Any] | None:
    """A controller as it was given, whatever the rides before did to it."""
    try:
        return copy.deepcopy(controller)
    except Exception as error:
        raise TypeError(
            f"{name} cannot be copied for each ride: {error}; let it hold only what copy.deepcopy copies, or give it a __deepcopy__"
        ) from error


def told_apart(controller: Callable[[Any], Any] | None) -> str | None:
    """What tells a controller from another: its name, its code, and what it holds; not the functions it calls, and no globals."""
    if controller is None:
        return None
    function = getattr(controller, "__func__", controller)
    is_function = hasattr(function, "__code__")
    code = getattr(function if is_function else type(controller).__call__, "__code__", None)
    held: list[Any] = [getattr(controller, "__self__", None) if is_function else controller]
    if is_function:
        held += [getattr(function, "__defaults__", None), getattr(function, "__kwdefaults__", None)]
        held += getattr(function, "__closure__", None) or ()
    digest = hashlib.sha256(repr(_told(code)).encode())
    for it in held:
        try:
            digest.update(pickle.dumps(it.cell_contents if isinstance(it, CellType) else it, protocol=4))
        except Exception:
            # What cannot be pickled, or is not there yet, is told apart by its type at least.
            digest.update(type(it).__qualname__.encode())
    name = getattr(function, "__qualname__", type(controller).__qualname__)
    return f"{name} {digest.hexdigest()[:16]}"


def _told(code: Any) -> Any:
    """A code object without the places it was read from."""
    if not isinstance(code, CodeType):
        return code if isinstance(code, (int, float, str, bytes, tuple, type(None))) else repr(type(code))
    return (code.co_code, code.co_names, tuple(_told(it) for it in code.co_consts))


def arrays(columns: Mapping[str, Any]) -> Columns:
    """Lists of text as arrays."""
    return {
        name: np.array(column, dtype=np.str_) if isinstance(column, list) else column
        for name, column in columns.items()
    }


def cut(
    scenario: Scenario, varied: Sequence[Changes], seeds: Sequence[int], size: int
) -> list[Chunk]:
    """The chunks of a sweep, in order."""
    return [
        Chunk(scenario, first, tuple(varied[first : first + size]), tuple(seeds[first : first + size]))
        for first in range(0, len(seeds), size)
    ]
