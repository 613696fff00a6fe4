"""Spreads the cases of a sweep over an executor: every row once and in order, whatever happens to those who run them.

Cases are handed out in chunks whose size follows the time that cases take: long enough that handing out costs little, short enough that
little is lost where a worker dies, and ever shorter towards the end, so that all end at about the same time. Chunks that come back are kept at
once where there is a `Store`.

What dies is replaced: Dask's scheduler gives the chunks of a worker that died to others, up to its own limit
(`distributed.scheduler.allowed-failures`); a `ProcessPoolExecutor` of which a process died is unusable, and another of the same making takes its
place; a future that somebody cancelled is handed out again. A chunk that was lost three times, or that Dask's scheduler gave up, runs
alone, so that it is known whose fault it is, and when it is lost then too (twice, or given up once more) the sweep ends with a `SweepError` that
names its cases.
"""

from __future__ import annotations

import asyncio
import os
import pickle
import threading
import time
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from concurrent.futures import wait as wait_for
from typing import TYPE_CHECKING, Any

import numpy as np

from bikebot import _bikebot
from bikebot._chunks import Changes, Chunk, Columns, run_chunk
from bikebot._dask import Cluster
from bikebot._errors import SweepError

if TYPE_CHECKING:
    from bikebot._bikebot import Scenario
    from bikebot._resume import Store

#: Seconds of work that a chunk should hold.
CHUNK_SECONDS = 1.0
#: Cases in a chunk as long as nobody knows how long a case takes, and most of them ever.
FIRST_CHUNK, MAX_CHUNK = 4, 256
#: Chunks out for each worker: one that runs, and some that wait beside it.
AHEAD = 3
#: Fewest chunks out, where their size is found here, and where it was given.
MIN_OUT, MIN_OUT_GIVEN = 8, 64
#: Between two looks at what an executor has done, s: Ctrl-C is heard as often.
LOOK = 0.03
#: Between two counts of an executor's workers, s.
COUNT_EVERY = 1.0
#: So long without any worker, s, and people are told; and so long after the last one has gone the sweep ends. For the first one it waits
#: for ever, as long as clusters let people wait.
LONELY, FORSAKEN = 30.0, 300.0
#: Times a chunk may be lost, and from how many on it runs alone.
MAX_LOSSES, SUSPICIOUS = 5, 3


class Stopped(Exception):
    """Ends the work of a thread whose sweep has ended."""


#: Columns, seconds they took, and version of the bikebot that made them.
Done = tuple[Columns, float, str]


def run_timed(chunk: Chunk, attempt: int) -> Done:
    """What an executor is given.

    `attempt` makes a task of its own of a chunk that is handed out again, where tasks are known by their arguments, as by Dask.
    """
    began = time.perf_counter()
    return run_chunk(chunk), time.perf_counter() - began, _bikebot.__version__


class Threads(ThreadPoolExecutor):
    """Threads of this process whose work ends when it is told to."""

    def __init__(self, count: int) -> None:
        super().__init__(count, thread_name_prefix="bikebot sweep")
        self.ended = threading.Event()

    def run(self, chunk: Chunk, attempt: int) -> Done:
        """As `run_timed`."""

        def look(_: float) -> None:
            if self.ended.is_set():
                raise Stopped

        began = time.perf_counter()
        return run_chunk(chunk, progress=look), time.perf_counter() - began, _bikebot.__version__

    def end(self) -> None:
        """Asks what runs to stop, and waits for none of it."""
        self.ended.set()
        self.shutdown(wait=False, cancel_futures=True)


class Spread:
    """A sweep on its way."""

    def __init__(
        self,
        scenario: Scenario,
        varied: Sequence[Changes],
        seeds: Sequence[int],
        executor: Executor,
        size: int | None,
        store: Store | None,
        report: Callable[[float], object] | None,
        follower: Callable[[Any], Any] | None = None,
        balancer: Callable[[Any], Any] | None = None,
    ) -> None:
        self.scenario, self.varied, self.seeds = scenario, varied, seeds
        self.executor, self.size, self.store, self.report = executor, size, store, report
        self.follower, self.balancer = follower, balancer
        #: The pool that took the place of the one given.
        self.own: ProcessPoolExecutor | None = None
        self.parts: dict[int, Columns] = dict(store.load()) if store is not None else {}
        self.done = sum(len(part["seed"]) for part in self.parts.values())
        #: Ranges of cases that nobody has been given.
        self.open: deque[list[int]] = deque(self._gaps())
        #: Chunks that were lost, and how often.
        self.again: deque[tuple[Chunk, int]] = deque()
        self.out: dict[Future[Done], tuple[Chunk, int]] = {}
        self.seconds, self.timed = 0.0, 0
        self.workers, self.counted = 1, -np.inf
        #: When there was last a worker, or a sign of one.
        self.heard = time.monotonic()
        self.had_workers = self.is_told = False

    def _gaps(self) -> list[list[int]]:
        reached, gaps = 0, []
        for first, part in sorted(self.parts.items()):
            if first > reached:
                gaps.append([reached, first])
            reached = first + len(part["seed"])
        if reached < len(self.seeds):
            gaps.append([reached, len(self.seeds)])
        return gaps

    def run(self) -> Columns:
        """All rows."""
        total = len(self.seeds)
        told = -1
        try:
            while True:
                # A part may be on the disk already: even then the share done is told once.
                if self.report is not None and self.done != told:
                    told = self.done
                    self.report(told / total)
                if self.done == total:
                    break
                self._hand_out()
                finished = wait_for(self.out, timeout=LOOK, return_when="FIRST_COMPLETED").done
                for future in finished:
                    self._take(future)
                self._look_after()
        finally:
            for future in self.out:
                future.cancel()
            if self.own is not None:
                self.own.shutdown(wait=False, cancel_futures=True)
        parts = [self.parts[first] for first in sorted(self.parts)]
        columns = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        if any(len(column) != total for column in columns.values()):
            raise AssertionError("a sweep has lost rows: a bug in bikebot, please report it")
        return columns

    def _hand_out(self) -> None:
        if time.monotonic() - self.counted > COUNT_EVERY:
            self.workers, self.counted = workers_of(self.executor), time.monotonic()
            if self.workers > 0:
                self.heard, self.had_workers, self.is_told = self.counted, True, False
        ahead = AHEAD * self.workers
        room = max(ahead, MIN_OUT if self.size is None else MIN_OUT_GIVEN)
        while len(self.out) < room:
            if self.again and self.again[0][1] >= SUSPICIOUS:
                # Under suspicion: nothing else may be out, so that nothing else is to blame.
                if not self.out:
                    self._submit(*self.again.popleft())
                return
            if self.again:
                chunk, losses = self.again.popleft()
            elif self.open and not any(losses >= SUSPICIOUS for _, losses in self.out.values()):
                chunk, losses = self._next(), 0
            else:
                return
            self._submit(chunk, losses)

    def _next(self) -> Chunk:
        first, end = self.open[0]
        last = min(end, first + self._size())
        if last == end:
            self.open.popleft()
        else:
            self.open[0][0] = last
        varied, seeds = tuple(self.varied[first:last]), tuple(self.seeds[first:last])
        return Chunk(self.scenario, first, varied, seeds, self.follower, self.balancer)

    def _size(self) -> int:
        if self.size is not None:
            return self.size
        left = sum(end - first for first, end in self.open)
        fair = -(-left // (AHEAD * max(self.workers, 1)))
        if self.timed == 0:
            return max(1, min(FIRST_CHUNK, fair))
        wanted = CHUNK_SECONDS * self.timed / max(self.seconds, 1e-9)
        return max(1, min(int(min(wanted, MAX_CHUNK)), fair))

    def _submit(self, chunk: Chunk, losses: int) -> None:
        executor = self.own or self.executor
        work = executor.run if isinstance(executor, Threads) else run_timed
        try:
            future = executor.submit(work, chunk, losses)
        except BrokenExecutor as error:
            self.again.appendleft((chunk, losses))
            self._replace(error)
            return
        except RuntimeError as error:
            raise ValueError(f"executor takes no work: {error}") from error
        self.out[future] = (chunk, losses)

    def _take(self, future: Future[Done]) -> None:
        chunk, losses = self.out.pop(future)
        try:
            columns, seconds, version = future.result()
        except (CancelledError, asyncio.CancelledError, BrokenExecutor) as error:
            self._lost(chunk, losses + 1, error)
            return
        except Exception as error:
            if type(error).__name__ == "KilledWorker":
                # Dask's scheduler gave it up. It may only have waited beside the one at fault: alone it has another chance.
                self._lost(chunk, losses + 1 if losses else MAX_LOSSES - 1, error)
                return
            # What a worker raised ends the sweep.
            raise
        if version != _bikebot.__version__:
            raise SweepError(
                f"a worker has bikebot {version}, and {_bikebot.__version__} is here: rows of two versions do not belong in one table"
            )
        self.heard = time.monotonic()
        self.seconds += seconds
        self.timed += len(chunk)
        if self.store is not None:
            self.store.add(chunk.first, columns)
        self.parts[chunk.first] = columns
        self.done += len(chunk)

    def _lost(self, chunk: Chunk, losses: int, error: BaseException) -> None:
        if losses >= MAX_LOSSES:
            what = str(error).partition(". ")[0] or "it was cancelled"
            raise _given_up(chunk, what) from error
        self.again.append((chunk, losses))
        # Those with the most losses first, the earliest first among equals.
        self.again = deque(sorted(self.again, key=lambda it: (-it[1], it[0].first)))
        if isinstance(error, BrokenExecutor):
            self._replace(error)

    def _replace(self, error: BrokenExecutor) -> None:
        """Another pool for one that is broken."""
        broken = self.own or self.executor
        if not isinstance(broken, ProcessPoolExecutor):
            raise SweepError(
                f"the executor is broken ({error}), and only a ProcessPoolExecutor can be replaced here: make a new one and sweep again;"
                " with resume=… what is done is kept"
            ) from error
        if not getattr(broken, "_broken", True):
            return
        if broken is self.own:
            broken.shutdown(wait=False)
        attributes: Any = broken
        self.own = ProcessPoolExecutor(
            attributes._max_workers,
            mp_context=attributes._mp_context,
            initializer=attributes._initializer,
            initargs=attributes._initargs,
        )

    def _look_after(self) -> None:
        """Says so where nobody is there to work, and ends where nobody is left."""
        if self.workers > 0:
            return
        lonely = time.monotonic() - self.heard
        if self.had_workers and lonely > FORSAKEN:
            raise SweepError(
                f"all workers of the cluster have gone, and none has come for {FORSAKEN:.0f} s; with resume=… what is done is kept"
            )
        if lonely > LONELY and not self.is_told:
            self.is_told = True
            warnings.warn("the cluster has no workers: the sweep waits for some", RuntimeWarning, stacklevel=4)


def _given_up(chunk: Chunk, why: str) -> SweepError:
    first, last = chunk.first, chunk.first + len(chunk) - 1
    cases = f"case {first}" if first == last else f"cases {first} to {last}"
    advice = "" if first == last else "; chunk=1 tells which case it is"
    return SweepError(
        f"{cases} cannot be run: the workers that try die, each time ({why}); is there memory enough?{advice}; with resume=… what is done"
        " is kept",
        cases=(first, last),
    )


def workers_of(executor: Executor) -> int:
    """How many chunks an executor runs at the same time, as far as it tells."""
    if isinstance(executor, Cluster):
        return executor.workers
    workers = getattr(executor, "_max_workers", None)
    return workers if isinstance(workers, int) else (os.cpu_count() or 1)


def must_travel(name: str, thing: object, executor: Executor) -> None:
    """Raises `TypeError` where an argument of that name cannot be sent to the processes of an executor."""
    if isinstance(executor, Cluster):
        # As Dask sends it.
        import cloudpickle

        dumps: Callable[[object], bytes] = cloudpickle.dumps
    elif isinstance(executor, ProcessPoolExecutor):
        dumps = pickle.dumps
    else:
        return
    try:
        dumps(thing)
    except Exception as error:
        raise TypeError(
            f"{name} cannot be sent to the processes of the executor: {error}; define it at the top level of a module, not as a lambda or"
            " inside of a function, and let it hold only what pickles; or sweep without an executor"
        ) from error
