"""All of a plan or a ride on one figure."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from bikebot import _bikebot
from bikebot.plot import _history, _plan, _ride
from bikebot.plot._style import COLORS, SMALL, label_of


def sheet(thing: _bikebot.Plan | _bikebot.Ride, figure: Figure | None = None, **how: Any) -> Figure:
    """What `bikebot plot` draws of a plan or a ride: the map to the left; to the right curvature and search, or speed, roll and lateral error.

    `how` goes to `plan` or `ride`, such as `search=False`.
    """
    if isinstance(thing, _bikebot.Plan):
        whole = _new(figure, 5.0)
        grid = whole.add_gridspec(2, 2, width_ratios=[1.25, 1.0])
        _plan.plan(thing, whole.add_subplot(grid[:, 0]), **how)
        _plan.curvature(thing, whole.add_subplot(grid[0, 1]))
        _plan.search(thing, whole.add_subplot(grid[1, 1]))
        name = (thing.world.name if thing.world is not None else None) or "plan"
    elif isinstance(thing, _bikebot.Ride):
        whole = _new(figure, 5.6)
        charts = ["speed", "roll", "lateral"]
        grid = whole.add_gridspec(len(charts), 2, width_ratios=[1.15, 1.0])
        _ride.ride(thing, whole.add_subplot(grid[:, 0]), **how)
        _history.histories(thing, charts, [whole.add_subplot(grid[row, 1]) for row in range(len(charts))])
        name = label_of(thing)
    else:
        raise TypeError(f"thing takes a bikebot.Plan or a bikebot.Ride, not {type(thing).__name__}")
    whole.suptitle(name, fontsize=SMALL + 4, color=COLORS["ink"])
    return whole


def _new(figure: Figure | None, height: float) -> Figure:
    if figure is not None:
        return figure
    from matplotlib import pyplot

    return pyplot.figure(figsize=(11.0, height), layout="constrained")
