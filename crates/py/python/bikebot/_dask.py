"""A Dask cluster as an executor.

Dask's own (`client.get_executor()`) takes a result that is lost with its worker, on the way here, for an error: so its futures are not used, and
results are fetched by the client, which has what is lost computed again.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor, Future
from typing import Any

#: After so long, s, a result that is ready and has not come is asked for again: the worker that has it may be dead, and Dask, which
#: then tries to reach it for `distributed.comm.timeouts.connect` (30 s), have had it computed elsewhere by now.
ASK_AGAIN = 2.0
#: Questions after the same result.
MOST_ASKED = 10


class Cluster(Executor):
    """Hands work to the workers of a Dask client."""

    def __init__(self, client: Any, options: dict[str, Any]) -> None:
        if getattr(client, "asynchronous", False):
            raise ValueError("executor is an asynchronous Dask client: a sweep needs one that is not")
        self.client, self.options = client, options

    @property
    def workers(self) -> int:
        """Threads of all workers that are there now."""
        return int(sum(self.client.nthreads().values()))

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """As of any executor."""
        task = self.client.submit(fn, *args, **{**self.options, **kwargs})
        loop: asyncio.AbstractEventLoop = self.client.loop.asyncio_loop
        return asyncio.run_coroutine_threadsafe(_fetch(self.client, task), loop)


async def _fetch(client: Any, task: Any) -> Any:
    """The result of a task, wherever and how often it has to be computed."""
    asked: set[asyncio.Future[Any]] = set()
    try:
        while True:
            if not asked or (task.status == "finished" and len(asked) < MOST_ASKED):
                asked.add(asyncio.ensure_future(_ask(task)))
            done, asked = await asyncio.wait(
                asked, timeout=ASK_AGAIN, return_when=asyncio.FIRST_COMPLETED
            )
            for answer in done:
                return answer.result()
    except asyncio.CancelledError:
        # Nobody waits any more.
        await client.cancel([task], asynchronous=True)
        raise
    finally:
        for answer in asked:
            answer.cancel()


async def _ask(task: Any) -> Any:
    return await task


def cluster_of(given: Any) -> Cluster | None:
    """For a Dask client, or its executor; None for anything else."""
    if hasattr(given, "get_executor") and hasattr(given, "nthreads"):
        return Cluster(given, {})
    client = getattr(given, "_client", None)
    if client is None or not type(given).__module__.startswith("distributed."):
        return None
    if getattr(given, "_shutdown", False):
        raise ValueError("executor takes no work: it was shut down")
    return Cluster(client, dict(getattr(given, "_kwargs", {})))
