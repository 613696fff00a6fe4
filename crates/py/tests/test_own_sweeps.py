"""Sweeps with controllers of one's own."""

from __future__ import annotations

import functools
import multiprocessing
import threading
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor

import numpy as np
import pytest

import bikebot
from bikebot._chunks import told_apart

VARY = {"start.roll_deg": [1.0, 2.0, 12.0]}


def upright(seen: bikebot.BalancerView) -> float:
    return 500.0 * seen.roll_rad + 130.0 * seen.roll_rate_radps + 2.0 * seen.balancer_rate_radps


def limp(seen: bikebot.BalancerView) -> float:
    return 0.0


def scaled(gain: float, seen: bikebot.BalancerView) -> float:
    return gain * upright(seen)


class Patient:
    """Does nothing for a while: it has a memory."""

    def __init__(self, ticks: int) -> None:
        self.ticks = ticks

    def __call__(self, seen: bikebot.BalancerView) -> float:
        self.ticks -= 1
        return 0.0 if self.ticks > 0 else upright(seen)


@pytest.fixture(scope="module")
def ride(stand):
    return stand.with_(run={"duration_s": 3.0})


@pytest.fixture(scope="module")
def table(ride):
    return bikebot.sweep(ride, vary=VARY, seeds=range(4), balancer=upright)


def test_each_row_is_the_ride_with_that_controller(ride, table, stand):
    columns = bikebot.sweep(ride, vary=VARY, seeds=range(4))
    assert list(table) == list(columns)
    assert [table[it].dtype.kind for it in table] == [columns[it].dtype.kind for it in table]
    for row in (0, 6, 11):
        changes = {"start.roll_deg": table["start.roll_deg"][row], "run.seed": table["seed"][row]}
        alone = ride.with_(changes).run(balancer=upright)
        assert alone.result_hash == table["result_hash"][row] and alone.outcome == table["outcome"][row]
        assert alone.metrics["roll_max_deg"] == table["roll_max_deg"][row]
    assert {"fell"} < set(table["outcome"])
    assert np.isnan(table["distance_m"]).all() and not table["error"].any()


def test_whoever_runs_them_the_rows_are_the_same(ride, table, tmp_path):
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        assert bikebot.sweep(ride, vary=VARY, seeds=range(4), balancer=upright, executor=executor).equals(table)
    with ThreadPoolExecutor(2) as executor:
        again = bikebot.sweep(ride, vary=VARY, seeds=range(4), balancer=upright, executor=executor, chunk=5)
        assert again.equals(table)
    assert bikebot.sweep(ride, vary=VARY, seeds=range(4), balancer=upright, resume=tmp_path).equals(table)


def test_a_controller_with_a_memory_begins_every_ride_afresh(ride):
    patient = Patient(40)
    rows = [
        bikebot.sweep(ride, seeds=range(6), balancer=patient, executor=executor, chunk=size)
        for executor, size in ((None, None), (ThreadPoolExecutor(1), 1), (ThreadPoolExecutor(1), 6))
    ]
    assert rows[1].equals(rows[0]) and rows[2].equals(rows[0]) and patient.ticks == 40


def test_a_study_is_of_one_controller(ride, tmp_path):
    def sweep(balancer):
        return bikebot.sweep(ride, seeds=range(2), balancer=balancer, resume=tmp_path)

    sweep(upright)
    sweep(upright)
    for other in (limp, Patient(3), None, lambda seen: 0.0):
        with pytest.raises(ValueError, match="balancer"):
            sweep(other)


def test_controllers_are_told_apart_by_code_and_by_what_they_hold():
    def law(gain, torque=1.0):
        return lambda seen, offset=torque: gain * seen.roll_rad + offset

    same = [law(1.0), law(1.0)]
    others = [law(2.0), law(1.0, 2.0), upright, limp, Patient(3), Patient(4), Patient(3).__call__, Patient(4).__call__]
    others += [functools.partial(scaled, 1.0), functools.partial(scaled, 2.0), law(threading.Lock()), len]
    told = [told_apart(it) for it in same + others]
    assert told[0] == told[1] and len(set(told[1:])) == len(told) - 1


def test_what_cannot_travel_is_named_with_what_would_do(ride):
    with ProcessPoolExecutor(1) as executor:
        with pytest.raises(TypeError, match="balancer cannot be sent.*top level of a module"):
            bikebot.sweep(ride, seeds=range(2), balancer=lambda seen: 0.0, executor=executor)
        with pytest.raises(TypeError, match="follower cannot be sent"):
            bikebot.sweep(ride, seeds=range(2), follower=(lambda: (lambda seen: (0.0, 0.0)))(), executor=executor)
    class Held:
        def __init__(self) -> None:
            self.lock = threading.Lock()

        def __call__(self, seen):
            return 0.0

    with pytest.raises(TypeError, match="balancer cannot be copied"):
        bikebot.sweep(ride, balancer=Held())
    with pytest.raises(TypeError, match="balancer takes a function, not int"):
        bikebot.sweep(ride, balancer=3)


def test_what_a_controller_raises_ends_the_sweep(ride):
    def broken(seen):
        raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        bikebot.sweep(ride, seeds=range(2), balancer=broken)
