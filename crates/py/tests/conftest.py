"""Shared by the tests: where things are, and small worlds."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest

import bikebot

ROOT = Path(__file__).resolve().parents[3]
SCENARIOS = ROOT / "scenarios"

STAND = """
format = 1
name = "stand"
[start]
roll_deg = 2.0
[plant]
model = "two_link"
[noise]
roll_sigma_deg = 0.1
[run]
duration_s = 1.0
"""


@pytest.fixture(scope="session")
def program() -> str:
    """The program of the command line, for the same input."""
    ending = ".exe" if sys.platform == "win32" else ""
    named = os.environ.get("BIKEBOT_PROGRAM")
    if named is not None:
        assert Path(named).is_file(), f"BIKEBOT_PROGRAM={named} is not there"
        return named
    target = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    built = [target / profile / f"bikebot{ending}" for profile in ("release", "debug")]
    found = [path for path in built if path.is_file()]
    if not found:
        pytest.skip("no bikebot program: cargo build --release, or set BIKEBOT_PROGRAM")
    return str(max(found, key=lambda path: path.stat().st_mtime))


@pytest.fixture(scope="session")
def yard() -> bikebot.World:
    """A yard of shapes."""
    return bikebot.World.from_shapes(
        (0, 0, 20, 20), discs=[(6, 14, 2)], boxes=[(9, 0, 11, 13)], polygons=[[(14, 9), (18, 8), (16, 15)]]
    )


@pytest.fixture(scope="session")
def grid() -> np.ndarray:
    """A wall with a gap, as bools."""
    cells = np.zeros((40, 60), dtype=bool)
    cells[10:, 30] = True
    return cells


@pytest.fixture(scope="session")
def stand() -> bikebot.Scenario:
    """A ride of a second that costs a millisecond."""
    return bikebot.Scenario.from_text(STAND)


@pytest.fixture(scope="session")
def slow_world() -> bikebot.World:
    """A field in which a search with a great many iterations takes long."""
    chance = np.random.default_rng(1)
    discs = np.column_stack([chance.uniform(5, 95, (120, 2)), chance.uniform(1, 3, 120)])
    return bikebot.World.from_shapes((0, 0, 100, 100), discs=discs)


#: Settings of a search that goes on for long, and a question for it in `slow_world`.
TIRELESS = {"starts": 10**9, "starts_without_gain": 10**9}
SLOW: dict[str, object] = {"start": (2.0, 2.0, 0.0), "goal": (98.0, 98.0), "settings": TIRELESS}
