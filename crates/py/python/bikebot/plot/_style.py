"""Colours, lines and frames that all pictures share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.transforms import ScaledTranslation, Transform

from bikebot import _bikebot

if TYPE_CHECKING:
    from collections.abc import Sequence

    from bikebot._bikebot import Ride
    from bikebot._types import Floats

_PALETTE = _bikebot._palette()
#: Colours by name, as `bikebot plot` has them.
COLORS: Final[dict[str, str]] = {
    name: value for name, value in _PALETTE.items() if isinstance(value, str)
}
#: From straight to the curvature limit.
RAMP: Final[list[str]] = _PALETTE["ramp"]
#: Causes of failure, in the order of the legend.
CAUSES: Final[dict[str, str]] = _PALETTE["causes"]
#: Colours of rides that are compared, in order.
RIDES: Final = [COLORS[it] for it in ("vermilion", "blue", "green", "purple", "orange", "sky")]
#: And their dashes: either tells them apart.
DASHES: Final[list[Any]] = ["-", (0, (6, 2)), (0, (2, 1.5)), (0, (8, 2, 2, 2)), (0, (1, 1)), (0, (4, 4))]

#: Size of small text, points.
SMALL: Final = 9.0

IS: Final[dict[str, Any]] = {"color": COLORS["vermilion"], "linewidth": 1.6}
WANTED: Final[dict[str, Any]] = {"color": COLORS["blue"], "linewidth": 1.3, "linestyle": (0, (4, 2.5))}
OTHER: Final[dict[str, Any]] = {"color": COLORS["green"], "linewidth": 1.4, "linestyle": (0, (7, 1.5, 1.5, 1.5))}


def mixed(colour: str, share: float, ground: str) -> tuple[float, float, float]:
    """A colour laid thinly on another, as one that covers."""
    over, under = np.array(to_rgb(colour)), np.array(to_rgb(ground))
    red, green, blue = share * over + (1.0 - share) * under
    return (float(red), float(green), float(blue))


def new_axes(width: float, height: float) -> Axes:
    """Axes on a new figure, inches."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(width, height), layout="constrained")
    del figure
    return axes


def framed(axes: Axes) -> None:
    """Frame and text of any chart."""
    for spine in axes.spines.values():
        spine.set_color(COLORS["grey"])
        spine.set_linewidth(0.8)
    axes.tick_params(colors=COLORS["ink"], labelsize=SMALL, width=0.8, color=COLORS["grey"])
    axes.xaxis.label.set(color=COLORS["ink"], size=SMALL + 1)
    axes.yaxis.label.set(color=COLORS["ink"], size=SMALL + 1)
    axes.title.set_color(COLORS["ink"])
    axes.set_axisbelow(True)


def charted(axes: Axes, heading: str, remark: str, below: str) -> None:
    """A chart: what it shows to the left above it, a remark to the right."""
    framed(axes)
    axes.grid(True, color=COLORS["rule"], linewidth=0.8)
    axes.set_title(heading, loc="left", fontsize=SMALL + 1, color=COLORS["ink"])
    if remark:
        # Beside the heading where both have room.
        axes.set_title(remark, loc="right", fontsize=SMALL, color=COLORS["grey"])
    axes.set_xlabel(below, fontsize=SMALL + 1, color=COLORS["ink"])


def below(axes: Axes) -> Transform:
    """Below the ticks and the name of the axis, however high the Axes are: to be put together with (0.5, 0)."""
    return axes.transAxes + ScaledTranslation(0.0, -0.52, axes.figure.dpi_scale_trans)


def legend_below(axes: Axes, columns: int = 3) -> None:
    """The legend under a map, out of the way of all that is drawn."""
    handles, labels = axes.get_legend_handles_labels()
    first = dict(reversed(list(zip(labels, handles, strict=True))))
    kept = {label: first[label] for label in dict.fromkeys(labels)}
    if kept:
        axes.legend(
            list(kept.values()),
            list(kept),
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=below(axes),
            ncols=columns,
            frameon=False,
            fontsize=SMALL,
            labelcolor=COLORS["ink"],
        )


def legend_inside(axes: Axes, columns: int = 1) -> None:
    """A small legend inside a chart, if there is more than one thing to tell."""
    handles, labels = axes.get_legend_handles_labels()
    if len(labels) > 1:
        axes.legend(
            ncols=columns,
            fontsize=SMALL - 0.5,
            labelcolor=COLORS["ink"],
            framealpha=0.85,
            edgecolor=COLORS["rule"],
            loc="best",
            columnspacing=1.2,
            handlelength=2.4,
        )


def significant(value: float, digits: int = 3) -> str:
    """A number with so many significant digits, without trailing noughts.

    >>> significant(0.0123456), significant(12.0), significant(-1234.5, 5)
    ('0.0123', '12', '-1234.5')
    """
    text = f"{value:.{digits}g}"
    return f"{float(text):g}" if "e" not in text else f"{float(text):.{digits}g}"


def label_of(ride: Ride) -> str:
    """Name and seed."""
    return f"{ride.scenario.name}, seed {ride.scenario.seed}"


def stride(least: float) -> float:
    """The smallest of 1, 2, 5, 10, … not below `least`: how far apart outlines are drawn.

    >>> stride(0.7), stride(4.0), stride(0.03)
    (1.0, 5.0, 0.05)
    """
    power = 10.0 ** float(np.floor(np.log10(max(least, 1e-6))))
    steps = (round(factor * power, 12) for factor in (1.0, 2.0, 5.0, 10.0))
    return float(next((step for step in steps if step >= least - 1e-12), 10.0 * power))


def carried(outline: Sequence[Floats], poses: npt.NDArray[Any]) -> list[Floats]:
    """Closed pieces of the body frame (m) at each pose: x, y, heading."""
    pieces: list[Floats] = []
    for x, y, heading in poses:
        cos, sin = np.cos(heading), np.sin(heading)
        turn = np.array([[cos, sin], [-sin, cos]])
        pieces += [piece @ turn + (x, y) for piece in outline]
    return pieces


def must_be(name: str, value: object, kind: type, article: str = "a") -> None:
    """Raises `TypeError` for anything else."""
    if not isinstance(value, kind):
        raise TypeError(f"{name} takes {article} bikebot.{kind.__name__}, not {type(value).__name__}")

