"""A user's program, for the type checkers: strict under mypy and pyright, and run by a test."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

import bikebot


def plan_on_my_map() -> bikebot.Plan:
    grid = np.zeros((40, 60), dtype=np.bool_)
    grid[10:, 30] = True
    world = bikebot.World.from_array(grid, resolution=0.25, origin=(-1.0, 0.0))
    path = bikebot.plan(
        world,
        start=(0.5, 5.0, -math.pi / 4),
        goal=(12.0, 5.0, None),
        max_curvature=0.8,
        footprint="disc:0.3",
        seed=7,
    )
    poses = path.sample(20)
    assert poses.shape == (20, 3) and path.length >= path.lower_bound
    certificate = bikebot.verify(path, world)
    assert certificate.holds, certificate.violations
    return path


def better_and_better(world: bikebot.World) -> list[float]:
    planner = bikebot.Planner(world, max_curvature=0.8)
    with planner.refine((0.5, 5.0, 0.0), (12.0, 5.0), iterations=2000) as paths:
        return [path.cost for path in paths]


def ride(folder: Path) -> bikebot.Ride:
    scenario = bikebot.Scenario.load(folder / "fig7.toml")
    scenario = scenario.with_(follow={"max_speed_mps": 1.2}, run={"seed": 3, "duration_s": 3.0})
    ridden = scenario.run(progress=lambda share: None)
    roll = np.degrees(ridden.trace["roll_rad"])
    assert float(np.abs(roll).max()) < 40.0
    for event in ridden.events:
        print(event.time_s, event.kind)
    return ridden


def lean(folder: Path) -> bikebot.Table:
    scenario = bikebot.Scenario.load(folder / "balance-recover.toml")
    table = bikebot.sweep(
        scenario.with_(run={"duration_s": 1.0}),
        vary={"start.roll_deg": np.linspace(1.0, 3.0, 2)},
        seeds=range(2),
    )
    assert table.rows == 4
    return table


def wrong(text: str) -> str:
    try:
        bikebot.Scenario.from_text(text)
    except bikebot.ScenarioError as error:
        return f"{error.line}:{error.column} {error.key}"
    return ""


def main() -> None:
    scenarios = Path(__file__).resolve().parents[3] / "scenarios"
    path = plan_on_my_map()
    assert path.world is not None
    costs = better_and_better(path.world)
    assert costs == sorted(costs, reverse=True)
    ride(scenarios)
    lean(scenarios)
    assert wrong('format = 1\nname = "x"\n[run]\nsed = 1\n') == "4:1 run.sed"
    speeds = bikebot.eigenvalues("benchmark")
    assert speeds.weave_speed is not None and speeds.weave.dtype == np.complex128


if __name__ == "__main__":
    main()
