"""Envelope maps: over two varied values of a sweep, where the bike recovers and what it fails for elsewhere."""

from __future__ import annotations

from collections import Counter
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.colors import to_rgba
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from bikebot import _bikebot
from bikebot._table import Table
from bikebot.plot._style import CAUSES, COLORS, SMALL, below, framed, must_be, new_axes

#: Side of the patch in a cell where some runs fail, as a part of the cell.
PATCH = 0.45
#: Most panels of a figure: beyond, nothing can be read.
MAX_PANELS = 24
COLUMNS = 3


def envelope(
    table: Table,
    x: str,
    y: str,
    ax: Axes | None = None,
    *,
    rows: npt.ArrayLike | None = None,
    legend: bool = True,
) -> Axes:
    """Where the bike recovers, over two varied values: light cells; elsewhere the colour of the most frequent cause.

    `x` and `y` are columns of numbers of the table, such as "start.roll_deg". `rows`, an array of bool, picks rows of the table; all others vary within a
    cell. In a light cell a patch in the colour of its cause says that some of the runs fail. Every colour of a failure is darker than that
    of recovery.
    """
    must_be("table", table, Table)
    axes = new_axes(5.2, 4.6) if ax is None else ax
    mask = np.ones(table.rows, dtype=bool) if rows is None else np.asarray(rows)
    if mask.dtype != bool or mask.shape != (table.rows,):
        raise ValueError(f"rows takes an array of bool with an entry for each of the {table.rows} rows")
    xs, i = _axis(table, "x", x)
    ys, j = _axis(table, "y", y)
    cells: list[list[Counter[str]]] = [[Counter() for _ in xs] for _ in ys]
    outcomes, reasons = table["outcome"], table["reason"]
    # A case that made no sense is no answer.
    for row in np.flatnonzero(mask & (outcomes != "invalid")):
        cause = "" if outcomes[row] == "arrived" else str(reasons[row])
        cells[j[row]][i[row]][cause] += 1
    shades = np.zeros((len(ys), len(xs), 4))
    patches: dict[str, list[Patch]] = {}
    x_edges, y_edges = _edges(xs), _edges(ys)
    good = run = 0
    for down, line in enumerate(cells):
        for along, cell in enumerate(line):
            run += cell.total()
            good += cell[""]
            failed = {cause: count for cause, count in cell.items() if cause}
            worst = min(failed, key=lambda cause: (-failed[cause], cause)) if failed else ""
            if cell[""]:
                shades[down, along] = to_rgba(COLORS["recovered"])
                if worst:
                    place = _middle(x_edges[along : along + 2], y_edges[down : down + 2])
                    patches.setdefault(_colour(worst), []).append(place)
            elif worst:
                shades[down, along] = to_rgba(_colour(worst))
    axes.pcolormesh(x_edges, y_edges, shades, zorder=1)
    for colour, places in patches.items():
        axes.add_collection(PatchCollection(places, facecolor=colour, edgecolor="none", zorder=2))
    framed(axes)
    axes.set_xlim(*x_edges[[0, -1]])
    axes.set_ylim(*y_edges[[0, -1]])
    axes.set_xlabel(_bikebot._name_of_key(x))
    axes.set_ylabel(_bikebot._name_of_key(y))
    share = f"{100.0 * good / run:.1f} % recovered" if run else "nothing was run"
    axes.set_title(share, loc="right", fontsize=SMALL, color=COLORS["grey"])
    if legend:
        handles = _legend(cells)
        axes.legend(
            handles=handles,
            loc="upper center",
            bbox_to_anchor=(0.5, 0.0),
            bbox_transform=below(axes),
            ncols=2,
            frameon=False,
            fontsize=SMALL,
            labelcolor=COLORS["ink"],
        )
    return axes


def envelopes(table: Table, x: str, y: str, panels: str | None = None, *, title: str = "") -> npt.NDArray[Any]:
    """An envelope map for each value of a third column, such as "bike.mode", side by side: an array of Axes on a new figure.

    Without `panels`, one for each combination of whatever else was varied.
    """
    must_be("table", table, Table)
    if panels is None:
        names = list(table)
        varied = names[1 : names.index("seed")] if "seed" in names else []
        keys = [name for name in varied if name not in (x, y)]
    else:
        keys = [panels]
    labels = [
        ", ".join(f"{_bikebot._name_of_key(key)} {table[key][row]}" for key in keys) for row in range(table.rows)
    ]
    distinct = list(dict.fromkeys(labels))
    if len(distinct) > MAX_PANELS:
        raise ValueError(f"there would be {len(distinct)} panels; at most {MAX_PANELS} can be read")
    from matplotlib import pyplot

    columns = max(1, min(COLUMNS, len(distinct)))
    lines = max(1, -(-len(distinct) // columns))
    figure, grid = pyplot.subplots(
        lines, columns, figsize=(0.6 + 3.7 * columns, 0.9 + 3.3 * lines), layout="constrained", squeeze=False
    )
    found = np.empty(len(distinct), dtype=object)
    cells: list[list[Counter[str]]] = []
    of_row = np.array(labels)
    for index, here in enumerate(grid.flat):
        if index >= len(distinct):
            here.remove()
            continue
        rows = of_row == distinct[index]
        found[index] = envelope(table, x, y, here, rows=rows, legend=False)
        here.set_title(distinct[index], loc="left", fontsize=SMALL + 1, color=COLORS["ink"])
        outcomes, reasons = table["outcome"][rows], table["reason"][rows]
        kept = [(str(o), str(r)) for o, r in zip(outcomes, reasons, strict=True) if o != "invalid"]
        cells.append([Counter("" if outcome == "arrived" else reason for outcome, reason in kept)])
    handles = _legend(cells, patches=_mixes(table, x, y, of_row))
    figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False, fontsize=SMALL, labelcolor=COLORS["ink"])
    if title:
        figure.suptitle(title, fontsize=SMALL + 3, color=COLORS["ink"])
    return found


def _mixes(table: Table, x: str, y: str, panel: npt.NDArray[Any]) -> bool:
    """Whether some cell has runs that recover and runs that do not."""
    seen: dict[tuple[Any, ...], set[bool]] = {}
    rows = zip(table[x].tolist(), table[y].tolist(), panel.tolist(), table["outcome"].tolist(), strict=True)
    for *place, outcome in rows:
        if outcome != "invalid":
            seen.setdefault(tuple(place), set()).add(outcome == "arrived")
    return any(len(ways) == 2 for ways in seen.values())


def _axis(table: Table, which: str, name: str) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.intp]]:
    if name not in table:
        raise ValueError(f"{which} is {name!r}, which the table has no column of")
    values = table[name]
    if values.dtype.kind not in "if" or not np.isfinite(values).all():
        raise ValueError(f"{which} is {name!r}, whose values are no numbers: names go into panels")
    distinct, place = np.unique(values.astype(float), return_inverse=True)
    return distinct, place.astype(np.intp)


def _edges(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Half way between the values, and as far again beyond the first and the last.

    >>> _edges(np.array([0.0, 1.0, 3.0])).tolist(), _edges(np.array([2.0])).tolist()
    ([-0.5, 0.5, 2.0, 4.0], [1.5, 2.5])
    """
    if len(values) < 2:
        middle = float(values[0]) if len(values) else 0.5
        return np.array([middle - 0.5, middle + 0.5])
    half = 0.5 * np.diff(values)
    inner = values[:-1] + half
    return np.concatenate([[values[0] - half[0]], inner, [values[-1] + half[-1]]])


def _middle(across: npt.NDArray[np.float64], up: npt.NDArray[np.float64]) -> Rectangle:
    wide, high = float(np.diff(across)[0]), float(np.diff(up)[0])
    rest = 0.5 * (1.0 - PATCH)
    corner = (float(across[0]) + rest * wide, float(up[0]) + rest * high)
    return Rectangle(corner, PATCH * wide, PATCH * high)


def _colour(cause: str) -> str:
    return CAUSES.get(cause, COLORS["other_cause"])


def _legend(cells: list[list[Counter[str]]], patches: bool | None = None) -> list[Any]:
    found = {cause for line in cells for cell in line for cause in cell if cause}
    grey = COLORS["grey"]
    handles: list[Any] = [Patch(facecolor=COLORS["recovered"], edgecolor=grey, linewidth=0.6, label="recovered")]
    handles += [Patch(color=colour, label=cause.replace("_", " ")) for cause, colour in CAUSES.items() if cause in found]
    others = sorted(found - set(CAUSES))
    if others:
        text = ", ".join(cause.replace("_", " ") for cause in others)
        handles.append(Patch(color=COLORS["other_cause"], label=text))
    if patches is None:
        patches = any(cell[""] and len(+cell) > 1 for line in cells for cell in line)
    if patches:
        text = "a patch in a light cell: some seeds fail"
        handles.append(Line2D([], [], linestyle="none", marker="s", color=grey, markersize=5, label=text))
    return handles
