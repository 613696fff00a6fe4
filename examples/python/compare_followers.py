"""Rides one course with four laws of following, tables what they differ in, and draws them beside each other.

    python compare_followers.py [FOLDER]     writes followers.png there
"""

from __future__ import annotations

import sys
from pathlib import Path

from matplotlib import pyplot

import bikebot
from bikebot import plot

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def main(folder: Path) -> None:
    course = bikebot.Scenario.load(SCENARIOS / "course.toml")
    laws = ["pvfc", "pure_pursuit", "stanley", "lqr"]
    rides = {law: course.with_(follow={"controller": law}).run() for law in laws}

    print(f"{'law':14}{'outcome':10}{'lateral error, mm':>18}{'roll, °':>9}{'torque, N m':>13}")
    for law, ride in rides.items():
        its = ride.metrics
        error, roll, torque = its["lateral_error_max_m"], its["roll_max_deg"], its["balancer_torque_max_nm"]
        print(f"{law:14}{ride.outcome:10}{1e3 * error:18.1f}{roll:9.2f}{torque:13.1f}")

    figure = pyplot.figure(figsize=(11.0, 6.0), layout="constrained")
    grid = figure.add_gridspec(3, 2)
    plot.compare(rides, figure.add_subplot(grid[:, 0]))
    plot.histories(rides, ["lateral", "roll", "torque"], [figure.add_subplot(grid[row, 1]) for row in range(3)])
    figure.savefig(folder / "followers.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
