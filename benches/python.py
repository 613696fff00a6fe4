"""What Python costs: beside the criterion benches, for the installed package.

    python benches/python.py            a minute or two
    python benches/python.py --full     the sweep of 2000 runs, three times on one thread, on two, and through Dask
    python benches/python.py --sweeps   sweeps alone

With the program built (target/release/bikebot, or BIKEBOT_PROGRAM) its own figure for the same plans stands beside.
"""

from __future__ import annotations

import contextlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import bikebot

ROOT = Path(__file__).resolve().parents[1]
SCENARIOS = ROOT / "scenarios"
GAINS = np.array([840.0, 0.0, 230.0, 3.0])


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


def sweeps(full: bool, rounds: int = 3) -> None:
    """A sweep on one thread, on two, and on two worker processes of Dask, in turns; the best round of each counts.

    Beside the times stand seconds of processor, which other programs on the machine disturb less.
    """
    scenario = bikebot.Scenario.load(SCENARIOS / "course.toml")
    count = 2000 if full else 200
    wall: dict[str, list[float]] = {}
    busy: dict[str, list[float]] = {}

    def measure(name: str, processor: Callable[[], float], **how: Any) -> bikebot.Table:
        began, used = time.perf_counter(), processor()
        table = bikebot.sweep(scenario, seeds=range(count), **how)
        wall.setdefault(name, []).append(time.perf_counter() - began)
        busy.setdefault(name, []).append(processor() - used)
        return table

    with contextlib.ExitStack() as stack:
        client = None
        try:
            import distributed
        except ImportError:
            print("sweep on Dask: skipped, pip install bikebot[dask]")
        else:
            cluster = distributed.LocalCluster(
                n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
            )
            client = stack.enter_context(distributed.Client(stack.enter_context(cluster)))
            # Workers import bikebot with the first chunk.
            bikebot.sweep(scenario, seeds=range(4), executor=client, chunk=1)
        for _ in range(rounds):
            one = measure("one thread", time.process_time, threads=1)
            assert measure("two threads", time.process_time, threads=2).equals(one)
            if client is not None:
                workers = client

                def processor() -> float:
                    return time.process_time() + sum(workers.run(time.process_time).values())

                assert measure("Dask", processor, executor=client).equals(one)
        with tempfile.TemporaryDirectory() as folder:
            assert measure("two threads, kept", time.process_time, threads=2, resume=folder).equals(one)
    for name, times in wall.items():
        print(
            f"sweep of {count} runs, {name}: {min(times):.2f} s, {min(busy[name]):.2f} s of processor"
            f" ({', '.join(f'{it:.2f}' for it in times)})"
        )
    best = {name: min(times) for name, times in wall.items()}
    work = min(busy["two threads"]) / min(busy["one thread"])
    print(
        f"sweep: {best['one thread'] / best['two threads']:.2f} times as fast on two threads (1.8 wanted), which together"
        f" work for {work:.3f} of the processor's time of one"
    )
    if "Dask" in best:
        more = [100 * (min(it["Dask"]) / min(it["two threads"]) - 1) for it in (wall, busy)]
        print(f"sweep: Dask takes {more[0]:+.1f} % (15 wanted), {more[1]:+.1f} % in seconds of processor")


def own_controllers() -> None:
    """What a controller in Python costs a call: rides of the course with and without, that differ by it alone."""
    stand = bikebot.Scenario.load(SCENARIOS / "balance-recover.toml").with_(run={"duration_s": 5.0})
    course = bikebot.Scenario.load(SCENARIOS / "course.toml").with_(run={"duration_s": 5.0})

    def best_of(ride: Callable[[], bikebot.Ride]) -> tuple[float, int]:
        ridden = ride()
        return min(timed(ride) for _ in range(15)), len(ridden.trace["time_s"])

    laws: dict[str, tuple[bikebot.Scenario, dict[str, Callable[[Any], Any]]]] = {
        "balancer": (stand, {"balancer": lambda seen: 840 * seen.roll_rad + 230 * seen.roll_rate_radps + 3 * seen.balancer_rate_radps}),
        "balancer that takes its state as an array": (stand, {"balancer": lambda seen: float(seen.state @ GAINS)}),
        "follower": (course, {"follower": lambda seen: (0.5 * (0.8 - seen.speed_mps), 0.0)}),
    }
    for name, (scenario, law) in laws.items():
        without, ticks = best_of(scenario.run)
        with_, its = best_of(lambda scenario=scenario, law=law: scenario.run(**law))
        print(f"{name} in Python: {1e6 * (with_ / its - without / ticks):.1f} µs a call more than ours (a tick with ours takes {1e6 * without / ticks:.1f} µs)")


def environments(seconds: float = 2.0) -> None:
    """Bike-steps a second of the vector environments, and of a single one."""
    try:
        from bikebot.gym import BalanceEnv, BalanceVectorEnv, FollowVectorEnv, RideVectorEnv
    except ImportError as missing:
        print(f"environments: skipped, {missing}")
        return
    cases = [
        (BalanceVectorEnv, "balance, balancer mode", {"mode": "balancer"}, 1024),
        (BalanceVectorEnv, "balance, flywheel mode", {"mode": "flywheel"}, 1024),
        (RideVectorEnv, "ride", {}, 256),
        (FollowVectorEnv, "follow", {}, 64),
    ]
    for make, name, arguments, count in cases:
        for threads in (1, 2):
            bikes = make(count, threads=threads, copy=False, **arguments)
            wide = bikes.single_action_space.shape[0]
            chance = np.random.default_rng(1)
            actions = chance.uniform(-0.3, 0.3, (64, count, wide)).astype(np.float32)
            bikes.reset(seed=1)
            steps, began, busy = 0, time.perf_counter(), time.process_time()
            while (took := time.perf_counter() - began) < seconds:
                for action in actions:
                    bikes.step(action)
                steps += len(actions) * count
            busy = time.process_time() - busy
            bikes.close()
            print(
                f"{name}: {steps / took / 1e6:.2f} million bike-steps a second, {count} bikes on {threads} threads"
                f" ({steps / busy / 1e6:.2f} a second of one core)"
            )
    env = BalanceEnv()
    env.reset(seed=1)
    action, count = np.zeros(1, np.float32), 20_000

    def alone() -> None:
        for _ in range(count):
            *_, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    print(f"a single environment: {1e6 * timed(alone) / count:.1f} µs a step")


def main() -> None:
    print(f"bikebot {bikebot.__version__}, Python {sys.version.split()[0]}, {os.cpu_count()} cores")
    if "--sweeps" not in sys.argv:
        plans()
        overhead()
        pace()
        own_controllers()
        environments()
    sweeps("--full" in sys.argv)


if __name__ == "__main__":
    main()
