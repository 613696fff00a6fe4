"""Rides on their map, one or several."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from bikebot import _bikebot
from bikebot.plot import _ground
from bikebot.plot._plan import _search
from bikebot.plot._style import (
    COLORS,
    DASHES,
    IS,
    RIDES,
    SMALL,
    label_of,
    legend_below,
    must_be,
    significant,
    stride,
)

if TYPE_CHECKING:
    from bikebot._bikebot import Ride

#: Most outlines of the bike on one map.
MAX_OUTLINES = 60
#: Lean from which an outline is drawn in full colour, rad.
FULL_LEAN = 0.09


def named(rides: Ride | Iterable[Ride] | Mapping[str, Ride]) -> dict[str, Ride]:
    """Rides by name; where none are given, by what tells them apart."""
    if isinstance(rides, _bikebot.Ride):
        return {"": rides}
    if isinstance(rides, Mapping):
        found = {str(name): ride for name, ride in rides.items()}
    else:
        listed = list(rides)
        for ride in listed:
            must_be("rides", ride, _bikebot.Ride)
        names = [label_of(ride) for ride in listed]
        if len(set(names)) < len(names):
            names = [f"{name} ({index})" for index, name in enumerate(names, 1)]
        found = dict(zip(names, listed, strict=True))
    for ride in found.values():
        must_be("rides", ride, _bikebot.Ride)
    if not found:
        raise ValueError("there are no rides to draw")
    return found


def ride(
    ride: Ride,
    ax: Axes | None = None,
    *,
    search: bool = True,
    footprints: bool = True,
    legend: bool = True,
) -> Axes:
    """A ride on its map: what was planned, what was ridden, and the bike as time goes by, stronger in colour the more it leans.

    `search` draws what the planner made on the way to the plan, where the ride has it (not when it was read from a recording).
    """
    must_be("ride", ride, _bikebot.Ride)
    world = ride.scenario.world
    axes = _ground.under(world, ax, title="")
    if search and ride.plan is not None and ride.plan.found:
        stages = json.loads(ride.plan.to_json() or "{}")["stages"]
        _search({key: stages.get(key) for key in ("tree", "corridor_tree")}, axes, world is not None)
    if footprints:
        _outlines(ride, axes)
    if ride.planned is not None and len(ride.planned) > 1:
        axes.plot(*ride.planned[:, :2].T, color=COLORS["blue"], linewidth=2.8, zorder=3.2, label="planned path")
    x, y = ride.trace["x_m"], ride.trace["y_m"]
    axes.plot(x, y, **IS, zorder=4.0, label="ridden")
    _ends(ride, axes)
    axes.set_title(_facts(ride), fontsize=SMALL, color=COLORS["ink"])
    if world is None:
        _around(axes, [ride])
    if legend:
        legend_below(axes)
    return axes


def _around(axes: Axes, rides: list[Ride]) -> None:
    """Limits around all that was ridden, for rides without a map."""
    at = np.concatenate([np.column_stack([ride.trace["x_m"], ride.trace["y_m"]]) for ride in rides])
    at = at[np.isfinite(at).all(axis=1)]
    if len(at):
        low, high = at.min(axis=0), at.max(axis=0)
        # Outlines reach so far from the rear contact, wherever they point.
        outlines = [np.asarray(ring) for ride in rides for ring in _bikebot._outline(ride.scenario)]
        reach = max((float(np.hypot(*ring.T).max()) for ring in outlines), default=0.0)
        margin = reach + 0.3 + 0.02 * float((high - low).max())
        axes.set_xlim(low[0] - margin, high[0] + margin)
        axes.set_ylim(low[1] - margin, high[1] + margin)


def _facts(ride: Ride) -> str:
    facts = [ride.outcome.replace("_", " ")]
    for name, before, after in (
        ("time_s", "", " s"),
        ("lateral_error_max_m", "lateral error up to ", " m"),
        ("roll_max_deg", "roll up to ", "°"),
    ):
        if name in ride.metrics:
            facts.append(f"{before}{significant(ride.metrics[name])}{after}")
    return " · ".join([*facts, f"seed {ride.scenario.seed}"])


def _outlines(ride: Ride, axes: Axes) -> None:
    trace = ride.trace
    time = trace["time_s"]
    if len(time) < 2:
        return
    every = stride(max((float(time[-1]) - float(time[0])) / MAX_OUTLINES, 1.0))
    due = np.arange(float(time[0]), float(time[-1]) + 1e-9, every)
    rows = np.minimum(np.searchsorted(time, due - 1e-9), len(time) - 1)
    poses = np.column_stack([trace[name][rows] for name in ("x_m", "y_m", "heading_rad")])
    lean = np.minimum(np.abs(trace["roll_rad"][rows]) / FULL_LEAN, 1.0)
    kept = np.isfinite(poses).all(axis=1)
    strength = 0.12 + 0.4 * np.nan_to_num(lean[kept])
    _ground.footprints(ride.scenario, poses[kept], axes, fill=strength)
    label = f"every {significant(every, 2)} s"
    axes.plot([], [], "s", color=COLORS["orange"], alpha=0.5, markersize=8, label=label)


def _ends(ride: Ride, axes: Axes) -> None:
    trace = ride.trace
    first = [float(trace[name][0]) for name in ("x_m", "y_m", "heading_rad")]
    _ground.pose_mark(axes, first[0], first[1], first[2], is_goal=False)
    goal = ride.scenario.to_dict().get("goal")
    if goal:
        degrees = goal.get("heading_deg")
        heading = None if degrees is None else float(np.radians(degrees))
        _ground.goal_ball(axes, goal["x_m"], goal["y_m"], float(goal.get("tolerance_m") or 0.0))
        _ground.pose_mark(axes, goal["x_m"], goal["y_m"], heading, is_goal=True)


def compare(
    rides: Iterable[Ride] | Mapping[str, Ride], ax: Axes | None = None, *, legend: bool = True
) -> Axes:
    """Several rides on the map of the first: what was ridden, in a colour and a dash for each; the planned path of the first wide and grey.

    Give a dict to name them; else name and seed of the scenario do.
    """
    found = named(rides)
    first = next(iter(found.values()))
    world = first.scenario.world
    axes = _ground.under(world, ax, title="")
    if first.planned is not None and len(first.planned) > 1:
        wide: dict[str, Any] = {"color": COLORS["unknown"], "linewidth": 6.0, "solid_capstyle": "round"}
        axes.plot(*first.planned[:, :2].T, **wide, zorder=2.6, label="planned path")
    for index, (name, ride) in enumerate(found.items()):
        look = {"color": RIDES[index % len(RIDES)], "linestyle": DASHES[index % len(DASHES)]}
        text = ", ".join(part for part in (name, ride.outcome.replace("_", " ")) if part)
        axes.plot(ride.trace["x_m"], ride.trace["y_m"], **look, linewidth=1.8, zorder=4.0, label=text)
        end = float(ride.trace["x_m"][-1]), float(ride.trace["y_m"][-1])
        # Where a bike did not arrive it lies.
        if ride.outcome != "arrived":
            axes.plot(*end, "X", color=look["color"], markersize=9, markeredgecolor="white", zorder=4.5)
    _ends(first, axes)
    if world is None:
        _around(axes, list(found.values()))
    if legend:
        legend_below(axes, columns=2)
    return axes
