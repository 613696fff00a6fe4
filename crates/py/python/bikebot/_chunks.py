"""Chunks: parts of a sweep as plain data, to be run anywhere."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot

if TYPE_CHECKING:
    from bikebot._bikebot import Scenario

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

    def __len__(self) -> int:
        return len(self.seeds)


def run_chunk(
    chunk: Chunk, *, threads: int = 1, progress: Callable[[float], object] | None = None
) -> Columns:
    """Runs the cases of a chunk: columns by name, a row for each case in order."""
    return arrays(
        _bikebot._run_cases(
            chunk.scenario,
            [list(changes) for changes in chunk.varied],
            list(chunk.seeds),
            threads=threads,
            progress=progress,
        )
    )


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
