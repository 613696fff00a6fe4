"""Plans on a numpy grid, proves the path again, draws it, and gets better paths as long as one likes.

    python plan_on_a_grid.py [FOLDER]        writes plan.png and plan.json there
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np

import bikebot
from bikebot import plot


def rooms() -> bikebot.World:
    """Three rooms in a row with doors; True is occupied, row 0 is the lowest y."""
    grid = np.zeros((48, 96), dtype=np.bool_)
    grid[[0, -1], :] = grid[:, [0, -1]] = True
    grid[:, 31:33] = grid[:, 63:65] = True
    grid[6:18, 31:33] = grid[28:40, 63:65] = False
    return bikebot.World.from_array(grid, resolution=0.25, name="three rooms")


def main(folder: Path) -> None:
    world = rooms()
    # Radians; None is any heading. The curvature is that of the tightest turn, 1/m.
    start, goal = (2.0, 10.0, -math.pi / 2), (22.0, 2.0, None)
    path = bikebot.plan(world, start, goal, max_curvature=0.8, footprint="capsule:1.8x0.6", seed=7)
    print(path)
    proof = bikebot.verify(path)
    assert proof.holds, proof.violations
    print(f"proved: curvature up to {proof.max_curvature:.3f} /m, clearance at least {proof.min_clearance:.3f} m")

    # Prepared once and asked often; every path is valid, each is better than the one before.
    planner = bikebot.Planner(world, max_curvature=0.8, footprint="capsule:1.8x0.6")
    with planner.refine(start, goal, iterations=20_000) as better:
        costs = [found.cost for found in better]
    print("costs on the way:", ", ".join(f"{cost:.3f}" for cost in costs))

    path.to_json(folder / "plan.json")
    plot.sheet(path).savefig(folder / "plan.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
