"""The modes of a bicycle over speed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes

from bikebot._studies import Eigenvalues
from bikebot.plot._style import COLORS, SMALL, charted, mixed, must_be, significant

if TYPE_CHECKING:
    from bikebot._types import Floats

_WEAVE: dict[str, Any] = {"color": COLORS["blue"], "linewidth": 2.2}
_CAPSIZE: dict[str, Any] = {"color": COLORS["vermilion"], "linewidth": 2.2, "linestyle": (0, (4.5, 2))}
_CASTER: dict[str, Any] = {"color": COLORS["purple"], "linewidth": 2.6, "linestyle": (0, (1, 2))}


def eigenvalues(
    eigenvalues: Eigenvalues, axes: Sequence[Axes] | npt.NDArray[Any] | None = None
) -> npt.NDArray[Any]:
    """Growth and frequency of a bicycle's modes over speed: an array of two Axes.

    What is above zero in the upper one grows; where all is below, the bike stays up by itself (green).

    >>> import bikebot, matplotlib, numpy as np
    >>> matplotlib.use("Agg")
    >>> growth, frequency = eigenvalues(bikebot.eigenvalues("benchmark", speeds=np.linspace(0, 10, 101)))
    """
    must_be("eigenvalues", eigenvalues, Eigenvalues, "a result of")
    if len(eigenvalues.speed) < 2:
        raise ValueError("one speed makes no picture: ask for several")
    if axes is None:
        from matplotlib import pyplot

        _, both = pyplot.subplots(
            2, 1, figsize=(7.6, 6.2), layout="constrained", sharex=True, height_ratios=[1.7, 1.0]
        )
        growth, frequency = both
    else:
        given = list(np.ravel(np.asarray(axes, dtype=object)))
        if len(given) != 2:
            raise ValueError(f"axes holds {len(given)} Axes: growth and frequency need two")
        growth, frequency = given
    order = np.argsort(eigenvalues.speed)
    speed = eigenvalues.speed[order]
    _growth(eigenvalues, growth, speed, order)
    _frequency(eigenvalues, frequency, speed, order)
    for here in (growth, frequency):
        here.set_xlim(float(speed[0]), float(speed[-1]))
    look: dict[str, Any] = {"fontsize": SMALL, "labelcolor": COLORS["ink"]}
    if axes is None:
        growth.set_xlabel("")
        growth.figure.legend(loc="outside lower center", ncols=2, frameon=False, **look)
    else:
        growth.legend(loc="best", framealpha=0.9, edgecolor=COLORS["rule"], **look)
    found = np.empty(2, dtype=object)
    found[:] = [growth, frequency]
    return found


def _ground(found: Eigenvalues, axes: Axes, speed: Floats, is_upper: bool) -> list[tuple[str, float]]:
    stable = mixed(COLORS["green"], 0.16, "white")
    for index, (low, high) in enumerate(found.stable_ranges):
        span = (max(low, float(speed[0])), min(high, float(speed[-1])))
        if span[0] < span[1]:
            axes.axvspan(*span, color=stable, zorder=0, label="stable hands off" if index == 0 and is_upper else "_stable")
    named = [("weave", found.weave_speed), ("capsize", found.capsize_speed)]
    shown = [(name, at) for name, at in named if at is not None and speed[0] <= at <= speed[-1]]
    for _, at in shown:
        axes.axvline(at, color=COLORS["ink"], linewidth=0.9, linestyle=(0, (4, 4)), zorder=1)
    axes.axhline(0.0, color=COLORS["ink"], linewidth=1.0, zorder=1)
    return shown


def _growth(found: Eigenvalues, axes: Axes, speed: Floats, order: npt.NDArray[np.intp]) -> None:
    shown = _ground(found, axes, speed, True)
    weave, capsize, caster = found.weave[order], found.capsize[order], found.caster[order]
    axes.plot(speed, caster.real, **_CASTER, label="caster: the fork falls in line", zorder=2.1)
    axes.plot(speed, capsize.real, **_CAPSIZE, label="capsize: a slow lean", zorder=2.2)
    axes.plot(speed, weave.real[:, 0], **_WEAVE, label="weave: steers and leans to and fro", zorder=2.3)
    axes.plot(speed, weave.real[:, 1], **_WEAVE, zorder=2.3)
    # The caster decays ever faster with speed; the axis is made for the other two, whose sign changes.
    most = max(1e-3, float(np.abs(weave.real).max()), float(np.abs(capsize.real).max()))
    axes.set_ylim(-1.6 * most, 1.15 * most)
    remark = ""
    if caster[-1].real < -1.6 * most:
        remark = f"off the chart: caster, {significant(caster[-1].real)} 1/s at {significant(speed[-1])} m/s"
    lowest = min((at for _, at in shown), default=0.0)
    for name, at in shown:
        side = -1 if at <= lowest else 1
        axes.annotate(
            f"{name} speed {at:.4f} m/s",
            (at, 1.0),
            xycoords=("data", "axes fraction"),
            xytext=(5 * side, -5),
            textcoords="offset points",
            ha="right" if side < 0 else "left",
            va="top",
            fontsize=SMALL - 0.5,
            color=COLORS["ink"],
        )
    charted(axes, "growth (above 0) or decay (below): real part, 1/s", "", "speed, m/s")
    if remark:
        axes.annotate(remark, (0.99, 0.02), xycoords="axes fraction", ha="right", va="bottom", fontsize=SMALL - 0.5, color=COLORS["grey"])


def _frequency(found: Eigenvalues, axes: Axes, speed: Floats, order: npt.NDArray[np.intp]) -> None:
    _ground(found, axes, speed, False)
    modes = ((found.caster[order], _CASTER), (found.capsize[order], _CAPSIZE), (found.weave[order].T, _WEAVE))
    most = 1.0
    for values, look in modes:
        swings = np.abs(np.atleast_2d(values).imag).max(axis=0)
        most = max(most, float(swings.max()))
        axes.plot(speed, np.where(swings > 0.0, swings, np.nan), **look, zorder=2.2)
    axes.set_ylim(0.0, 1.1 * most)
    charted(axes, "frequency: imaginary part, rad/s", "2π rad/s are one swing a second", "speed, m/s")
