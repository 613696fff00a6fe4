"""Sweeps: on threads, on executors, always the same rows."""

from __future__ import annotations

import csv
import pickle
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest
from conftest import SCENARIOS

import bikebot
from bikebot._sweep import cut

VARY = {"start.roll_deg": np.linspace(1.0, 3.0, 3), "bike.mode": ["flywheel", "balancer"]}


@pytest.fixture(scope="module")
def table(stand):
    return bikebot.sweep(stand, vary=VARY, seeds=range(3, 6))


def test_rows_are_all_combinations_the_seed_fastest(table):
    assert table.rows == 18 and table["case"].tolist() == list(range(18))
    assert table["start.roll_deg"].tolist() == [1.0] * 6 + [2.0] * 6 + [3.0] * 6
    assert table["bike.mode"].tolist() == (["flywheel"] * 3 + ["balancer"] * 3) * 3
    assert table["seed"].tolist() == [3, 4, 5] * 6
    assert len(set(table["result_hash"])) == 18
    assert set(table["error"]) == {""} and table["roll_max_deg"].dtype == np.float64
    assert table["passed"].dtype == bool and "wall_time_s" not in table


def test_each_row_is_the_ride_it_names(table, stand):
    for row in (0, 7, 17):
        changes = {key: table[key][row] for key in VARY} | {"run.seed": table["seed"][row]}
        ride = stand.with_(changes).run()
        assert ride.result_hash == table["result_hash"][row]
        assert ride.outcome == table["outcome"][row]
        assert ride.metrics["roll_max_deg"] == table["roll_max_deg"][row]


def test_threads_chunks_and_executors_make_no_difference(table, stand):
    for threads in (1, 3):
        assert bikebot.sweep(stand, vary=VARY, seeds=range(3, 6), threads=threads).equals(table)
    with ThreadPoolExecutor(3) as executor:
        for chunk in (1, 4, None):
            shares: list[float] = []
            again = bikebot.sweep(
                stand, vary=VARY, seeds=range(3, 6), executor=executor, chunk=chunk, progress=shares.append
            )
            assert again.equals(table) and shares[-1] == 1.0
    with ProcessPoolExecutor(2) as executor:
        assert bikebot.sweep(stand, vary=VARY, seeds=range(3, 6), executor=executor).equals(table)


class Backwards:
    """An executor that takes its time and works from the end."""

    def __init__(self):
        self.waiting = []

    def submit(self, function, *arguments):
        future: Future = Future()
        self.waiting.append((future, function, arguments))
        if len(self.waiting) == 4:
            for future_, function_, arguments_ in reversed(self.waiting):
                # As another machine would have it.
                future_.set_result(pickle.loads(pickle.dumps(function_))(*pickle.loads(pickle.dumps(arguments_))))
        return future

    def map(self, *_):
        raise NotImplementedError


def test_the_order_in_which_chunks_come_back_does_not_matter(table, stand):
    again = bikebot.sweep(stand, vary=VARY, seeds=range(3, 6), executor=Backwards(), chunk=5)
    assert again.equals(table)


def test_chunks_are_plain_data_that_cover_every_case_once(stand):
    varied = [(("run.duration_s", str(i)),) for i in range(10)]
    chunks = cut(stand, varied, list(range(10)), 4)
    assert [len(chunk) for chunk in chunks] == [4, 4, 2] and [it.first for it in chunks] == [0, 4, 8]
    again = pickle.loads(pickle.dumps(chunks[1]))
    assert again == chunks[1] and again.seeds == (4, 5, 6, 7)


def test_a_scenario_carries_its_maps_to_workers(tmp_path):
    scenario = bikebot.Scenario.load(SCENARIOS / "fig7.toml").with_(run={"duration_s": 0.2})
    here = bikebot.sweep(scenario, seeds=range(2))
    with ProcessPoolExecutor(1) as executor:
        assert bikebot.sweep(scenario, seeds=range(2), executor=executor).equals(here)


def test_a_value_that_no_scenario_has_is_told_before_the_first_run(stand):
    with ThreadPoolExecutor(1) as executor:
        for where in ({}, {"executor": executor}):
            with pytest.raises(bikebot.ScenarioError) as caught:
                bikebot.sweep(stand, vary={"start.rol_deg": [1.0]}, **where)
            assert "roll_deg" in str(caught.value)
            with pytest.raises(bikebot.ScenarioError):
                bikebot.sweep(stand, vary={"start.roll_deg": [1.0, 1000.0]}, **where)
    for wrong, kind in [
        ({"vary": {"start.roll_deg": 3.0}}, TypeError),
        ({"vary": {"start.roll_deg": []}}, ValueError),
        ({"vary": {"run.seed": [1]}}, ValueError),
        ({"vary": [1]}, TypeError),
        ({"seeds": 3}, TypeError),
        ({"seeds": [1.5]}, TypeError),
        ({"seeds": []}, ValueError),
        ({"seeds": range(2_000_000)}, ValueError),
        ({"threads": 0}, ValueError),
        ({"executor": 3}, TypeError),
    ]:
        with pytest.raises(kind):
            bikebot.sweep(stand, **wrong)


def test_what_a_worker_raises_ends_the_sweep(stand):
    class Broken(ThreadPoolExecutor):
        def submit(self, function, /, *arguments):
            return super().submit(lambda: 1 / 0)

    with Broken(1) as executor, pytest.raises(ZeroDivisionError):
        bikebot.sweep(stand, seeds=range(3), executor=executor)


def test_a_case_that_makes_no_sense_is_a_row_with_its_message():
    scenario = bikebot.Scenario.load(SCENARIOS / "fig7.toml").with_(run={"duration_s": 0.1})
    x0, y0, *_ = scenario.world.bounds
    start = scenario.to_dict()["start"]["x_m"]
    table = bikebot.sweep(scenario, vary={"start.x_m": [start, x0 + 0.01]})
    assert table["outcome"].tolist()[1] == "invalid" and table["error"][1] and not table["passed"][1]
    assert np.isnan(table["distance_m"][1]) and table["error"][0] == ""
