"""Sweeps on pools of processes: however they start, and when they die."""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import pytest

import bikebot
from bikebot import _spread

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

SEEDS = range(40)
VARY = {"start.roll_deg": [1.0, 2.0, 3.0]}
#: The case that kills every process that runs it.
DEADLY = 41


@pytest.fixture(scope="module")
def ride(stand):
    """A ride of some milliseconds."""
    return stand.with_(run={"duration_s": 6.0})


@pytest.fixture(scope="module")
def table(ride):
    return bikebot.sweep(ride, vary=VARY, seeds=SEEDS)


def pool(start: str, initializer=None) -> ProcessPoolExecutor:
    context = multiprocessing.get_context(start)
    return ProcessPoolExecutor(2, mp_context=context, initializer=initializer)


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_processes_that_inherit_nothing_give_the_same_rows(ride, table, start):
    with pool(start) as executor:
        assert bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=executor).equals(table)


def test_a_process_killed_in_mid_sweep_is_replaced(ride, table):
    with pool("spawn") as executor:
        killed = []

        def kill(share: float) -> None:
            if share > 0.2 and not killed:
                killed.append(share)
                os.kill(next(iter(executor._processes)), signal.SIGKILL)

        again = bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=executor, chunk=3, progress=kill)
    assert killed and killed[0] < 1.0
    assert again.equals(table)


def die_of_one_case() -> None:
    """Makes a process one that does not survive `DEADLY`."""
    run = _spread.run_chunk

    def run_or_die(chunk: bikebot.Chunk):
        if chunk.first <= DEADLY < chunk.first + len(chunk):
            os.kill(os.getpid(), signal.SIGKILL)
        return run(chunk)

    _spread.run_chunk = run_or_die


def test_a_case_that_kills_whoever_runs_it_ends_the_sweep_and_is_named(ride, tmp_path):
    with pool("spawn", die_of_one_case) as executor:
        with pytest.raises(bikebot.SweepError) as caught:
            bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=executor, chunk=5, resume=tmp_path)
    assert caught.value.cases == (40, 44)
    for word in ("cases 40 to 44", "die, each time", "chunk=1", "resume"):
        assert word in str(caught.value)
    # What others did meanwhile is kept.
    assert len(list(tmp_path.glob("cases-*.npz"))) >= 8


def test_work_that_was_cancelled_is_handed_out_again(ride, table):
    class Fickle(ThreadPoolExecutor):
        """Cancels every third piece of work."""

        def __init__(self):
            super().__init__(2)
            self.count = 0

        def submit(self, function, /, *arguments):
            self.count += 1
            if self.count % 3 == 0:
                lost: Future = Future()
                lost.cancel()
                lost.set_running_or_notify_cancel()
                return lost
            return super().submit(function, *arguments)

    with Fickle() as executor:
        assert bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=executor, chunk=7).equals(table)


def test_an_executor_that_never_keeps_what_it_is_given_ends_in_an_error(ride):
    class Forgetful(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            lost: Future = Future()
            lost.cancel()
            lost.set_running_or_notify_cancel()
            return lost

    with Forgetful(1) as executor, pytest.raises(bikebot.SweepError, match="cases 0 to 9"):
        bikebot.sweep(ride, seeds=SEEDS, executor=executor, chunk=10)


def test_workers_of_another_version_are_told(ride):
    class Older(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            return super().submit(lambda: (*function(*arguments)[:2], "0.0.1"))

    with Older(1) as executor, pytest.raises(bikebot.SweepError, match="bikebot 0.0.1, and"):
        bikebot.sweep(ride, seeds=range(3), executor=executor)


def test_an_executor_that_was_shut_down_is_refused(ride):
    executor = ThreadPoolExecutor(1)
    executor.shutdown()
    with pytest.raises(ValueError, match="executor takes no work"):
        bikebot.sweep(ride, seeds=SEEDS, executor=executor)


def test_chunks_follow_the_time_that_cases_take(ride, stand):
    sizes = []

    class Watched(ThreadPoolExecutor):
        def submit(self, function, chunk, attempt):
            sizes.append(len(chunk))
            return super().submit(function, chunk, attempt)

    with Watched(2) as executor:
        bikebot.sweep(stand, seeds=range(3000), executor=executor)
    # A ride of a millisecond: some of a few to learn that, then as many as there may be, and fewer towards the end.
    assert sizes[0] <= _spread.FIRST_CHUNK and max(sizes) == _spread.MAX_CHUNK
    assert sizes[-1] < 10 and sum(sizes) == 3000 and len(sizes) < 100
