"""Maps, outlines and poses."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection, PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.patheffects import withStroke
from matplotlib.transforms import Affine2D

from bikebot import _bikebot
from bikebot.plot._style import COLORS, SMALL, carried, framed, must_be, new_axes

if TYPE_CHECKING:
    from bikebot._bikebot import Scenario, World
    from bikebot._types import Footprint

#: Size of the figure of a map where none is given: the longer side, inches.
SIZE = 6.4


def world(world: World, ax: Axes | None = None, *, title: str | None = None) -> Axes:
    """A map: its field, its obstacles, and cells that nobody has seen.

    `title` is the world's name, without folders, where none is given; "" for none. The Axes get equal scales and the limits of the field.
    """
    must_be("world", world, _bikebot.World)
    axes = map_axes(world) if ax is None else ax
    x0, y0, x1, y1 = world.bounds
    axes.add_patch(Rectangle((x0, y0), x1 - x0, y1 - y0, facecolor=COLORS["field"], zorder=0))
    _cells(world, axes)
    shapes = world.shapes
    patches: list[Patch] = [Circle((x, y), radius) for x, y, radius in shapes["discs"]]
    patches += [Rectangle((a, b), c - a, d - b) for a, b, c, d in shapes["boxes"]]
    patches += [Polygon(vertices) for vertices in shapes["polygons"]]
    if patches:
        axes.add_collection(
            PatchCollection(patches, facecolor=COLORS["obstacle"], edgecolor="none", zorder=1.2)
        )
    mapped(axes)
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)
    heading = PurePath(world.name or "").name if title is None else title
    if heading:
        axes.set_title(heading, fontsize=SMALL + 2, color=COLORS["ink"])
    return axes


def under(ground: World | None, ax: Axes | None, *, title: str | None = None) -> Axes:
    """What plans and rides are drawn on: their map, which the legend names, or an open plain."""
    axes = map_axes(ground) if ax is None else ax
    if ground is None:
        mapped(axes)
    else:
        world(ground, axes, title=title)
        axes.plot([], [], "s", color=COLORS["obstacle"], markersize=8, label="obstacles")
    return axes


def map_axes(world: World | None) -> Axes:
    """Axes of a new figure that has about the shape of a map."""
    if world is None:
        return new_axes(SIZE, SIZE)
    x0, y0, x1, y1 = world.bounds
    wide, high = max(x1 - x0, 1e-9), max(y1 - y0, 1e-9)
    scale = SIZE / max(wide, high)
    # Room for names, ticks and a legend.
    return new_axes(max(scale * wide, 2.4) + 0.9, max(scale * high, 1.8) + 1.3)


def mapped(axes: Axes) -> None:
    """Equal scales and the names of a map's axes."""
    framed(axes)
    axes.set_aspect("equal", adjustable="box")
    axes.set_xlabel("x, m")
    axes.set_ylabel("y, m")


def _cells(world: World, axes: Axes) -> None:
    cells, resolution, origin = world.to_array(), world.resolution, world.origin
    if cells is None or resolution is None or origin is None:
        return
    picture = np.zeros((*cells.shape, 4))
    picture[cells > 0] = to_rgba(COLORS["obstacle"])
    picture[cells < 0] = to_rgba(COLORS["unknown"])
    high, wide = cells.shape
    x, y, yaw = origin
    place = Affine2D().rotate(yaw).translate(x, y)
    axes.imshow(
        picture,
        origin="lower",
        extent=(0.0, wide * resolution, 0.0, high * resolution),
        interpolation="nearest",
        transform=place + axes.transData,
        zorder=1.0,
    )


def footprints(
    footprint: Footprint | Scenario,
    poses: npt.ArrayLike,
    ax: Axes | None = None,
    *,
    color: str | None = None,
    fill: float | npt.ArrayLike = 0.0,
    label: str | None = None,
) -> Axes:
    """Outlines of a robot at `poses`, (n, 3) with x, y (m) and heading (rad).

    `footprint` is what `bikebot.plan` takes, such as "disc:0.4", or a scenario, whose bike is meant. `fill`, one number or one for each
    pose, is how strongly they are filled, from 0 to 1.
    """
    at = np.asarray(poses, dtype=float)
    if at.ndim != 2 or at.shape[1] != 3:
        raise ValueError(f"poses has shape {at.shape}: it takes (n, 3) with x, y and heading")
    axes = new_axes(SIZE, SIZE) if ax is None else ax
    outline = _bikebot._outline(footprint)
    if outline and len(at):
        strength = np.broadcast_to(np.asarray(fill, dtype=float), (len(at),)).repeat(len(outline))
        shade = to_rgba(color or COLORS["orange"])
        faces = [(*shade[:3], float(np.clip(share, 0.0, 1.0))) for share in strength]
        edge: Any = color or (COLORS["orange"] if np.all(strength == 0.0) else "#b07800")
        axes.add_collection(
            PolyCollection(
                carried(outline, at),
                facecolors=faces,
                edgecolors=edge,
                linewidths=0.8,
                zorder=2.4,
                label=label or "_footprints",
            )
        )
    if ax is None:
        mapped(axes)
        axes.autoscale_view()
    return axes


def pose_mark(
    axes: Axes, x: float, y: float, heading: float | None, *, is_goal: bool, label: str = "_mark"
) -> None:
    """An arrow along the heading, and a mark at its foot: full for a start, a ring for a goal."""
    rim = [withStroke(linewidth=3.6, foreground="white", alpha=0.85)]
    ink = COLORS["ink"]
    if heading is not None:
        # Points, not metres: as long on any map. The head is where the text would be.
        axes.annotate(
            "",
            xy=(x, y),
            xytext=(19.0 * np.cos(heading), 19.0 * np.sin(heading)),
            textcoords="offset points",
            arrowprops={
                "arrowstyle": "<|-,head_length=0.55,head_width=0.26",
                "color": ink,
                "linewidth": 1.6,
                "shrinkA": 0.0,
                "shrinkB": 0.0,
                "mutation_scale": 12.0,
                "path_effects": rim,
            },
            zorder=5.0,
            annotation_clip=False,
        )
    face = "white" if is_goal else ink
    edge = ink if is_goal else "white"
    axes.plot(
        [x],
        [y],
        linestyle="none",
        marker="o",
        markersize=7.0,
        markerfacecolor=face,
        markeredgecolor=edge,
        markeredgewidth=2.0 if is_goal else 0.9,
        zorder=5.1,
        label=label,
    )


def goal_ball(axes: Axes, x: float, y: float, tolerance: float) -> None:
    """The goal's tolerance, a dashed ring."""
    if tolerance > 0.0:
        ring = Circle(
            (x, y), tolerance, fill=False, edgecolor=COLORS["ink"], linewidth=0.9, linestyle=(0, (2, 2.6)), zorder=4.9
        )
        axes.add_patch(ring)
