"""Manners: Ctrl-C, progress, the interpreter's lock, panics, pickling, documentation, types."""

from __future__ import annotations

import copy
import doctest
import inspect
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT, SCENARIOS, SLOW, TIRELESS

import bikebot
from bikebot import _bikebot

LONG = {"run": {"duration_s": 5000.0}}


def long_ride() -> bikebot.Scenario:
    """A ride of an hour and more that does not end by itself."""
    stand = bikebot.Scenario.load(SCENARIOS / "balance-recover.toml")
    return stand.with_(LONG)


def interrupted_after(work, delay: float = 0.3) -> float:
    """Seconds from SIGINT until `work` has raised KeyboardInterrupt."""
    sent, ended = [], threading.Event()

    def send() -> None:
        # No signal goes to work that ended early: it would hit whatever runs next.
        if not ended.wait(delay):
            sent.append(time.perf_counter())
            os.kill(os.getpid(), signal.SIGINT)

    sender = threading.Thread(target=send)
    sender.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            work()
        return time.perf_counter() - sent[0]
    finally:
        ended.set()
        sender.join()


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_ctrl_c_is_heard(slow_world, capsys, tmp_path):
    planner = bikebot.Planner(slow_world, settings=TIRELESS)
    rides = long_ride()
    works = {
        "plan": lambda: bikebot.plan(slow_world, **SLOW),
        "plan on two threads": lambda: bikebot.plan(slow_world, threads=2, **SLOW),
        "run": lambda: rides.run(),
        "run, recorded": lambda: rides.run(record=tmp_path / "x.mcap"),
        "sweep": lambda: bikebot.sweep(rides, seeds=range(4)),
        "sweep on an executor": lambda: sweep_on_threads(rides.with_(run={"duration_s": 2000.0})),
        "table2": lambda: bikebot.table2(runs=100_000),
        "refine": lambda: waits(planner),
    }
    # The machine may be busy with other things: the best of three tells what the module does.
    latencies = {name: min(interrupted_after(work) for _ in range(3)) for name, work in works.items()}
    with capsys.disabled():
        text = ", ".join(f"{name} {1e3 * seconds:.0f}" for name, seconds in latencies.items())
        print(f"\nCtrl-C to KeyboardInterrupt, ms (50 wanted): {text}")
    # Work that does not listen goes on for minutes: this bound tells the two apart on any machine, however busy.
    assert max(latencies.values()) < 2.0, latencies
    assert not list(tmp_path.iterdir())


def sweep_on_threads(scenario: bikebot.Scenario) -> None:
    executor = ThreadPoolExecutor(2)
    try:
        bikebot.sweep(scenario, seeds=range(4), executor=executor, chunk=1)
    finally:
        # Rides on threads that are not the main one go on until they are told.
        executor.shutdown(wait=False, cancel_futures=True)


def waits(planner: bikebot.Planner) -> None:
    for _ in planner.refine(SLOW["start"], SLOW["goal"]):
        pass


def test_other_threads_keep_their_pace(slow_world, capsys):
    def count_while(work) -> float:
        """Rounds a second of a Python thread while `work` runs."""
        rounds, going = 0, True

        def run() -> None:
            nonlocal rounds
            while going:
                rounds += 1

        thread = threading.Thread(target=run)
        thread.start()
        wall = time.perf_counter()
        work()
        wall = time.perf_counter() - wall
        going = False
        thread.join()
        return rounds / wall

    stand = long_ride()
    shares = {}
    for name, work in {
        "plan": lambda: bikebot.plan(slow_world, time_limit=0.7, **SLOW),
        "run": lambda: timed(stand),
    }.items():
        # Beside another process that is as busy, which shares the machine but no interpreter: in turn, and the best of five, for
        # other programs run too.
        found = []
        for _ in range(5):
            alone = count_while(burn)
            found.append(count_while(work) / alone)
        shares[name] = max(found)
    with capsys.disabled():
        text = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items())
        print(f"\npace of another Python thread beside (90 % wanted): {text}")
    # Beside work that keeps the lock nothing runs at all: half tells the two apart on a machine with other things to do.
    assert min(shares.values()) >= 0.5, shares


def burn() -> None:
    """Another process works for as long."""
    code = "import time; end = time.perf_counter() + 0.7\nwhile time.perf_counter() < end: pass"
    subprocess.run([sys.executable, "-S", "-c", code], check=True)


def timed(scenario: bikebot.Scenario) -> None:
    """Runs for a while, ended by the function of its progress."""
    began = time.perf_counter()

    def enough(_: float) -> None:
        if time.perf_counter() - began > 0.7:
            raise TimeoutError

    with pytest.raises(TimeoutError):
        scenario.run(progress=enough)


def test_progress_is_told_and_may_end_the_work(capsys):
    shares: list[float] = []
    bikebot.Scenario.load(SCENARIOS / "fig7.toml").run(progress=shares.append)
    assert shares == sorted(shares) and shares[-1] == 1.0
    with pytest.raises(ZeroDivisionError):
        long_ride().run(progress=lambda share: 1 / 0)
    with pytest.raises(TypeError, match="progress takes"):
        long_ride().run(progress=3)
    stand = bikebot.Scenario.load(SCENARIOS / "balance-recover.toml")
    stand.run(progress=True)
    assert "%" in capsys.readouterr().err
    tqdm = pytest.importorskip("tqdm").tqdm
    with tqdm(total=100, file=open(os.devnull, "w")) as bar:
        stand.run(progress=bar)
        assert bar.n == 100


def test_progress_without_tqdm_is_a_line(capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    bikebot.Scenario.load(SCENARIOS / "balance-recover.toml").run(progress=True)
    assert capsys.readouterr().err.endswith("100 %\n")


def test_no_panic_crosses_the_border():
    for aside in (False, True):
        with pytest.raises(bikebot.BikebotError, match="bug in bikebot"):
            _bikebot._panic(aside)


def everything(yard) -> dict[str, object]:
    plan = bikebot.plan(yard, (2, 2, 0.0), (18, 4), footprint="disc:0.3")
    scenario = bikebot.Scenario.load(SCENARIOS / "fig7.toml").with_(run={"seed": 5})
    grid = np.zeros((5, 7), dtype=np.int8)
    grid[1, 2], grid[0, 0] = 100, -1
    return {
        "world": yard,
        "grid": bikebot.World.from_array(grid, resolution=0.5, origin=(1, 2, 0.3), name="grid"),
        "plan": plan,
        "planner": bikebot.Planner(yard, footprint="disc:0.3", max_curvature=0.5, tolerance=0.1),
        "certificate": bikebot.verify(plan),
        "scenario": scenario,
        "ride": scenario.run(scans=True),
        "eigenvalues": bikebot.eigenvalues("default"),
        "table": bikebot.Table({"a": np.arange(3)}),
    }


def test_everything_pickles_and_copies(yard):
    for name, thing in everything(yard).items():
        for again in (pickle.loads(pickle.dumps(thing)), copy.copy(thing), copy.deepcopy(thing)):
            assert type(again) is type(thing) and repr(again) == repr(thing), name
            if isinstance(thing, bikebot.Plan):
                assert again.result_hash == thing.result_hash and again.to_json() == thing.to_json()
                assert np.array_equal(again.xy, thing.xy) and bikebot.verify(again).holds
            if isinstance(thing, bikebot.World):
                assert again.bounds == thing.bounds and again.origin == thing.origin
                points = np.random.default_rng(0).uniform(0, 20, (200, 2))
                assert np.array_equal(again.clearance(points), thing.clearance(points))
            if isinstance(thing, bikebot.Planner):
                question = {"start": (2, 2, 0.0), "goal": (18, 4)}
                assert again.plan(**question).result_hash == thing.plan(**question).result_hash
            if isinstance(thing, bikebot.Scenario):
                assert again == thing and hash(again) == hash(thing) and again.files == thing.files
            if isinstance(thing, bikebot.Ride):
                assert again.result_hash == thing.result_hash and again.metrics == thing.metrics
                assert again.events == thing.events and again.log == thing.log
                assert again.plan.result_hash == thing.plan.result_hash and again.svg() == thing.svg()
                for key in thing.trace:
                    assert np.array_equal(again.trace[key], thing.trace[key], equal_nan=True)
                assert all(np.array_equal(a[3], b[3]) for a, b in zip(again.scans, thing.scans))


def test_exceptions_pickle_whole():
    with pytest.raises(bikebot.ScenarioError) as caught:
        bikebot.Scenario.from_text('format = 1\nname = "x"\n[run]\nsed = 1\n')
    again = pickle.loads(pickle.dumps(caught.value))
    assert str(again) == str(caught.value) and (again.line, again.key) == (4, "run.sed")
    assert issubclass(bikebot.PlanError, bikebot.BikebotError)
    assert issubclass(bikebot.MapError, bikebot.BikebotError)


def test_nothing_can_be_changed(yard):
    for thing in everything(yard).values():
        if isinstance(thing, bikebot.Table):
            continue
        names = [name for name in dir(thing) if not name.startswith("_")]
        with pytest.raises(AttributeError):
            setattr(thing, names[0], 1)


def documented() -> dict[str, object]:
    """Every public name, and every public member of the classes."""
    found: dict[str, object] = {}
    for name in bikebot.__all__:
        thing = getattr(bikebot, name)
        found[name] = thing
        if inspect.isclass(thing):
            for member, value in vars(thing).items():
                if not member.startswith("_"):
                    found[f"{name}.{member}"] = getattr(value, "__func__", value)
    del found["__version__"]
    return found


def test_every_public_name_is_documented():
    inherited = {"Refinement.close"}
    bare = [
        name
        for name, thing in documented().items()
        if callable(thing) and not (getattr(thing, "__doc__", "") or "").strip()
    ]
    assert set(bare) <= inherited, bare
    assert bikebot.__doc__ and "Raises" in bikebot.plan.__doc__


def test_the_examples_of_the_documentation_run():
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    parser = doctest.DocTestParser()
    names = {name: getattr(bikebot, name) for name in bikebot.__all__} | {"np": np}
    count = 0
    for name, thing in documented().items() | {("bikebot", bikebot)}:
        text = inspect.getdoc(thing) or ""
        test = parser.get_doctest(text, {**names, "bikebot": bikebot}, name, name, 0)
        runner.run(test)
        count += len(test.examples)
    import bikebot._progress as progress

    test = parser.get_doctest(inspect.getdoc(progress.reporter), vars(progress), "reporter", "reporter", 0)
    runner.run(test)
    assert runner.summarize().failed == 0 and count > 30, count


def python(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )


def test_the_stubs_say_what_the_module_is():
    pytest.importorskip("mypy")
    done = python("-m", "mypy.stubtest", "bikebot", "--mypy-config-file", "pyproject.toml")
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_package_is_typed():
    package = Path(bikebot.__file__).parent
    assert (package / "py.typed").is_file() and (package / "_bikebot.pyi").is_file()
    assert sorted(bikebot.__all__) == bikebot.__all__
    parts = {name for name, thing in vars(bikebot).items() if inspect.ismodule(thing)}
    public = {name for name in vars(bikebot) if not name.startswith("_")} - parts
    assert public <= set(bikebot.__all__), public - set(bikebot.__all__)


def test_a_users_program_is_strict_under_both_checkers_and_runs():
    example = str(ROOT / "crates" / "py" / "tests" / "typed_example.py")
    assert python(example).returncode == 0
    pytest.importorskip("mypy")
    done = python("-m", "mypy", "--strict", example)
    assert done.returncode == 0, done.stdout
    pytest.importorskip("pyright")
    done = python("-m", "pyright", "--pythonpath", sys.executable, example)
    if "rror" in done.stderr and "node" in done.stderr.lower():
        pytest.skip(f"pyright could not start: {done.stderr[-200:]}")
    assert done.returncode == 0, done.stdout
