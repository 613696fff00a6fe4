"""Pictures with matplotlib (`pip install bikebot[plot]`), as the figures of `bikebot plot`: same quantities, colours and order.

| | draws |
|---|---|
| `world`, `footprints` | a map; outlines of a robot |
| `plan`, `curvature`, `search` | a plan on its map, its curvature along the path, the search against time |
| `ride`, `compare` | a ride on its map; several rides |
| `history`, `histories` | quantities of one ride, or of several, against time |
| `envelope`, `envelopes` | over two varied values of a sweep: where the bike recovers, and what it fails for |
| `eigenvalues` | the modes of a bicycle over speed |
| `sheet` | all of a plan or a ride on one figure |

Each draws on the Axes it is given, or on a new figure, and returns the Axes; none calls `show` or saves anything. Colours are those of Okabe and Ito, which
people with any kind of colour vision tell apart; lines that share a chart differ in dash or width as well. `COLORS` has them by name.

>>> import bikebot, matplotlib
>>> matplotlib.use("Agg")
>>> from bikebot import plot
>>> world = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 7)])
>>> ax = plot.plan(bikebot.plan(world, (1, 1, 0.0), (9, 1), footprint="disc:0.3"))
>>> ax.get_xlabel()
'x, m'
"""

from __future__ import annotations

try:
    import matplotlib as _matplotlib
except ImportError as _error:
    raise ImportError("bikebot.plot needs matplotlib: pip install bikebot[plot]") from _error

from bikebot.plot._eigenvalues import eigenvalues
from bikebot.plot._envelope import envelope, envelopes
from bikebot.plot._ground import footprints, world
from bikebot.plot._history import HISTORIES, histories, history
from bikebot.plot._plan import curvature, plan, search
from bikebot.plot._ride import compare, ride
from bikebot.plot._sheet import sheet
from bikebot.plot._style import COLORS, RAMP

del _matplotlib

__all__ = [
    "COLORS",
    "HISTORIES",
    "RAMP",
    "compare",
    "curvature",
    "eigenvalues",
    "envelope",
    "envelopes",
    "footprints",
    "histories",
    "history",
    "plan",
    "ride",
    "search",
    "sheet",
    "world",
]
