"""Sweeps that are interrupted and go on."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from conftest import STAND

import bikebot

VARY = {"start.roll_deg": [1.0, 2.0], "bike.mode": ["flywheel", "balancer"]}


@pytest.fixture(scope="module")
def table(stand):
    return bikebot.sweep(stand, vary=VARY, seeds=range(10))


def sweep(stand, folder, **given):
    return bikebot.sweep(stand, **{"vary": VARY, "seeds": range(10), "resume": folder, **given})


def parts(folder):
    return sorted(folder.glob("cases-*.npz"))


#: A study of about two seconds, told when it begins and when it has ended.
PROGRAM = f"""
import sys, bikebot
scenario = bikebot.Scenario.from_text('''{STAND}''').with_(run={{"duration_s": 5.0}})
print("begun", flush=True)
table = bikebot.sweep(
    scenario, vary={{"start.roll_deg": [1.0, 2.0, 3.0]}}, seeds=range(120), resume=sys.argv[1], threads=2, chunk=int(sys.argv[2])
)
print("ended", flush=True)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_killed_at_a_random_instant_twenty_times_and_resumed_it_is_the_same_table(stand, tmp_path, capsys):
    ride = stand.with_(run={"duration_s": 5.0})
    study = {"vary": {"start.roll_deg": [1.0, 2.0, 3.0]}, "seeds": range(120)}
    wanted = bikebot.sweep(ride, **study)
    chance = random.Random(20261122)
    kills, studies, resumed = 0, 0, []
    while kills < 20:
        folder = tmp_path / f"study{studies}"
        ended = False
        while kills < 20 and not ended:
            command = [sys.executable, "-c", PROGRAM, str(folder), str(chance.choice([1, 3, 10]))]
            child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
            assert child.stdout is not None and child.stdout.readline() == "begun\n"
            time.sleep(chance.uniform(0.0, 0.15))
            child.send_signal(signal.SIGKILL)
            ended = child.stdout.read() == "ended\n"
            child.wait()
            child.stdout.close()
            kills += not ended
            if folder.is_dir() and not ended:
                resumed.append(len(parts(folder)))
        again = bikebot.sweep(ride, **study, resume=folder)
        assert again.equals(wanted)
        # And once more, from what is there alone.
        assert bikebot.sweep(ride, **study, resume=folder).equals(wanted)
        studies += 1
    with capsys.disabled():
        print(f"\n20 kills of {studies} studies, with {min(resumed)} to {max(resumed)} parts done: the same table each time")
    assert max(resumed) > 0


def test_a_finished_study_is_read_back(stand, table, tmp_path):
    assert sweep(stand, tmp_path).equals(table)
    before = parts(tmp_path)
    shares = []
    with ThreadPoolExecutor(1) as executor:
        executor.submit = None  # nothing is to be run
        assert sweep(stand, tmp_path, executor=executor, progress=shares.append).equals(table)
    assert parts(tmp_path) == before and shares == [1.0]


def test_parts_of_any_size_by_any_executor_make_the_same_table(stand, table, tmp_path):
    class Enough(Exception):
        pass

    def stop_at(most):
        def look(share):
            if share >= most:
                raise Enough

        return look

    with pytest.raises(Enough):
        sweep(stand, tmp_path, chunk=3, progress=stop_at(0.2))
    with ThreadPoolExecutor(2) as executor, pytest.raises(Enough):
        sweep(stand, tmp_path, executor=executor, chunk=7, progress=stop_at(0.6))
    assert 0 < len(parts(tmp_path)) < 14
    assert sweep(stand, tmp_path, threads=1).equals(table)


def test_parts_that_are_cut_or_changed_are_set_aside_and_run_again(stand, table, tmp_path):
    sweep(stand, tmp_path, chunk=8)
    first, second, third, *_ = parts(tmp_path)
    first.write_bytes(first.read_bytes()[:-100])
    flipped = bytearray(second.read_bytes())
    flipped[len(flipped) // 2] ^= 1
    second.write_bytes(flipped)
    third.write_bytes(b"")
    with pytest.warns(RuntimeWarning, match="set aside") as warned:
        assert sweep(stand, tmp_path).equals(table)
    assert len(warned) == 3 and len(list(tmp_path.glob("*.broken"))) == 3
    assert sweep(stand, tmp_path).equals(table)


def test_parts_that_overlap_count_once(stand, table, tmp_path):
    """As two sweeps leave them that fill one folder at the same time."""
    one, other = tmp_path / "one", tmp_path / "other"
    sweep(stand, one, chunk=7)
    sweep(stand, other, chunk=4)
    for path in parts(other):
        os.replace(path, one / path.name)
    assert sweep(stand, one).equals(table)


def test_another_study_is_refused_and_told_apart(stand, tmp_path):
    sweep(stand, tmp_path)
    for given, words in [
        ({"seeds": range(11)}, "seeds"),
        ({"vary": {**VARY, "start.roll_deg": [1.0, 2.5]}}, "vary['start.roll_deg'] is [1.0, 2.5], there [1.0, 2.0]"),
        ({"vary": {"start.roll_deg": [1.0, 2.0]}}, "vary['bike.mode'] is nothing"),
        ({"vary": dict(reversed(VARY.items()))}, "order of the keys"),
    ]:
        with pytest.raises(ValueError) as caught:
            sweep(stand, tmp_path, **given)
        assert words in str(caught.value) and "another study" in str(caught.value)
    with pytest.raises(ValueError, match="the scenario differs"):
        sweep(stand.with_(run={"duration_s": 1.5}), tmp_path)
    about = tmp_path / "study.json"
    study = json.loads(about.read_text())
    about.write_text(json.dumps({**study, "bikebot": "0.0.1"}))
    with pytest.raises(ValueError, match="the version of bikebot"):
        sweep(stand, tmp_path)
    about.write_text(json.dumps(study)[:40])
    with pytest.raises(ValueError, match="cannot be understood"):
        sweep(stand, tmp_path)
    about.unlink()
    with pytest.raises(ValueError, match="holds other things"):
        sweep(stand, tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_ends_it_at_once_and_leaves_what_is_done(stand, tmp_path, capsys):
    from test_manners import interrupted_after

    rides = stand.with_(run={"duration_s": 100.0})
    latency = interrupted_after(lambda: sweep(rides, tmp_path, seeds=range(1000), chunk=1))
    with capsys.disabled():
        print(f"\nCtrl-C to KeyboardInterrupt, ms (50 wanted): sweep with resume {1e3 * latency:.0f}")
    assert latency < 2.0
    assert parts(tmp_path) and not list(tmp_path.glob(".*"))


def test_a_folder_that_is_none_is_refused(stand, tmp_path):
    file = tmp_path / "file"
    file.write_text("x")
    with pytest.raises(ValueError, match="is a file"):
        sweep(stand, file)
    for wrong in (3, "", True):
        with pytest.raises(TypeError, match="resume takes"):
            sweep(stand, wrong)
    with pytest.raises(OSError):
        sweep(stand, file / "below")


def test_maps_count_as_well(tmp_path):
    def yard(radius):
        text = f"""
format = 1
name = "yard"
[map]
bounds_m = [0, 0, 10, 10]
[[map.disc]]
center_m = [5, 5]
radius_m = {radius}
[start]
x_m = 1
y_m = 1
heading_deg = 0
[goal]
x_m = 2
y_m = 1
[run]
duration_s = 0.1
"""
        return bikebot.Scenario.from_text(text)

    bikebot.sweep(yard(1.0), resume=tmp_path)
    with pytest.raises(ValueError, match="scenario differs"):
        bikebot.sweep(yard(1.1), resume=tmp_path)


def test_columns_survive_to_the_last_bit(tmp_path):
    """Numbers that are none, minus zero and text that is not plain."""
    from bikebot._resume import Store

    odd = np.array([np.nan, -0.0, 5e-324, np.frombuffer(b"\xff" * 8)[0]])
    columns = {
        "seed": np.arange(4),
        "file": odd,
        "names": np.array(["", "ä", "a,b\n", "x" * 300]),
        "passed": np.array([True, False, True, False]),
    }
    Store(tmp_path, {"format": 1}, 4).add(0, columns)
    ((first, back),) = Store(tmp_path, {"format": 1}, 4).load()
    assert first == 0 and bikebot.Table(back).equals(bikebot.Table(columns))
