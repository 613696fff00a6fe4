"""Results that are plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from bikebot import _bikebot

if TYPE_CHECKING:
    from bikebot._bikebot import Plan, World
    from bikebot._types import Footprint, Number


@dataclass(frozen=True)
class Event:
    """Something a program may want to find on a ride."""

    time_s: float
    """Simulated time, s."""
    kind: str
    """One of a closed list, such as "fall", "replan", "mode_change"."""
    text: str
    """One line for people."""
    value: float
    """The number that goes with it, SI; NaN if there is none."""


@dataclass(frozen=True)
class Violation:
    """One thing that a path does not keep."""

    kind: str
    """What, such as "curvature" or "clearance"."""
    segment: int | None
    """Index of the segment; None where the path as a whole is meant."""
    parameter: float | None
    """Place on the segment, 0 to 1."""
    margin: float
    """What is allowed less what there is, negative, in the unit of the figure."""


@dataclass(frozen=True)
class Mismatch:
    """Something that the plan was made for and the question given here differ in."""

    what: str
    plan: str
    given: str


@dataclass(frozen=True)
class Certificate:
    """What `verify` proved of a path: true as a condition where everything holds.

    Figures are proven or exact to rounding, and NaN where they do not apply.
    """

    holds: bool
    """Whether everything asked for and promised is proven."""
    violations: tuple[Violation, ...]
    """What does not hold."""
    mismatches: tuple[Mismatch, ...]
    """Where the plan was made for something else."""
    max_curvature: float
    """Nowhere is the curvature larger, 1/m."""
    curvature_jump: float
    """Largest jump of curvature between neighbours, 1/m."""
    heading_gap: float
    """Largest turn on the spot between neighbours, rad."""
    position_gap: float
    """Largest distance from the end of a segment to the start of the next, m."""
    min_clearance: float
    """Nowhere does the outline come nearer to anything, m."""
    min_clearance_at_most: float
    """There is a pose no clearer than this, m: the truth lies between."""
    length_at_least: float
    """The length is at least this, m."""
    length_at_most: float
    """The length is at most this, m."""
    start_gap: float
    """Distance of the first point from the start, m."""
    start_turn: float
    """Turn from the start's heading, rad."""
    goal_gap: float
    """Distance of the last point from the goal, m."""
    goal_turn: float
    """Turn to the goal's heading, rad."""

    def __bool__(self) -> bool:
        return self.holds

    def _repr_html_(self) -> str:
        word = "holds" if self.holds else "does not hold"
        rows = "".join(
            f"<tr><td>{name}</td><td style='text-align:right'>{getattr(self, name):.9g}</td></tr>"
            for name in _FIGURES
        )
        return f"<div><b>{word}</b><table>{rows}</table></div>"


_FIGURES = {
    "max_curvature": "max_curvature_per_m",
    "curvature_jump": "curvature_jump_per_m",
    "heading_gap": "heading_gap_rad",
    "position_gap": "position_gap_m",
    "min_clearance": "min_clearance_m",
    "min_clearance_at_most": "min_clearance_at_most_m",
    "length_at_least": "length_at_least_m",
    "length_at_most": "length_at_most_m",
    "start_gap": "start_gap_m",
    "start_turn": "start_turn_rad",
    "goal_gap": "goal_gap_m",
    "goal_turn": "goal_turn_rad",
}


def verify(
    plan: Plan,
    world: World | None = None,
    *,
    max_curvature: Number | None = None,
    footprint: Footprint | None = None,
    margin: Number | None = None,
) -> Certificate:
    """Proves again what a plan promises, by code that shares nothing with the planner's own checks.

    `world` is the plan's own where none is given (a plan read from a file has none); `max_curvature` (1/m), `footprint` and `margin`
    (m) are those it was planned for. Raises `ValueError` for a plan without a path.

    >>> from bikebot import World, plan
    >>> world = World.from_shapes((0, 0, 10, 10), discs=[(5, 5, 1)])
    >>> certificate = verify(plan(world, (1, 1, 0.0), (9, 9)))
    >>> certificate.holds, certificate.violations
    (True, ())
    """
    if not isinstance(plan, _bikebot.Plan):
        raise TypeError(f"plan takes a bikebot.Plan, not {type(plan).__name__}")
    found = plan._verify(world, max_curvature=max_curvature, footprint=footprint, margin=margin)
    proven: dict[str, Any] = found["certificate"] or {}
    figures = {name: proven.get(key) for name, key in _FIGURES.items()}
    return Certificate(
        holds=found["holds"],
        violations=tuple(
            Violation(it["kind"], it.get("segment"), it.get("parameter"), it["margin"])
            for it in found["violations"]
        ),
        mismatches=tuple(Mismatch(**it) for it in found["mismatches"]),
        **{name: float("nan") if value is None else value for name, value in figures.items()},
    )
