"""Plans: the map with all that the search made, curvature along the path, and the search against time."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FuncFormatter, LogLocator

from bikebot import _bikebot
from bikebot.plot import _ground
from bikebot.plot._style import (
    COLORS,
    RAMP,
    SMALL,
    charted,
    legend_below,
    mixed,
    must_be,
    new_axes,
    significant,
    stride,
)

if TYPE_CHECKING:
    from bikebot._bikebot import Plan, World
    from bikebot._types import Floats

#: Most edges of a tree that are drawn; of more, every second, third, … one.
MAX_EDGES = 20_000
#: Points on a curve of the tree.
PIECES = 8
STAGES = {
    "rrt": "purple",
    "rrt_star": "purple",
    "birrt": "purple",
    "guide": "blue",
    "shortcut": "green",
    "taut": "sky",
    "corridor": "orange",
}


def plan(
    plan: Plan,
    ax: Axes | None = None,
    *,
    world: World | None = None,
    search: bool = True,
    footprints: bool = True,
    color_by_curvature: bool = False,
    legend: bool = True,
) -> Axes:
    """A plan on its map: path, outlines of the robot along it, ends, and what the search made.

    `world` is for plans that were read from a file, which have none of their own. `search` draws tree, coarse path, guide and corridor as far
    as the method has them.
    """
    must_be("plan", plan, _bikebot.Plan)
    ground = world if world is not None else plan.world
    axes = _ground.under(ground, ax)
    told: dict[str, Any] = json.loads(plan.to_json() or "{}")
    problem = told["problem"]
    if plan.found and footprints:
        _outlines(plan, axes)
    if plan.found:
        _path(plan, axes, color_by_curvature)
    if search:
        _search(told["stages"], axes, ground is not None)
    free = {False: "", True: ", any heading"}
    (x, y, heading), goal = plan.start, plan.goal
    _ground.pose_mark(axes, x, y, heading, is_goal=False, label=f"start{free[heading is None]}")
    _ground.goal_ball(axes, goal[0], goal[1], float(problem["tolerance_m"]))
    label = f"goal{free[goal[2] is None]}"
    _ground.pose_mark(axes, goal[0], goal[1], goal[2], is_goal=True, label=label)
    axes.set_title(_facts(plan), fontsize=SMALL, color=COLORS["ink"])
    if ground is None:
        axes.autoscale_view()
    if legend:
        legend_below(axes)
    return axes


def _facts(plan: Plan) -> str:
    facts = [plan.outcome.replace("_", " ")]
    if plan.found:
        facts.append(f"length {significant(plan.length, 4)} m")
        if np.isfinite(plan.max_curvature):
            limit = significant(plan.curvature_limit)
            facts.append(f"curvature {significant(plan.max_curvature)} of {limit} /m")
        facts.append(f"clearance {significant(plan.min_clearance)} m")
    else:
        facts.append(plan.reason.replace("_", " "))
    return " · ".join([*facts, f"seed {plan.seed}"])


def _path(plan: Plan, axes: Axes, color_by_curvature: bool) -> None:
    rim = [withStroke(linewidth=4.6, foreground="white", alpha=0.75)]
    if not color_by_curvature or not np.isfinite(plan.max_curvature):
        axes.plot(*plan.xy.T, color=COLORS["vermilion"], linewidth=2.6, path_effects=rim, zorder=4.0, label="path")
        return
    axes.plot(*plan.xy.T, color="white", alpha=0.75, linewidth=4.6, zorder=3.9)
    middle = 0.5 * np.abs(plan.curvature[:-1] + plan.curvature[1:])
    legs = np.stack([plan.xy[:-1], plan.xy[1:]], axis=1)
    edges = np.linspace(0.0, plan.curvature_limit, len(RAMP) + 1)
    # Continued to 1 %: rounding may put the limit itself a hair beyond.
    edges[-1] *= 1.01
    lines = LineCollection(
        list(legs),
        array=middle,
        cmap=ListedColormap(RAMP),
        norm=BoundaryNorm(list(edges), len(RAMP)),
        linewidths=2.8,
        capstyle="round",
        zorder=4.0,
    )
    axes.add_collection(lines, autolim=False)
    bar = axes.figure.colorbar(lines, ax=axes, shrink=0.6, ticks=[0.0, edges[-1]])
    bar.set_label("curvature, 1/m", color=COLORS["ink"])
    bar.ax.set_yticklabels(["0", significant(plan.curvature_limit)], fontsize=SMALL)


def _outlines(plan: Plan, axes: Axes) -> None:
    outline = _bikebot._outline(plan.footprint)
    if not outline:
        return
    wide = np.ptp(np.concatenate(outline)[:, 0])
    every = stride(0.8 * max(float(wide), plan.length / 60.0))
    places = np.arange(int(plan.length // every) + 1) * every
    places = np.append(places[plan.length - places > 0.4 * every], plan.length)
    heading = np.unwrap(plan.heading)
    poses = np.column_stack(
        [np.interp(places, plan.s, it) for it in (plan.xy[:, 0], plan.xy[:, 1], heading)]
    )
    _ground.footprints(plan.footprint, poses, axes)
    orange = COLORS["orange"]
    axes.plot([], [], color=orange, linewidth=1.0, label=f"footprint every {significant(every)} m")


def _search(stages: dict[str, Any], axes: Axes, has_ground: bool) -> None:
    middle = stages.get("corridor_guide") or []
    if len(middle) < 2:
        middle = stages.get("guide") or []
    half_width = stages.get("corridor_half_width_m")
    if half_width and len(middle) > 1:
        shade = mixed(COLORS["sky"], 0.22, COLORS["field"] if has_ground else "white")
        pieces = _corridor(np.asarray(middle, dtype=float), float(half_width))
        axes.add_collection(PolyCollection(pieces, facecolor=shade, edgecolor="none", zorder=0.9))
        axes.plot([], [], "s", color=shade, markersize=8, label=f"corridor, ±{significant(half_width)} m")
    straight = np.asarray(stages.get("tree") or [], dtype=float).reshape(-1, 2, 2)
    curved = np.asarray(stages.get("corridor_tree") or [], dtype=float).reshape(-1, 8)
    count = len(straight) + len(curved)
    if count:
        every = -(-count // MAX_EDGES)
        edges = [*straight[::every], *_curves(curved[::every])]
        thin = {"colors": COLORS["blue"], "linewidths": 0.6, "alpha": 0.35}
        axes.add_collection(LineCollection(edges, zorder=2.0, **thin), autolim=False)
        tree = Line2D([], [], color=COLORS["blue"], linewidth=0.8, alpha=0.6, label=f"search tree, {count} edges")
        axes.add_line(tree)
    for name, text, colour, dash in [
        ("coarse", "coarse path", "purple", (0, (1, 2))),
        ("guide", "guide", "green", (0, (5, 3))),
    ]:
        points = np.asarray(stages.get(name) or [], dtype=float)
        if len(points) > 1:
            axes.plot(*points.T[:2], color=COLORS[colour], linewidth=1.4, linestyle=dash, zorder=3.0, label=text)


def _corridor(middle: Floats, half_width: float) -> list[Floats]:
    """A line with a width in metres and round joints, as pieces."""
    turn = np.linspace(0.0, 2.0 * np.pi, 33)
    ball = half_width * np.column_stack([np.cos(turn), np.sin(turn)])
    pieces: list[Floats] = [ball + place for place in middle]
    for a, b in zip(middle[:-1], middle[1:], strict=True):
        along = b - a
        length = float(np.hypot(*along))
        if length > 0.0:
            side = half_width * np.array([-along[1], along[0]]) / length
            pieces.append(np.array([a + side, b + side, b - side, a - side]))
    return pieces


def _curves(curves: Floats) -> list[Floats]:
    """Points along Ferguson-Coons curves: rows of x0, y0, vx0, vy0, x1, y1, vx1, vy1."""
    t = np.linspace(0.0, 1.0, PIECES + 1)[:, None]
    weights = [2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, 3 * t**2 - 2 * t**3, t**3 - t**2]
    ends = curves.reshape(-1, 4, 2)
    # Ends first, then their velocities: the order of the weights is start, its velocity, end, its velocity.
    return [sum((w * it for w, it in zip(weights, end, strict=True)), np.zeros((1, 2))) for end in ends]


def curvature(plan: Plan, ax: Axes | None = None) -> Axes:
    """Curvature along the path with its limit; positive to the left."""
    must_be("plan", plan, _bikebot.Plan)
    axes = new_axes(6.4, 2.6) if ax is None else ax
    limit = plan.curvature_limit
    remark = "no path"
    axes.axhline(0.0, color=COLORS["grey"], linewidth=0.8)
    for value in (limit, -limit):
        axes.axhline(value, color=COLORS["ink"], linewidth=1.0, linestyle=(0, (5, 3.3)))
    if plan.found:
        axes.plot(plan.s, plan.curvature, color=COLORS["vermilion"], linewidth=1.6)
        most = int(np.nanargmax(np.abs(plan.curvature)))
        at, value = float(plan.s[most]), float(plan.curvature[most])
        axes.plot([at], [value], "o", markersize=6, markerfacecolor="none", color=COLORS["ink"])
        remark = f"largest {significant(value)} at {significant(at)} m, limit {significant(limit)}"
        axes.set_xlim(0.0, plan.length)
        reach = 1.14 * max(limit, abs(value))
        axes.set_ylim(-reach, reach)
    charted(axes, "curvature σ, 1/m", remark, "arc length, m")
    return axes


def search(plan: Plan, ax: Axes | None = None) -> Axes:
    """Cost of the best path against the time since the search began, by stage; against iterations where the plan has no times, as that of a ride.

    Dots are what a stage found; the line is the best so far among what may be returned.
    """
    must_be("plan", plan, _bikebot.Plan)
    axes = new_axes(6.4, 2.6) if ax is None else ax
    trace = plan.trace
    time, cost = np.asarray(trace["time_s"], dtype=float), np.asarray(trace["cost"], dtype=float)
    is_timed = bool(np.isfinite(time).any())
    if not is_timed:
        time = np.asarray(trace["iteration"], dtype=float)
    is_good = np.isfinite(time) & np.isfinite(cost) & (time > 0.0)
    certified = np.asarray(trace["certified"], dtype=bool)
    counts = is_good & (certified | (not certified.any()))
    if counts.any():
        best = np.minimum.accumulate(cost[counts])
        last = float(time[counts][-1])
        ends = np.append(time[counts], max(plan.time, last) if is_timed else last)
        axes.step(ends, np.append(best, best[-1]), where="post", color=COLORS["grey"], linewidth=1.0, zorder=2)
    stages = np.asarray(trace["stage"])
    for shape, stage in zip("osD^vP", dict.fromkeys(stages[is_good].tolist()), strict=False):
        here = is_good & (stages == stage)
        colour = COLORS[STAGES.get(stage, "vermilion")]
        marks: dict[str, Any] = {"linestyle": "none", "marker": shape, "markersize": 4.5, "markerfacecolor": "white"}
        label = stage.replace("_", " ")
        axes.plot(time[here], cost[here], **marks, color=colour, markeredgewidth=1.5, label=label, zorder=3)
    if is_good.any():
        axes.set_xscale("log")
        few = float(time[is_good].max()) < 50.0 * float(time[is_good].min())
        axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if few else (1.0,), numticks=9))
        axes.xaxis.set_major_formatter(FuncFormatter(_duration if is_timed else lambda count, _: f"{count:.0f}"))
        axes.xaxis.set_minor_formatter(FuncFormatter(lambda *_: ""))
        axes.legend(fontsize=SMALL - 0.5, labelcolor=COLORS["ink"], framealpha=0.85, edgecolor=COLORS["rule"])
    else:
        words = "nothing is told of the search" if plan.found else "no path was found"
        axes.text(0.5, 0.5, words, transform=axes.transAxes, ha="center", color=COLORS["grey"], fontsize=SMALL)
    charted(axes, "cost", "", "time since the search began" if is_timed else "iterations")
    return axes


def _duration(seconds: float, _: object = None) -> str:
    """
    >>> _duration(2e-4), _duration(0.01), _duration(3.0)
    ('200 µs', '10 ms', '3 s')
    """
    for unit, factor in (("s", 1.0), ("ms", 1e3), ("µs", 1e6)):
        if seconds * factor >= 1.0 - 1e-9:
            return f"{significant(seconds * factor)} {unit}"
    return f"{significant(1e9 * seconds)} ns"
