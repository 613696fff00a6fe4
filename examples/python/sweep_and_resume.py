"""Finds out how far a lean can be caught: a sweep that may be interrupted, as a table and as an envelope map.

    python sweep_and_resume.py [FOLDER]      writes recover/, recover.parquet and recover.png there

Interrupt it, or kill it, and start it again: it goes on where it was.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import bikebot
from bikebot import plot

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


def main(folder: Path) -> None:
    scenario = bikebot.Scenario.load(SCENARIOS / "balance-recover.toml")
    table = bikebot.sweep(
        scenario,
        vary={
            "start.roll_deg": np.linspace(-15.0, 15.0, 11),
            "start.roll_rate_radps": np.linspace(-0.8, 0.8, 9),
            "bike.mode": ["flywheel", "balancer"],
        },
        resume=folder / "recover",
        progress=True,
    )
    for mode in ("flywheel", "balancer"):
        rows = table["bike.mode"] == mode
        caught = rows & (table["outcome"] == "arrived")
        most = np.abs(table["start.roll_deg"][caught & (table["start.roll_rate_radps"] == 0.0)]).max()
        print(f"{mode}: {caught.sum()} of {rows.sum()} caught, at rest up to {most:.0f}°")

    table.to_parquet(folder / "recover.parquet")
    assert bikebot.Table.from_parquet(folder / "recover.parquet").equals(table)
    maps = plot.envelopes(table, "start.roll_deg", "start.roll_rate_radps", title="where it recovers")
    maps[0].figure.savefig(folder / "recover.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
