"""Studies: the paper's Table 2, and the eigenvalues of a bicycle."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from bikebot import _bikebot
from bikebot._types import Floats

if TYPE_CHECKING:
    from collections.abc import Iterable

    from bikebot._bikebot import Scenario
    from bikebot._progress import Progress
    from bikebot._types import Integer


@dataclass(frozen=True)
class Table2:
    """Every row of the paper's Table 2, measured. Prints as the table."""

    scenario: str
    """Name of the scenario."""
    runs: int
    """Runs of each row with chance."""
    seed: int
    """Seed of the first run."""
    rows: tuple[dict[str, Any], ...]
    """The rows: dicts with "method", "found", "time_s", "length_m", "roughness", …, as `bikebot table2 --json` gives them."""
    text: str = field(repr=False)
    markdown: str = field(repr=False)

    def __getitem__(self, method: str) -> dict[str, Any]:
        """The row of that method."""
        for row in self.rows:
            if row["method"] == method:
                return row
        raise KeyError(f"no row {method!r}: there are {', '.join(r['method'] for r in self.rows)}")

    def column(self, name: str, statistic: str = "mean") -> Floats:
        """One figure of every row, such as "length_m", by "mean", "median", "p05" or "p95"; NaN where a row has none."""
        if not any(name in row for row in self.rows):
            raise KeyError(f"no column {name!r}")
        values = []
        for row in self.rows:
            value = row.get(name)
            values.append(value.get(statistic) if isinstance(value, dict) else value)
        return np.array([np.nan if value is None else value for value in values], dtype=float)

    def __str__(self) -> str:
        return self.text

    def _repr_markdown_(self) -> str:
        return self.markdown


def table2(
    scenario: Scenario | None = None,
    *,
    runs: Integer = 20,
    seed: Integer | None = None,
    jobs: Integer = 1,
    progress: Progress | None = None,
) -> Table2:
    """Plans with every method of the paper's Table 2 on one field, and compares.

    Without a scenario the field is a reconstruction of the paper's yard. `runs` with seeds `seed`, `seed` + 1, … are made of each method
    with chance; `jobs` of them at the same time, which disturb each other's times and nothing else.

    >>> table = table2(runs=1)
    >>> bool(table["full"]["length_m"]["mean"] < table["rrt"]["length_m"]["mean"])
    True
    """
    table, text, markdown, name = _bikebot._table2(
        scenario, runs=runs, seed=seed, jobs=jobs, progress=progress
    )
    return Table2(name, table["runs"], table["seed"], tuple(table["rows"]), text, markdown)


@dataclass(frozen=True)
class Eigenvalues:
    """Critical speeds and modes of a bicycle whose balancer is locked and which nobody steers (Meijaard et al. 2007)."""

    name: str
    """Of the bicycle."""
    speed: Floats
    """Speeds, (n,), m/s."""
    weave: npt.NDArray[np.complex128]
    """Both eigenvalues of the weave, (n, 2), 1/s."""
    capsize: npt.NDArray[np.complex128]
    """(n,), 1/s."""
    caster: npt.NDArray[np.complex128]
    """(n,), 1/s."""
    stable: npt.NDArray[np.bool_]
    """Whether the bike stays up by itself, (n,)."""
    weave_speed: float | None
    """Above it the weave dies away, m/s; None if there is no such speed."""
    capsize_speed: float | None
    """Above it a lean grows, m/s."""
    weave_speed_deviation: float | None
    """Its standard deviation where the parameters were measured with theirs, m/s."""
    capsize_speed_deviation: float | None
    stable_ranges: tuple[tuple[float, float], ...]
    """Ranges of speed where it is stable, m/s."""
    M: Floats
    """Mass matrix."""
    C1: Floats
    """Damping by speed."""
    K0: Floats
    """Stiffness by gravity."""
    K2: Floats
    """Stiffness by the square of the speed."""
    parameters: dict[str, Any]
    """The bicycle's parameters."""
    remarks: tuple[str, ...]
    """What is unusual about them."""
    picture: str | None = field(repr=False, default=None)

    def svg(self) -> str:
        """The modes over speed, as an SVG picture. Raises `ValueError` for a single speed."""
        if self.picture is None:
            raise ValueError("one speed makes no picture: ask for several")
        return self.picture

    def _repr_svg_(self) -> str | None:
        return self.picture


def eigenvalues(
    parameters: str | os.PathLike[str] | Scenario = "default",
    *,
    speeds: Iterable[float] | Floats | None = None,
) -> Eigenvalues:
    """Critical speeds and eigenvalues of a bicycle.

    `parameters` is a preset ("benchmark" is the article's bicycle, "default" and "low_pivot" are the bike robot's), a file of the 25
    parameters as the BicycleParameters collection writes them, or a scenario, whose bike is meant. `speeds` are in m/s.

    >>> round(eigenvalues("benchmark").weave_speed, 4)
    4.2924
    """
    found = _bikebot._eigenvalues(parameters, speeds=speeds)
    weave = np.stack(
        [found[f"{key}_re"] + 1j * found[f"{key}_im"] for key in ("weave", "weave2")], axis=1
    )
    ranges = tuple(
        (float(it["from_mps"]), float(np.inf if it.get("to_mps") is None else it["to_mps"]))
        for it in found["stable_ranges"]
    )
    return Eigenvalues(
        name=found["name"],
        speed=found["speed"],
        weave=weave,
        capsize=found["capsize_re"] + 1j * found["capsize_im"],
        caster=found["caster_re"] + 1j * found["caster_im"],
        stable=found["stable"],
        weave_speed=found["weave_speed"],
        capsize_speed=found["capsize_speed"],
        weave_speed_deviation=found["weave_speed_deviation"],
        capsize_speed_deviation=found["capsize_speed_deviation"],
        stable_ranges=ranges,
        M=np.array(found["M"]),
        C1=np.array(found["C1"]),
        K0=np.array(found["K0"]),
        K2=np.array(found["K2"]),
        parameters=found["parameters"],
        remarks=tuple(found["remarks"]),
        picture=found["svg"],
    )
