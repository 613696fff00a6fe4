"""Scenarios, rides, recordings."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from conftest import SCENARIOS, STAND

import bikebot


@pytest.fixture(scope="module")
def fig7():
    return bikebot.Scenario.load(SCENARIOS / "fig7.toml")


@pytest.fixture(scope="module")
def ride(fig7):
    return fig7.run(scans=True)


def test_a_ride_tells_what_happened(ride):
    assert (ride.outcome, ride.reason, ride.passed) == ("arrived", "at_goal", True)
    assert 5 < ride.metrics["distance_m"] < 20 and ride.metrics["wall_time_s"] > 0
    assert [event.kind for event in ride.events][-1] == "goal_reached"
    assert ride.log[0][1] == "info" and "fig7" in ride.log[0][2]
    assert ride.plan.found and ride.planned.shape[1] == ride.followed.shape[1] == 6
    assert len(ride.scans) > 10 and ride.scans[0][3].dtype == np.float64


def test_a_trace_is_a_mapping_of_arrays(ride):
    trace = ride.trace
    assert "roll_rad" in trace and "roll" not in trace and len(trace) == len(list(trace))
    roll = trace["roll_rad"]
    assert roll.dtype == np.float64 and not roll.flags.writeable and not roll.flags.owndata
    assert roll.shape == trace["time_s"].shape and np.array_equal(trace.time("roll_rad"), trace["time_s"])
    assert dict(trace.items()).keys() == dict(zip(trace.keys(), trace.values())).keys()
    assert trace.get("none", 3) == 3 and np.array_equal(trace.get("roll_rad"), roll)
    with pytest.raises(KeyError, match="roll_rad"):
        trace["roll"]
    with pytest.raises(TypeError, match="by name"):
        trace[0]
    assert np.degrees(np.abs(roll)).max() == pytest.approx(ride.metrics["roll_max_deg"])
    held = ride.trace["x_m"]
    del trace
    assert held[-1] == pytest.approx(ride.trace["x_m"][-1])


def test_changes_make_another_scenario_and_leave_the_first(fig7):
    other = fig7.with_(follow={"max_speed_mps": 2.0}, run={"seed": np.int64(3)})
    assert (other.seed, fig7.seed) == (3, 1) and other != fig7
    assert other == fig7.with_({"follow.max_speed_mps": 2.0, "run.seed": 3})
    assert other.to_dict()["follow"]["max_speed_mps"] == 2.0
    assert other.changes == [("follow.max_speed_mps", "2.0"), ("run.seed", "3")]
    assert "max_speed_mps = 2.0" in other.to_toml()
    pushed = fig7.with_(disturbance=[{"kind": "push", "time_s": 1.0, "impulse_ns": 5.0}])
    assert pushed.with_({"disturbance.0.impulse_ns": 2.0}).to_dict()["disturbance"][0]["impulse_ns"] == 2.0


def test_a_bad_scenario_says_where_and_what_would_do(fig7):
    text = 'format = 1\nname = "x"\n\n[follow]\n  max_speed_mps = -1\n'
    with pytest.raises(bikebot.ScenarioError) as caught:
        bikebot.Scenario.from_text(text)
    error = caught.value
    assert (error.line, error.key) == (5, "follow.max_speed_mps")
    assert text.splitlines()[error.line - 1][error.column - 1 :].startswith("-1")
    with pytest.raises(bikebot.ScenarioError) as caught:
        fig7.with_(follow={"max_sped_mps": 1})
    assert caught.value.change == "follow.max_sped_mps" and "max_speed_mps" in str(caught.value)
    with pytest.raises(bikebot.ScenarioError) as caught:
        bikebot.Scenario.from_text("format = 1\nname = [\n")
    assert caught.value.line in (2, 3)
    text = 'format = 1\nname = "x"\n[map]\nfile = "none.yaml"\n[goal]\nx_m = 1\ny_m = 1\n'
    with pytest.raises(bikebot.ScenarioError, match="none.yaml") as caught:
        bikebot.Scenario.from_text(text)
    assert caught.value.line == 4
    with pytest.raises(bikebot.MapError) as broken:
        bikebot.Scenario.from_text(text, files={"none.yaml": b"resolution: x\n"})
    assert broken.value.file == "none.yaml"
    with pytest.raises(FileNotFoundError):
        bikebot.Scenario.load("none.toml")
    with pytest.raises(bikebot.ScenarioError, match="UTF-8"):
        bikebot.Scenario.load(__import__("sys").executable)


def test_files_can_be_given_with_the_text():
    text = (SCENARIOS / "planning" / "fig6.toml").read_text()
    name = "../maps/fig6.json"
    files = {name: (SCENARIOS / "maps" / "fig6.json").read_bytes()}
    scenario = bikebot.Scenario.from_text(text, files=files)
    assert scenario.files == files
    beside = bikebot.Scenario.from_text(text, folder=SCENARIOS / "planning")
    assert beside == scenario


def test_a_start_in_an_obstacle_is_no_ride(fig7):
    x0, y0, x1, y1 = fig7.world.bounds
    with pytest.raises((bikebot.PlanError, bikebot.ScenarioError)):
        fig7.with_(start={"x_m": x0 + 0.01, "y_m": y0 + 0.01}).run()


def test_a_recording_holds_the_ride(fig7, ride, tmp_path):
    at_once, later = tmp_path / "a.mcap", tmp_path / "b.mcap"
    fig7.run(record=at_once)
    ride.write_mcap(later)
    read = bikebot.read_log(at_once)
    assert read.recorded and read.outcome == "arrived" and read.result_hash == ride.result_hash
    assert read.scenario == fig7
    assert read.metrics["distance_m"] == ride.metrics["distance_m"]
    assert set(np.round(read.trace["time_s"], 9)) <= set(np.round(ride.trace["time_s"], 9))
    again = bikebot.read_log(later)
    for name in read.trace:
        assert np.array_equal(read.trace[name], again.trace[name], equal_nan=True), name
    assert len(read.scans) == len(ride.scans)
    assert read.scenario.run().result_hash == ride.result_hash
    assert not list(tmp_path.glob("*.part"))


def test_a_recording_that_broke_off_is_read_as_far_as_it_goes(fig7, tmp_path):
    whole, half = tmp_path / "whole.mcap", tmp_path / "half.mcap"
    fig7.run(record=whole)
    content = whole.read_bytes()
    half.write_bytes(content[: len(content) // 2])
    cut = bikebot.read_log(half)
    assert cut.outcome == "cut" and 0 < len(cut.trace["time_s"]) < len(bikebot.read_log(whole).trace["time_s"])
    (tmp_path / "none.mcap").write_bytes(b"nothing")
    with pytest.raises(ValueError, match="MCAP"):
        bikebot.read_log(tmp_path / "none.mcap")
    with pytest.raises(FileNotFoundError):
        bikebot.read_log(tmp_path / "missing.mcap")


def test_a_recording_that_cannot_be_written_is_an_os_error(fig7, tmp_path):
    with pytest.raises(OSError):
        fig7.run(record=tmp_path / "no" / "such" / "folder.mcap")


def test_a_ride_shows_itself(ride, stand):
    assert ride._repr_svg_().startswith("<svg") and "distance_m" in ride._repr_html_()
    assert repr(ride).startswith('Ride("fig7": arrived (at_goal), ')
    assert repr(ride.trace).startswith("Trace(")
    standing = stand.run()
    assert standing.plan is None and standing.planned is None
    assert "<table>" in standing._repr_html_()


def test_equal_scenarios_ride_the_same(stand):
    again = bikebot.Scenario.from_text(STAND)
    assert stand.run().result_hash == again.run().result_hash
    assert hashlib.sha256(stand.to_toml().encode()).hexdigest() == hashlib.sha256(again.to_toml().encode()).hexdigest()


def test_table_2_and_eigenvalues():
    calls = []
    table = bikebot.table2(runs=1, progress=calls.append)
    assert calls[-1] == 1.0 and [row["method"] for row in table.rows][0] == "laplace"
    assert table["full"]["found"] == 1 and "full" in str(table) and "|" in table._repr_markdown_()
    lengths = table.column("length_m")
    assert lengths.shape == (len(table.rows),) and np.isfinite(lengths).any()
    with pytest.raises(KeyError):
        table["none"]
    # Meijaard et al. 2007, the benchmark's critical speeds.
    speeds = bikebot.eigenvalues("benchmark", speeds=[0.0, 5.0])
    assert speeds.weave_speed == pytest.approx(4.29238253634111)
    assert speeds.capsize_speed == pytest.approx(6.02426201538837)
    assert speeds.stable.tolist() == [False, True] and speeds.weave.shape == (2, 2)
    assert speeds.svg().startswith("<svg")
    robot = bikebot.eigenvalues(bikebot.Scenario.load(SCENARIOS / "fig7.toml"))
    assert robot.M.shape == (2, 2)
    with pytest.raises(ValueError, match="presets"):
        bikebot.eigenvalues("nonsense")
