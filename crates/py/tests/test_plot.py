"""Pictures with matplotlib."""

from __future__ import annotations

import doctest
import inspect
import os
import subprocess
import sys

import numpy as np
import pytest
from conftest import SCENARIOS

import bikebot

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

from matplotlib import pyplot
from matplotlib.collections import LineCollection, PatchCollection, PolyCollection, QuadMesh
from matplotlib.colors import to_hex, to_rgba

from bikebot import plot

pytestmark = pytest.mark.filterwarnings("error::UserWarning")


@pytest.fixture(autouse=True)
def closed():
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def fig7():
    return bikebot.Scenario.load(SCENARIOS / "fig7.toml")


@pytest.fixture(scope="module")
def planned(fig7):
    return fig7.plan()


@pytest.fixture(scope="module")
def ridden(fig7):
    return fig7.run()


@pytest.fixture(scope="module")
def swept(stand):
    leans = stand.with_(run={"duration_s": 8.0})
    vary = {"start.roll_deg": [8.0, -8.0, 0.0], "start.roll_rate_radps": [0.0, 0.6], "bike.mode": ["flywheel", "balancer"]}
    return bikebot.sweep(leans, vary=vary, seeds=range(2))


def line(axes, label):
    (found,) = [it for it in axes.get_lines() if it.get_label() == label]
    return found


def test_all_that_is_drawn_can_be_saved(planned, ridden, swept, yard, tmp_path):
    for index, drawn in enumerate(
        [
            plot.world(yard),
            plot.plan(planned),
            plot.plan(planned, color_by_curvature=True, search=False, footprints=False, legend=False),
            plot.curvature(planned),
            plot.search(planned),
            plot.ride(ridden),
            plot.compare([ridden, ridden]),
            plot.history(ridden, "torque"),
            plot.histories(ridden, list(plot.HISTORIES))[0],
            plot.footprints("disc:0.4", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.3)]),
            plot.envelope(swept, "start.roll_deg", "start.roll_rate_radps"),
            plot.envelopes(swept, "start.roll_deg", "start.roll_rate_radps", title="stand")[0],
            plot.eigenvalues(bikebot.eigenvalues("benchmark", speeds=np.linspace(0, 10, 21)))[0],
            *plot.sheet(planned).axes[:1],
            *plot.sheet(ridden).axes[:1],
        ]
    ):
        file = tmp_path / f"{index}.png"
        drawn.figure.savefig(file)
        assert file.stat().st_size > 3000


def test_each_draws_on_the_axes_it_is_given(planned, ridden, swept, yard):
    _, axes = pyplot.subplots(2, 1)
    before = pyplot.get_fignums()
    for draw in (
        lambda ax: plot.world(yard, ax),
        lambda ax: plot.plan(planned, ax),
        lambda ax: plot.curvature(planned, ax),
        lambda ax: plot.search(planned, ax),
        lambda ax: plot.ride(ridden, ax),
        lambda ax: plot.compare({"a": ridden}, ax),
        lambda ax: plot.history(ridden, "roll_rate_radps", ax),
        lambda ax: plot.footprints("disc:0.4", [(0, 0, 0)], ax),
        lambda ax: plot.envelope(swept, "start.roll_deg", "start.roll_rate_radps", ax),
    ):
        axes[0].clear()
        assert draw(axes[0]) is axes[0]
    speeds = bikebot.eigenvalues("default", speeds=np.linspace(0, 5, 11))
    assert list(plot.eigenvalues(speeds, axes)) == list(axes)
    assert list(plot.histories(ridden, ["speed", "roll"], axes)) == list(axes)
    figure = pyplot.figure(99)
    assert plot.sheet(ridden, figure) is figure
    assert pyplot.get_fignums() == [*before, 99]


def test_colours_are_those_of_the_programs_pictures(planned, ridden):
    for svg, names in [
        (planned.svg(), ("vermilion", "blue", "sky", "orange", "purple", "green", "obstacle", "field")),
        (ridden.svg(), ("vermilion", "blue", "orange", "obstacle")),
    ]:
        assert all(plot.COLORS[name] in svg for name in names)
    assert all(colour in planned.svg(color_by_curvature=True) for colour in plot.RAMP if colour != plot.RAMP[3])


def test_a_plan_is_drawn_where_it_is(planned):
    axes = plot.plan(planned)
    path = line(axes, "path")
    assert np.array_equal(np.column_stack([path.get_xdata(), path.get_ydata()]), planned.xy)
    assert path.get_color() == plot.COLORS["vermilion"]
    assert axes.get_xlim() + axes.get_ylim() == (0.0, 10.0, 0.0, 10.0) and axes.get_aspect() == 1.0
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    for word in ("obstacles", "path", "guide", "coarse path", "start", "goal", "corridor, ±0.8 m"):
        assert word in labels
    (tree,) = [it for it in axes.collections if isinstance(it, LineCollection)]
    told = next(label for label in labels if label.startswith("search tree"))
    assert told == f"search tree, {len(tree.get_segments())} edges"
    # The outlines stand off the obstacles by what the plan claims.
    (outlines,) = [it for it in axes.collections if isinstance(it, PolyCollection) and it.get_zorder() == 2.4]
    rims = np.concatenate([it.vertices for it in outlines.get_paths()])
    assert planned.world.clearance(rims).min() > -1e-3


def test_curves_of_the_tree_begin_and_end_where_they_are(planned):
    from bikebot.plot._plan import _curves

    curves = np.array([[0.0, 0.0, 3.0, 0.0, 1.0, 2.0, 0.0, 3.0]])
    (points,) = _curves(curves)
    assert np.allclose(points[[0, -1]], [[0, 0], [1, 2]])
    # Leaves along x, arrives along y.
    assert abs(points[1, 1]) < abs(points[1, 0]) and abs(points[-1, 0] - points[-2, 0]) < abs(points[-1, 1] - points[-2, 1])


def test_cells_are_drawn_where_the_world_has_them():
    grid = np.zeros((4, 6), dtype=np.int8)
    grid[0, 5], grid[3, 0] = 100, -1
    axes = plot.world(bikebot.World.from_array(grid, resolution=0.5, origin=(1.0, 2.0, 0.0)))
    (picture,) = axes.images
    assert list(picture.get_extent()) == [0.0, 3.0, 0.0, 2.0]
    shades = picture.get_array()
    assert to_hex(shades[0, 5]) == plot.COLORS["obstacle"] and to_hex(shades[3, 0]) == plot.COLORS["unknown"]
    # What is free shows the field.
    assert shades[1, 1, 3] == 0.0
    corner = picture.get_transform().transform((0.0, 0.0)) - axes.transData.transform((1.0, 2.0))
    assert np.allclose(corner, 0.0)


def test_a_world_of_shapes_shows_each_of_them(yard):
    (shapes,) = [it for it in plot.world(yard).collections if isinstance(it, PatchCollection)]
    assert len(shapes.get_paths()) == 3
    again = bikebot.World.from_shapes(yard.bounds, **yard.shapes)
    assert again.svg() == yard.svg() and yard.shapes["discs"].tolist() == [[6.0, 14.0, 2.0]]


def test_histories_are_the_trace_in_the_unit_of_the_chart(ridden):
    axes = plot.history(ridden, "roll")
    roll = line(axes, "roll")
    assert np.allclose(roll.get_ydata(), np.degrees(ridden.trace["roll_rad"]), equal_nan=True)
    assert np.array_equal(roll.get_xdata(), ridden.trace["time_s"])
    wanted = line(axes, "asked for")
    assert wanted.get_color() == plot.COLORS["blue"] and wanted.get_linestyle() == "--"
    assert axes.get_title("left") == "roll, positive to the right, °" and axes.get_xlabel() == "time, s"
    assert axes.get_title("right").endswith("°")
    assert plot.history(ridden, "roll_rate_radps").get_title("left") == "roll rate, rad/s"
    assert plot.history(ridden, "heading_rad").get_title("left") == "heading, °"
    assert len(plot.histories(ridden)) == 3


def test_of_a_bike_that_stands_only_what_it_has_is_drawn(stand):
    ride = stand.run()
    axes = plot.histories(ride)
    assert [it.get_title("left") for it in axes] == ["roll, positive to the right, °"]
    plot.ride(ride).figure.savefig(os.devnull, format="png")


def test_rides_are_told_apart_by_colour_and_by_dash(fig7):
    rides = {f"{speed} m/s": fig7.with_(follow={"max_speed_mps": speed}).run() for speed in (0.8, 1.5)}
    axes = plot.history(rides, "speed")
    drawn = [line(axes, name) for name in rides]
    assert len({it.get_color() for it in drawn}) == 2 and len({it.get_linestyle() for it in drawn}) == 2
    labels = [text.get_text() for text in plot.compare(rides).get_legend().get_texts()]
    assert labels == ["obstacles", "planned path", "0.8 m/s, arrived", "1.5 m/s, arrived"]
    same = plot.compare(list(rides.values()))
    assert [text.get_text() for text in same.get_legend().get_texts()][2:] == [
        "fig7, seed 1 (1), arrived",
        "fig7, seed 1 (2), arrived",
    ]


def test_envelopes_hold_the_runs_of_the_table(swept):
    axes = plot.envelope(swept, "start.roll_deg", "start.roll_rate_radps", rows=swept["bike.mode"] == "flywheel")
    (mesh,) = [it for it in axes.collections if isinstance(it, QuadMesh)]
    shades = mesh.get_array()
    assert shades.shape == (2, 3, 4)
    rows = swept["bike.mode"] == "flywheel"
    good = swept["outcome"][rows] == "arrived"
    assert axes.get_title("right") == f"{100 * good.mean():.1f} % recovered" and 0 < good.mean() < 1
    for j, rate in enumerate((0.0, 0.6)):
        for i, roll in enumerate((-8.0, 0.0, 8.0)):
            here = rows & (swept["start.roll_deg"] == roll) & (swept["start.roll_rate_radps"] == rate)
            light = np.allclose(shades[j, i], to_rgba(plot.COLORS["recovered"]))
            assert light == bool((swept["outcome"][here] == "arrived").any())
    assert axes.get_xlabel() == "roll, °" and axes.get_ylabel() == "roll rate, rad/s"
    panels = plot.envelopes(swept, "start.roll_deg", "start.roll_rate_radps")
    assert [it.get_title("left") for it in panels] == ["mode flywheel", "mode balancer"]


def test_some_seeds_that_fail_are_a_patch():
    outcomes = np.array(["arrived", "fell", "arrived", "invalid"])
    table = bikebot.Table(
        {
            "a_m": np.array([0.0, 0.0, 1.0, 1.0]),
            "b_s": np.zeros(4),
            "seed": np.array([1, 2, 1, 2]),
            "outcome": outcomes,
            "reason": np.array(["at_rest", "slip", "at_rest", ""]),
        }
    )
    axes = plot.envelope(table, "a_m", "b_s")
    (patches,) = [it for it in axes.collections if isinstance(it, PatchCollection)]
    assert to_hex(patches.get_facecolor()[0]) == plot.COLORS["purple"]
    assert axes.get_title("right") == "66.7 % recovered"
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == ["recovered", "slip", "a patch in a light cell: some seeds fail"]


def test_what_cannot_be_drawn_is_refused(planned, ridden, swept, yard):
    for call, kind in [
        (lambda: plot.world(planned), TypeError),
        (lambda: plot.plan(ridden), TypeError),
        (lambda: plot.ride(planned), TypeError),
        (lambda: plot.compare([planned]), TypeError),
        (lambda: plot.compare([]), ValueError),
        (lambda: plot.history(ridden, "rol"), ValueError),
        (lambda: plot.histories(ridden, ["speed"], axes=[]), ValueError),
        (lambda: plot.footprints("disc:0.4", [0.0, 1.0]), ValueError),
        (lambda: plot.envelope(swept, "start.roll_deg", "bike.mode"), ValueError),
        (lambda: plot.envelope(swept, "start.roll_deg", "nothing"), ValueError),
        (lambda: plot.envelope(swept, "start.roll_deg", "seed", rows=[1, 2]), ValueError),
        (lambda: plot.eigenvalues(bikebot.eigenvalues("default", speeds=[1.0])), ValueError),
        (lambda: plot.sheet(yard), TypeError),
    ]:
        with pytest.raises(kind):
            call()


def test_a_plan_that_was_not_found_shows_what_was_searched():
    walled = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 10)])
    nothing = bikebot.plan(walled, (1, 1, 0.0), (9, 9), footprint="disc:0.3", iterations=200)
    assert not nothing.found
    assert "path" not in [it.get_label() for it in plot.plan(nothing).get_lines()]
    plot.sheet(nothing).savefig(os.devnull, format="png")


def test_a_search_that_tells_no_times_is_drawn_against_iterations(planned, ridden):
    assert plot.search(planned).get_xlabel() == "time since the search began"
    axes = plot.search(ridden.plan)
    assert axes.get_xlabel() == "iterations"
    drawn = sum(len(it.get_xdata()) for it in axes.get_lines() if it.get_linestyle() == "None")
    assert drawn == len(ridden.plan.trace["iteration"]) > 3


def test_without_a_map_there_is_room_for_all_outlines():
    axes = plot.ride(bikebot.Scenario.load(SCENARIOS / "course.toml").run())
    (outlines,) = [it for it in axes.collections if isinstance(it, PolyCollection)]
    rims = np.concatenate([it.vertices for it in outlines.get_paths()])
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    assert (rims > [x0, y0]).all() and (rims < [x1, y1]).all()


def test_a_world_from_a_file_is_titled_without_its_folders(fig7):
    assert plot.world(fig7.world).get_title() == "fig7-ride.json"


def test_a_plan_from_a_file_is_drawn_on_the_world_that_is_given(planned, tmp_path):
    planned.to_json(tmp_path / "plan.json")
    alone = bikebot.Plan.from_json(tmp_path / "plan.json")
    for world in (None, planned.world):
        axes = plot.plan(alone, world=world)
        assert len(line(axes, "path").get_xdata()) == len(alone.xy)


def test_without_a_screen_and_without_a_backend_it_works_and_shows_nothing(tmp_path):
    code = f"""
import bikebot
from bikebot import plot
from matplotlib import pyplot
pyplot.switch_backend(pyplot.get_backend())
pyplot.show = None
world = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 7)])
plot.plan(bikebot.plan(world, (1, 1, 0.0), (9, 1))).figure.savefig({str(tmp_path / "x.svg")!r})
"""
    blind = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY", "MPLBACKEND")}
    subprocess.run([sys.executable, "-c", code], check=True, env=blind)
    assert (tmp_path / "x.svg").read_text().startswith("<?xml")


def test_without_matplotlib_the_extra_is_named():
    code = "import sys; sys.modules['matplotlib'] = None; import bikebot; import bikebot.plot"
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert ended.returncode == 1 and "pip install bikebot[plot]" in ended.stderr


def test_the_examples_of_the_documentation_run():
    modules = [plot, *(module for name, module in vars(plot).items() if inspect.ismodule(module) and name.startswith("_"))]
    counts = [doctest.testmod(module) for module in modules]
    assert sum(it.attempted for it in counts) >= 10 and not any(it.failed for it in counts)


def test_every_function_says_what_it_draws():
    for name in plot.__all__:
        thing = getattr(plot, name)
        if inspect.isfunction(thing):
            assert inspect.getdoc(thing), name
