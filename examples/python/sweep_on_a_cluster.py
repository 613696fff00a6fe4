"""The same sweep on threads and on a Dask cluster of worker processes: the same rows, bit for bit.

    python sweep_on_a_cluster.py

On a real cluster only the client differs: Client("tcp://scheduler:8786"), or one of dask-jobqueue's.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import distributed

import bikebot

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def main() -> None:
    course = bikebot.Scenario.load(SCENARIOS / "course.toml")
    study: dict[str, list[Any]] = {"bike.mode": ["flywheel", "balancer"], "follow.max_speed_mps": [1.0, 1.5]}
    here = bikebot.sweep(course, vary=study, seeds=range(10))
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=":0") as cluster,
        distributed.Client(cluster) as client,
    ):
        there = bikebot.sweep(course, vary=study, seeds=range(10), executor=client, progress=True)
    assert there.equals(here)
    print(f"{there.rows} rides, the same on threads and on two worker processes")
    for mode in study["bike.mode"]:
        print(f"{mode}: roll up to {there['roll_max_deg'][there['bike.mode'] == mode].max():.2f}°")


# Worker processes import this file: without the guard each would start a cluster of its own.
if __name__ == "__main__":
    main()
