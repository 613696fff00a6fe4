"""Plans and planners."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from conftest import SCENARIOS

import bikebot


@pytest.fixture(scope="module")
def path(yard):
    return bikebot.plan(
        yard, (2, 2, 0.0), (18, 4, None), max_curvature=0.8, footprint="disc:0.3", seed=7
    )


def test_the_arrays_tell_one_path(path):
    n = len(path.s)
    assert path.xy.shape == (n, 2) and path.heading.shape == path.curvature.shape == (n,)
    for array in (path.xy, path.heading, path.curvature, path.s, path.segments):
        assert array.dtype == np.float64 and not array.flags.writeable
        with pytest.raises(ValueError):
            array[0] = 1.0
    assert path.s[0] == 0.0 and abs(path.s[-1] - path.length) < 1e-9 * path.length
    steps = np.hypot(*np.diff(path.xy, axis=0).T)
    ds = np.diff(path.s)
    assert np.all(steps <= ds + 1e-12) and np.all(ds - steps < 1e-3 * ds + 1e-12)
    assert np.abs(path.curvature).max() <= path.max_curvature <= 0.8
    assert tuple(path.xy[0]) == (2.0, 2.0) and path.heading[0] == pytest.approx(0.0, abs=1e-12)


def test_the_arrays_are_the_plans_own_memory_and_outlive_it(yard):
    made = bikebot.plan(yard, (2, 2), (18, 4))
    first, second = made.xy, made.xy
    assert np.shares_memory(first, second) and not first.flags.owndata
    expected = first.copy()
    del made, second
    assert np.array_equal(first, expected)


def test_samples_are_equally_far_apart(path):
    poses = path.sample(200)
    assert poses.shape == (200, 3) and poses.dtype == np.float64
    assert tuple(poses[0, :2]) == tuple(path.xy[0]) and np.allclose(poses[-1, :2], path.xy[-1])
    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    assert np.ptp(steps) < 2e-3 * steps.mean()


def test_equal_questions_have_equal_answers(yard, path):
    again = bikebot.plan(
        yard, np.array([2.0, 2.0, 0.0]), [18, np.float32(4), None], max_curvature=0.8, footprint="disc:0.3",
        seed=np.int64(7), threads=2,
    )
    assert again.result_hash == path.result_hash
    assert np.array_equal(again.segments, path.segments)
    stopped = bikebot.plan(
        yard, (2, 2, 0.0), (18, 4), max_curvature=0.8, footprint="disc:0.3", seed=7, iterations=path.iterations
    )
    assert stopped.result_hash == path.result_hash


def test_every_method_has_a_name_and_an_end(yard):
    for method in ("laplace", "rrt", "rrt_star", "birrt", "birrt_smooth", "paper", "full"):
        found = bikebot.plan(yard, (2, 2), (18, 4), method=method, footprint="disc:0.3")
        assert found.method == method and found.outcome in ("found", "exhausted")
        if found.found:
            assert bikebot.verify(found).holds, method


def test_a_search_in_vain_is_an_outcome():
    world = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 10)])
    walled = bikebot.plan(world, (1, 1), (9, 1), footprint="disc:0.2")
    assert (walled.outcome, walled.reason, walled.found) == ("no_path", "disconnected", False)
    assert math.isnan(walled.length) and walled.xy.shape == (0, 2) and walled.segments.shape == (0, 8)
    assert repr(walled) == "Plan(no_path: disconnected, full)"
    with pytest.raises(ValueError, match="no path to sample"):
        walled.sample(3)
    with pytest.raises(ValueError, match="no path to verify"):
        bikebot.verify(walled)
    assert walled._repr_svg_().startswith("<svg")
    cut = bikebot.plan(world, (1, 1), (3, 9), time_limit=0.0)
    assert cut.outcome in ("timed_out", "found")


def test_a_question_that_makes_no_sense_says_why(yard):
    for start, goal, reason in [
        ((10, 5), (18, 4), "start_in_obstacle"),
        ((2, 2), (10, 5), "goal_in_obstacle"),
        ((-1, 2), (18, 4), "outside_map"),
    ]:
        with pytest.raises(bikebot.PlanError) as caught:
            bikebot.plan(yard, start, goal)
        assert caught.value.reason == reason
        with pytest.raises(bikebot.PlanError):
            bikebot.Planner(yard).refine(start, goal)


def test_json_goes_round_and_the_picture_too(path, yard, tmp_path):
    file = tmp_path / "plan.json"
    assert path.to_json(file) is None
    text = path.to_json()
    assert text == file.read_text() and json.loads(text)["result_hash"] == path.result_hash
    for source in (file, str(file), text):
        again = bikebot.Plan.from_json(source)
        assert again.result_hash == path.result_hash and again.to_json() == text
        assert np.array_equal(again.xy, path.xy) and again.world is None
        assert bikebot.verify(again, yard).holds
        assert "<svg" in again.svg(view="map")
    for view in ("sheet", "map", "curvature", "search"):
        assert path.svg(view=view, color_by_curvature=True).startswith("<svg")


def test_verify_finds_what_does_not_hold(path, yard):
    proven = bikebot.verify(path)
    assert proven and proven.violations == () and proven.mismatches == ()
    assert proven.length_at_least <= path.length <= proven.length_at_most
    assert proven.min_clearance >= path.min_clearance - 1e-7
    tighter = bikebot.verify(path, max_curvature=0.5 * path.max_curvature)
    assert not tighter and {it.kind for it in tighter.violations} == {"curvature"}
    assert [it.what for it in tighter.mismatches] == ["curvature limit"]
    fatter = bikebot.verify(path, footprint="disc:0.8")
    assert "clearance" in {it.kind for it in fatter.violations}
    other = bikebot.World.from_shapes((0, 0, 20, 20), discs=[tuple(path.xy[len(path.xy) // 2]) + (0.5,)])
    assert not bikebot.verify(path, other)


def test_each_better_path_is_valid_and_the_last_is_the_plan(yard):
    planner = bikebot.Planner(yard, max_curvature=0.8, footprint="disc:0.3")
    refined = planner.refine((2, 2, 0.0), (18, 4), seed=7, iterations=4000)
    paths = list(refined)
    assert len(paths) > 1 and all(bikebot.verify(it).holds for it in paths)
    costs = [it.cost for it in paths]
    assert costs == sorted(costs, reverse=True)
    plan = planner.plan((2, 2, 0.0), (18, 4), seed=7, iterations=4000)
    assert paths[-1].result_hash == plan.result_hash
    assert refined.result is not None and refined.result.result_hash == plan.result_hash
    assert next(refined, None) is None


def test_a_closed_refinement_says_so(yard):
    planner = bikebot.Planner(yard)
    with planner.refine((2, 2, 0.0), (18, 4), time_limit=60.0) as paths:
        first = next(paths)
    assert first.found and repr(paths) == "Refinement(closed)"
    with pytest.raises(ValueError, match="closed"):
        next(paths)


def test_a_refinement_without_a_path_ends_empty():
    world = bikebot.World.from_shapes((0, 0, 10, 10), boxes=[(4, 0, 5, 10)])
    refined = bikebot.Planner(world, footprint="disc:0.2").refine((1, 1), (9, 1))
    assert list(refined) == [] and refined.result is not None
    assert refined.result.outcome == "no_path"


def test_a_scenario_plans_as_it_would_ride():
    scenario = bikebot.Scenario.load(SCENARIOS / "planning" / "fig6.toml")
    plan = scenario.plan(seed=3, iterations=3000)
    assert plan.found and plan.seed == 3 and plan.world is not None
    assert bikebot.verify(plan).holds


def test_settings_are_those_of_a_scenario(yard):
    found = bikebot.plan(yard, (2, 2), (18, 4), settings={"curvature_weight": 0.0, "max_step_scales": 3.0})
    assert found.found
    with pytest.raises(bikebot.ScenarioError) as caught:
        bikebot.plan(yard, (2, 2), (18, 4), settings={"curvature_wait": 1.0})
    assert "curvature_weight" in str(caught.value) and caught.value.key == "planner.curvature_wait"
