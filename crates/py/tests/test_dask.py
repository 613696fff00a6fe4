"""Sweeps on a Dask cluster of several processes, of which some are killed."""

from __future__ import annotations

import os
import signal
import sys
import threading

import pytest

import bikebot

distributed = pytest.importorskip("distributed")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")

VARY = {"start.roll_deg": [1.0, 2.0, 3.0], "bike.mode": ["flywheel", "balancer"]}
SEEDS = range(50)


@pytest.fixture(scope="module")
def client():
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        yield client


@pytest.fixture(scope="module")
def ride(stand):
    """A ride of some milliseconds."""
    return stand.with_(run={"duration_s": 6.0})


@pytest.fixture(scope="module")
def table(ride):
    return bikebot.sweep(ride, vary=VARY, seeds=SEEDS, threads=1)


def pids(client) -> list[int]:
    return [pid for pid in client.run(os.getpid).values() if isinstance(pid, int)]


def test_client_and_its_executor_give_the_rows_of_one_machine(client, ride, table):
    assert len(set(pids(client)) | {os.getpid()}) == 4
    shares: list[float] = []
    for executor in (client, client.get_executor(), client.get_executor(pure=False)):
        again = bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=executor, progress=shares.append)
        assert again.equals(table) and shares[-1] == 1.0
    assert bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=client, chunk=11).equals(table)


def test_a_worker_killed_in_mid_sweep_costs_no_row(client, ride, table):
    killed: list[int] = []

    def kill(share: float) -> None:
        # One early, one late.
        if share > (0.15, 0.6, 2.0)[len(killed)]:
            before = [pid for pid in pids(client) if pid not in killed]
            os.kill(before[0], signal.SIGKILL)
            killed.append(before[0])

    again = bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=client, chunk=4, progress=kill)
    assert len(killed) == 2
    assert again["case"].tolist() == list(range(300)) and again.equals(table)


def test_a_scenario_carries_its_maps_to_the_cluster(client):
    from conftest import SCENARIOS

    fig7 = bikebot.Scenario.load(SCENARIOS / "fig7.toml").with_(run={"duration_s": 0.2})
    here = bikebot.sweep(fig7, seeds=range(6))
    assert bikebot.sweep(fig7, seeds=range(6), executor=client).equals(here)


def test_a_sweep_that_broke_off_here_goes_on_there(client, ride, table, tmp_path):
    class Enough(Exception):
        pass

    def stop(share: float) -> None:
        if share > 0.3:
            raise Enough

    with pytest.raises(Enough):
        bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=client, chunk=9, resume=tmp_path, progress=stop)
    done = list(tmp_path.glob("cases-*.npz"))
    assert 0 < len(done) < 300 // 9
    assert bikebot.sweep(ride, vary=VARY, seeds=SEEDS, resume=tmp_path).equals(table)


def test_a_cluster_that_loses_all_its_workers_is_waited_for_and_given_up(ride, table, tmp_path, monkeypatch):
    from bikebot import _spread

    monkeypatch.setattr(_spread, "LONELY", 0.2)
    monkeypatch.setattr(_spread, "FORSAKEN", 2.5)
    monkeypatch.setattr(_spread, "COUNT_EVERY", 0.1)
    with (
        distributed.LocalCluster(
            n_workers=0, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        gone = []

        def leave(share: float) -> None:
            if share > 0.3 and not gone:
                gone.append(cluster.scale(0))

        threading.Timer(1.0, lambda: cluster.scale(2)).start()
        study = {"vary": VARY, "seeds": SEEDS, "executor": client, "resume": tmp_path, "chunk": 5}
        # For the first worker it waits, and says so.
        with pytest.warns(RuntimeWarning, match="no workers"), pytest.raises(bikebot.SweepError, match="have gone"):
            bikebot.sweep(ride, **study, progress=leave)
        assert gone
        monkeypatch.setattr(_spread, "LONELY", 30.0)
        cluster.scale(1)
        assert bikebot.sweep(ride, **study).equals(table)


def test_a_cluster_takes_controllers_from_anywhere(client, ride):
    gains = (500.0, 130.0, 2.0)

    def mine(seen):
        return gains[0] * seen.roll_rad + gains[1] * seen.roll_rate_radps + gains[2] * seen.balancer_rate_radps

    study = {"vary": {"start.roll_deg": [1.0, 12.0]}, "seeds": range(4), "balancer": mine}
    assert bikebot.sweep(ride, **study, executor=client).equals(bikebot.sweep(ride, **study))


def test_a_case_that_kills_every_worker_ends_the_sweep_and_is_named(client, ride):
    class Deadly(distributed.WorkerPlugin):
        """What no worker survives."""

        def setup(self, worker):
            from bikebot import _spread

            run = _spread.run_chunk

            def run_or_die(chunk):
                if chunk.first <= 120 < chunk.first + len(chunk):
                    os.kill(os.getpid(), signal.SIGKILL)
                return run(chunk)

            _spread.run_chunk = run_or_die

    client.register_plugin(Deadly(), name="deadly")
    with pytest.raises(bikebot.SweepError) as caught:
        bikebot.sweep(ride, vary=VARY, seeds=SEEDS, executor=client, chunk=20)
    # Not those that only waited beside it.
    assert caught.value.cases == (120, 139)
    assert "cases 120 to 139 cannot be run" in str(caught.value) and "chunk=1" in str(caught.value)
