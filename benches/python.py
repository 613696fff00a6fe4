"""What Python costs: beside the criterion benches, for the installed package.

    python benches/python.py            a minute or two
    python benches/python.py --full     the sweep of 2000 runs

With the program built (target/release/bikebot, or BIKEBOT_PROGRAM) its own figure for the same plans stands beside.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path

import bikebot

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "scenarios"


def median_of(times: list[float]) -> float:
    return statistics.median(times)


def timed(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def plans(count: int = 60) -> None:
    """`plan` on the yard of the paper's Table 2, from Python and from Rust, with the same seeds."""
    path = SCENARIOS / "planning" / "fig6.toml"
    scenario = bikebot.Scenario.load(path)
    scenario.plan()
    outside, inside = [], []
    for seed in range(1, count + 1):
        began = time.perf_counter()
        plan = scenario.plan(seed=seed)
        outside.append(time.perf_counter() - began)
        inside.append(plan.time)
    ratio = median_of([a / b for a, b in zip(outside, inside, strict=True)])
    print(f"plan, fig6: {1e3 * median_of(outside):.3f} ms from Python, {ratio:.4f} of the Rust call inside it")
    program = os.environ.get("BIKEBOT_PROGRAM", str(ROOT / "target" / "release" / "bikebot"))
    if Path(program).is_file():
        command = [program, "plan", str(path), "--runs", str(count), "--seed", "1", "--json"]
        lines = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
        there = median_of([json.loads(line)["time_s"] for line in lines])
        print(f"plan, fig6: {1e3 * there:.3f} ms in the program; Python over program {median_of(outside) / there:.3f}")


def overhead(count: int = 5000) -> None:
    """A call whose search is over at once."""
    world = bikebot.World.from_shapes((0, 0, 10, 10))
    planner = bikebot.Planner(world)
    question = {"start": (5.0, 5.0, 0.0), "goal": (5.0, 5.0)}
    for name, call in (
        ("Planner.plan", lambda: planner.plan(**question)),
        ("plan", lambda: bikebot.plan(world, **question)),
    ):
        call()
        costs = []
        for _ in range(count):
            began = time.perf_counter()
            plan = call()
            costs.append(time.perf_counter() - began - plan.time)
        print(f"overhead of {name}: {1e6 * median_of(costs):.1f} µs")


def pace(seconds: float = 1.0) -> None:
    """Another Python thread beside a plan, and beside another process."""
    scenario = bikebot.Scenario.load(SCENARIOS / "planning" / "fig6.toml")
    tireless = scenario.with_(planner={"starts": 10**9, "starts_without_gain": 10**9})

    def rounds(work: Callable[[], object]) -> float:
        count, going = 0, True

        def run() -> None:
            nonlocal count
            while going:
                count += 1

        thread = threading.Thread(target=run)
        thread.start()
        took = timed(work)
        going = False
        thread.join()
        return count / took

    # Another process that is as busy shares the machine, and no interpreter.
    code = f"import time; end = time.perf_counter() + {seconds}\nwhile time.perf_counter() < end: pass"
    alone = rounds(lambda: subprocess.run([sys.executable, "-S", "-c", code], check=True))
    beside = rounds(lambda: tireless.plan(time_limit=seconds))
    print(f"pace of another thread: {100 * beside / alone:.0f} %")


def sweeps(full: bool) -> None:
    """A sweep on one thread and on two."""
    scenario = bikebot.Scenario.load(SCENARIOS / "course.toml")
    count = 2000 if full else 200
    tables, times = [], []
    for threads in (1, 2):
        began = time.perf_counter()
        tables.append(bikebot.sweep(scenario, seeds=range(count), threads=threads))
        times.append(time.perf_counter() - began)
    assert tables[0].equals(tables[1])
    print(
        f"sweep of {count} runs: {times[0]:.1f} s on one thread, {times[1]:.1f} s on two: {times[0] / times[1]:.2f} times as fast"
    )


def main() -> None:
    print(f"bikebot {bikebot.__version__}, Python {sys.version.split()[0]}, {os.cpu_count()} cores")
    plans()
    overhead()
    pace()
    sweeps("--full" in sys.argv)


if __name__ == "__main__":
    main()
