"""Quantities against time, of one ride or of several."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from bikebot.plot._ride import named
from bikebot.plot._style import (
    COLORS,
    DASHES,
    IS,
    OTHER,
    RIDES,
    WANTED,
    charted,
    legend_inside,
    new_axes,
    significant,
)

if TYPE_CHECKING:
    from bikebot._bikebot import Ride
    from bikebot._types import Floats

DEGREES = 180.0 / np.pi
_LOOKS: Final = {"is": IS, "wanted": WANTED, "other": OTHER}


class History(NamedTuple):
    """What a chart shows: its title, its unit, the factor to it, and names in the trace, each with its words and its part."""

    title: str
    unit: str
    factor: float
    lines: tuple[tuple[str, str, str], ...]


#: The charts that have a name, as on the page of `bikebot report`.
HISTORIES: Final[dict[str, History]] = {
    "speed": History(
        "speed", "m/s", 1.0, (("speed_mps", "ridden", "is"), ("speed_reference_mps", "asked for", "wanted"))
    ),
    "roll": History(
        "roll, positive to the right",
        "°",
        DEGREES,
        (("roll_rad", "roll", "is"), ("roll_reference_rad", "asked for", "wanted")),
    ),
    "steer": History("steering, positive to the left", "°", DEGREES, (("steer_rad", "steering", "is"),)),
    "curvature": History(
        "curvature, positive to the left",
        "1/m",
        1.0,
        (("curvature_per_m", "ridden", "is"), ("path_curvature_per_m", "of the curve", "wanted")),
    ),
    "lateral": History(
        "off the curve, positive to the left",
        "m",
        1.0,
        (
            ("lateral_error_m", "followed point", "is"),
            ("rear_error_m", "rear wheel, off the path", "other"),
        ),
    ),
    "balancer": History("balancer angle", "°", DEGREES, (("balancer_rad", "balancer", "is"),)),
    "torque": History(
        "balancer torque",
        "N m",
        1.0,
        (("balancer_torque_nm", "acting", "is"), ("balancer_torque_command_nm", "asked for", "wanted")),
    ),
    "drive": History(
        "drive force",
        "N",
        1.0,
        (("drive_force_n", "acting", "is"), ("drive_force_command_n", "asked for", "wanted")),
    ),
    "clearance": History("clearance", "m", 1.0, (("clearance_m", "outline to obstacles", "is"),)),
    "grip": History(
        "grip in use",
        "%",
        100.0,
        (("friction_use_rear", "rear", "is"), ("friction_use_front", "front", "other")),
    ),
    "load": History(
        "wheel load", "N", 1.0, (("rear_load_n", "rear", "is"), ("front_load_n", "front", "other"))
    ),
    "moment": History(
        "outside roll moment",
        "N m",
        1.0,
        (("roll_moment_nm", "acting", "is"), ("roll_moment_estimate_nm", "as observed", "wanted")),
    ),
    "energy": History(
        "energy of the follower",
        "J",
        1.0,
        (("stored_energy_j", "stored", "is"), ("energy_tank_j", "tank", "other")),
    ),
}
_DEFAULT: Final = ("speed", "roll", "lateral")


def _chart_of(what: str, ride: Ride) -> History:
    if what in HISTORIES:
        return HISTORIES[what]
    if what not in ride.trace:
        raise ValueError(
            f"what is {what!r}: it takes {', '.join(map(repr, HISTORIES))} or a name of the trace, such as 'roll_rate_radps'"
        )
    from bikebot import _bikebot

    title, _, unit = _bikebot._name_of_key(what).partition(", ")
    factor, unit = (DEGREES, "°") if unit == "rad" else (1.0, unit)
    return History(title, unit, factor, ((what, title, "is"),))


def _levels(what: str, ride: Ride | None) -> list[float]:
    """What the quantity should keep off, in the unit of the chart; without a ride, where that is the same for all."""
    constant = {"clearance": [0.0], "grip": [100.0], "load": [0.0]}
    if what in constant:
        return constant[what]
    if ride is None:
        return []
    settings = ride.scenario.to_dict()
    bike, limits = settings["bike"], {"torque": "balancer_torque_max_nm", "steer": "steer_max_deg", "drive": "drive_force_max_n"}
    if what in limits and bike.get(limits[what]) is not None:
        most = float(bike[limits[what]])
        return [most, -most]
    if what == "speed":
        return [float(settings["follow"]["max_speed_mps"])]
    return []


def history(
    rides: Ride | Iterable[Ride] | Mapping[str, Ride], what: str = "roll", ax: Axes | None = None
) -> Axes:
    """A quantity against time: of one ride what was and what was asked for, of several rides what was, in a colour and a dash for each.

    `what` is a name of `HISTORIES`, or of the trace, such as "roll_rate_radps"; angles are drawn in degrees. A dict names the rides.
    """
    found = named(rides)
    first = next(iter(found.values()))
    chart = _chart_of(what, first)
    axes = new_axes(6.4, 2.4) if ax is None else ax
    axes.axhline(0.0, color=COLORS["grey"], linewidth=0.8)
    lows, highs, most, end = [0.0], [0.0], 0.0, 0.0
    for index, (name, ride) in enumerate(found.items()):
        time = ride.trace["time_s"]
        end = max(end, float(time[-1]) if len(time) else 0.0)
        for column, words, part in chart.lines if len(found) == 1 else chart.lines[:1]:
            values = _values(ride, column, chart.factor)
            if values is None:
                continue
            look: dict[str, Any] = dict(_LOOKS[part])
            if len(found) > 1:
                look = {"color": RIDES[index % len(RIDES)], "linestyle": DASHES[index % len(DASHES)], "linewidth": 1.5}
                words = name
            axes.plot(_times(ride, column), values, **look, label=words, zorder=2.0 + (part == "is"))
            lows.append(float(np.nanmin(values)))
            highs.append(float(np.nanmax(values)))
            if part == "is":
                most = max(most, lows[-1], highs[-1], key=abs)
    low, high = min(lows), max(highs)
    spread = max(high - low, 1e-9)
    for level in _levels(what, first if len(found) == 1 else None):
        # A limit far off would flatten all there is to see.
        if low - 0.6 * spread <= level <= high + 0.6 * spread:
            axes.axhline(level, color=COLORS["ink"], linewidth=0.9, linestyle=(0, (5, 3.3)))
            low, high = min(low, level), max(high, level)
    margin = 0.08 * (high - low) if high - low > 1e-9 else 1.0
    axes.set_ylim(low - margin, high + margin)
    axes.set_xlim(0.0, max(end, 1e-9))
    heading = f"{chart.title}, {chart.unit}" if chart.unit else chart.title
    charted(axes, heading, f"largest {significant(most)} {chart.unit}".replace(" °", "°"), "time, s")
    # Flat: several names one below the other would cover what they are names of.
    legend_inside(axes, 1 if len(found) == 1 else min(len(found), 4))
    return axes


def _times(ride: Ride, column: str) -> Floats:
    return ride.trace.time(column)


def _values(ride: Ride, column: str, factor: float) -> Floats | None:
    """Values that say something: not zero or absent all along."""
    values = ride.trace.get(column)
    if values is None or not np.any(np.isfinite(values) & (values != 0.0)):
        return None
    scaled: Floats = np.where(np.isfinite(values), factor * values, np.nan)
    return scaled


def histories(
    rides: Ride | Iterable[Ride] | Mapping[str, Ride],
    what: Sequence[str] = _DEFAULT,
    axes: Sequence[Axes] | npt.NDArray[Any] | None = None,
) -> npt.NDArray[Any]:
    """Several quantities below each other: an array of Axes.

    Of one ride, those are left out that it has nothing of, such as the lateral error of a bike that stands, unless `axes` are given.
    """
    found = named(rides)
    names = list(what) if not isinstance(what, str) else [what]
    charts = {name: _chart_of(name, next(iter(found.values()))) for name in names}
    if axes is None:
        has: Callable[[str], bool] = lambda name: any(  # noqa: E731
            part != "wanted" and _values(ride, column, 1.0) is not None
            for ride in found.values()
            for column, _, part in charts[name].lines
        )
        names = [name for name in names if has(name)] or names[:1]
        from matplotlib import pyplot

        _, grid = pyplot.subplots(
            len(names), 1, figsize=(7.0, 0.6 + 1.9 * len(names)), layout="constrained", squeeze=False, sharex=True
        )
        given: list[Axes] = list(grid[:, 0])
    else:
        given = list(np.ravel(np.asarray(axes, dtype=object)))
        if len(given) != len(names):
            raise ValueError(f"axes holds {len(given)} Axes for {len(names)} quantities")
    for index, (name, here) in enumerate(zip(names, given, strict=True)):
        history(found if "" not in found else found[""], name, here)
        if index + 1 < len(names):
            here.set_xlabel("")
        legend = here.get_legend()
        if len(found) > 1 and index > 0 and legend is not None:
            # The first one's holds for all.
            legend.remove()
    array = np.empty(len(given), dtype=object)
    array[:] = given
    return array

