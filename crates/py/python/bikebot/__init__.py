"""bikebot: plans paths a bike can ride, keeps it in balance, rides, and records.

>>> import bikebot
>>> world = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 7)])
>>> p = bikebot.plan(world, start=(1, 1, 0.0), goal=(9, 1, None), max_curvature=0.8, footprint="disc:0.3")
>>> p.outcome
'found'
>>> bikebot.verify(p).holds
True

SI units and radians throughout; keys that end in `_deg` hold degrees. Headings are counter-clockwise from +x, curvature is
positive to the left, roll positive to the right.
"""

from bikebot._bikebot import (
    BalancerView,
    FollowerView,
    Plan,
    Planner,
    Refinement,
    Ride,
    Scenario,
    Trace,
    World,
    __version__,
    plan,
    read_log,
)
from bikebot._chunks import Chunk, run_chunk
from bikebot._errors import BikebotError, MapError, PlanError, ScenarioError, SweepError
from bikebot._results import Certificate, Event, Mismatch, Violation, verify
from bikebot._studies import Eigenvalues, Table2, eigenvalues, table2
from bikebot._sweep import sweep
from bikebot._table import Table

__all__ = [
    "BalancerView",
    "BikebotError",
    "Certificate",
    "Chunk",
    "Eigenvalues",
    "Event",
    "FollowerView",
    "MapError",
    "Mismatch",
    "Plan",
    "PlanError",
    "Planner",
    "Refinement",
    "Ride",
    "Scenario",
    "ScenarioError",
    "SweepError",
    "Table",
    "Table2",
    "Trace",
    "Violation",
    "World",
    "__version__",
    "eigenvalues",
    "plan",
    "read_log",
    "run_chunk",
    "sweep",
    "table2",
    "verify",
]
