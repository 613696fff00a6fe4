"""Twenty thousand calls nobody should make: exceptions, and nothing else."""

from __future__ import annotations

import collections
import functools
import math
import random
import time

import numpy as np
import pytest
from conftest import SCENARIOS, STAND

import bikebot
from bikebot import _bikebot

CALLS = 20_000
#: What a call may raise: an argument's fault, or a word of ours.
ALLOWED = (TypeError, ValueError, KeyError, OSError, bikebot.BikebotError)

inf, nan = math.inf, math.nan


class Odd:
    """An object that answers with nonsense."""

    def __iter__(self):
        return iter((1.0, object()))

    def __float__(self):
        raise ValueError("no number")

    def __index__(self):
        raise ValueError("no index")

    def __fspath__(self):
        return "/dev/null/x"

    def tolist(self):
        return [self]


class Endless:
    """A sequence without end."""

    def __iter__(self):
        while True:
            yield 1.0


def nest(depth: int) -> list:
    inner: list = []
    for _ in range(depth):
        inner = [inner]
    return inner


def nasties(chance: random.Random) -> list:
    unaligned = np.frombuffer(b"\0" + np.arange(4.0).tobytes(), dtype=np.uint8)[1:].view(np.float64)
    loop: list = []
    loop.append(loop)
    return [
        None, True, False, 0, 1, -1, 2**31, 2**63, 2**64, -(2**70), 10**400, 0.0, -0.0, 1e-320, 1e308, -1e308, inf, -inf, nan,
        90.0, 1j, "", "x", "bike", "disc:", "disc:nan", "disc:1e9", "box:0x0", "polygon:0,0;0,0", "\0", "\ud800", "a" * 10_000,
        b"", b"\xff", (), [], {}, set(), (1,), (1, 2), (1, 2, 3), (1, 2, 3, 4), (1, "2"), (nan, 1), (1, 2, inf), (1, 2, 90.0),
        (1, None), [[1, 2]], [[1, 2], [3]], [[1, 2], [3, 4], [5, 6]], [(0, 0), (1, 0), (0, 1)], nest(50), loop, range(3), iter([1.0]),
        object(), Odd(), Endless(), type, print, lambda: None, {"a": 1}, {"a": {"b": nan}}, {1: 2}, {"": 1}, {"a..b": 1},
        {"follow.max_speed_mps": chance.uniform(-1, 3)}, {"iterations": -1},
        np.array([]), np.array(1.0), np.zeros((0, 2)), np.zeros((2, 0)), np.zeros((3, 2)), np.zeros((2, 2, 2)), np.zeros(3, dtype=object),
        np.array([nan, 1.0]), np.array([[1, inf]]), np.array([1, 2, 3], dtype=np.int8), np.zeros((4, 4), dtype=bool),
        np.zeros((4, 4), dtype=bool)[::2, ::-1], np.full((3, 3), 101, dtype=np.int8), np.full((3, 3), -128, dtype=np.int8),
        np.zeros((4, 4), dtype=">f8"), np.zeros((4, 4), dtype=np.uint8), np.zeros((4, 4), dtype=np.complex64), np.array(["a", "b"]),
        np.array([(1, 2.0)], dtype=[("a", "i4"), ("b", "f8")]), np.ma.array([1.0, 2.0], mask=[0, 1]), unaligned, unaligned[:2],
        np.float32(3), np.float64(nan), np.int8(-3), np.bool_(True), np.datetime64("now"), memoryview(b"abc"), np.zeros((1, 1), dtype=np.int8),
        chance.uniform(-20, 20), (chance.uniform(-5, 25), chance.uniform(-5, 25)),
        (chance.uniform(-5, 25), chance.uniform(-5, 25), chance.uniform(-7, 7)),
    ]


def callables(chance: random.Random, yard, stand, led, plan, planner, ride) -> list:
    """Each with a valid call's arguments, some of which are then exchanged."""
    grid = np.zeros((5, 6), dtype=bool)
    trace = ride.trace
    question = {"start": (2, 2, 0.0), "goal": (18, 4), "time_limit": 0.0005}
    return [
        (bikebot.World.load, {"path": "/dev/null"}),
        (bikebot.World.from_array, {"grid": grid, "resolution": 0.5, "origin": (0, 0), "rows": "top_first"}),
        (bikebot.World.from_shapes, {"bounds": (0, 0, 5, 5), "discs": [(1, 1, 1)], "boxes": [(0, 0, 1, 1)], "polygons": [[(0, 0), (1, 0), (0, 1)]]}),
        (bikebot.World.from_text, {"text": "..\n.#", "meters_per_cell": 1.0}),
        (yard.clearance, {"points": [(1, 1)]}),
        (bikebot.plan, {"world": yard, **question, "max_curvature": 0.8, "footprint": "disc:0.3", "method": "full", "seed": 1, "iterations": 10,
                        "margin": 0.0, "tolerance": 0.3, "settings": {"iterations": 10}, "threads": 1}),
        (bikebot.plan, {"world": yard, **question, "target_cost": 10.0, "min_time": 0.0001}),
        (bikebot.Planner, {"world": yard, "max_curvature": 0.8, "footprint": [(0, 0), (1, 0), (0, 1)], "method": "rrt", "margin": 0.1, "tolerance": 0.1}),
        (planner.plan, {**question, "seed": 3, "iterations": 5}),
        (planner.refine, {**question, "seed": 3}),
        (plan.sample, {"n": 10}),
        (plan.svg, {"view": "map", "color_by_curvature": False}),
        (bikebot.Plan.from_json, {"source": "{}"}),
        (bikebot.verify, {"plan": plan, "world": yard, "max_curvature": 0.8, "footprint": "point", "margin": 0.0}),
        (bikebot.Scenario.load, {"path": "/dev/null"}),
        (bikebot.Scenario.from_text, {"text": STAND, "folder": ".", "files": {}}),
        (lambda **sections: stand.with_(**sections), {"run": {"seed": 1}, "start": {"roll_deg": 1.0}}),
        (stand.with_, {"changes": {"run.seed": 1}}),
        (stand.plan, {"seed": 1}),
        (lambda name: trace[name], {"name": "roll_rad"}),
        (trace.time, {"name": "roll_rad"}),
        (trace.get, {"name": "roll_rad", "default": 1}),
        (bikebot.read_log, {"path": "/dev/null"}),
        (bikebot.eigenvalues, {"parameters": "benchmark", "speeds": [1.0, 2.0]}),
        (bikebot.sweep, {"scenario": stand, "vary": {"start.roll_deg": [1]}, "seeds": range(2), "executor": None, "threads": 1, "chunk": 1, "progress": None}),
        (bikebot.sweep, {"scenario": stand, "seeds": range(2), "resume": None, "balancer": lambda seen: 0.0, "follower": None}),
        (bikebot.Table, {"columns": {"a": [1]}}),
        (bikebot.Table.from_csv, {"path": "/dev/null"}),
        (_bikebot._toml, {"name": "x", "object": 1}),
        (lambda balancer, follower: stand.run(balancer=balancer, follower=follower), {"balancer": lambda seen: 0.0, "follower": None}),
        (lambda answer: stand.run(balancer=lambda seen: answer), {"answer": 1.0}),
        (lambda answer: led.run(follower=lambda seen: answer), {"answer": (0.1, 0.0)}),
        *environments(),
    ]


@functools.cache
def environments() -> list:
    """Those of gymnasium, where it is installed."""
    try:
        from bikebot import gym
    except ImportError:
        return []

    def single(action, seed, **arguments):
        env = gym.BalanceEnv(**arguments)
        env.reset(seed=seed)
        env.step(action)

    def many(actions, seed, reset_mask, **arguments):
        bikes = gym.BalanceVectorEnv(**arguments)
        bikes.reset(seed=seed)
        bikes.reset(options={"reset_mask": reset_mask})
        bikes.step(actions)

    return [
        (single, {"action": np.zeros(1, np.float32), "seed": 1, "mode": "balancer", "scenario": None, "start_roll": 0.1, "render_mode": None}),
        (many, {"actions": np.zeros((2, 1), np.float32), "seed": [1, 2], "reset_mask": np.ones(2, bool), "num_envs": 2, "threads": 1, "start_roll": 0.1}),
    ]


@pytest.mark.parametrize("seed", range(4))
def test_hostile_calls_raise_and_nothing_else(seed, yard, stand, capsys, tmp_path, monkeypatch):
    # Some of what is no path is one.
    monkeypatch.chdir(tmp_path)
    chance = random.Random(seed)
    plan = bikebot.plan(yard, (2, 2, 0.0), (18, 4), footprint="disc:0.3")
    planner = bikebot.Planner(yard)
    ride = stand.run()
    led = bikebot.Scenario.load(SCENARIOS / "course.toml").with_(run={"duration_s": 0.05})
    tally = collections.Counter()
    slowest = (0.0, "")
    for _ in range(CALLS // 4):
        target, arguments = chance.choice(callables(chance, yard, stand, led, plan, planner, ride))
        arguments = dict(arguments)
        for name in chance.sample(list(arguments), min(len(arguments), chance.choice((1, 1, 1, 2, 3)))):
            arguments[name] = chance.choice(nasties(chance))
        if chance.random() < 0.02:
            arguments["no_such_argument"] = 1
        began = time.perf_counter()
        try:
            if target == stand.with_:
                target(arguments["changes"])
            else:
                target(**arguments)
            tally["returned"] += 1
        except ALLOWED as error:
            tally[type(error).__name__] += 1
            assert str(error), (target, arguments)
        slowest = max(slowest, (time.perf_counter() - began, f"{target} {str(arguments)[:300]}"))
    with capsys.disabled():
        print(f"\nhostile calls, seed {seed}: {dict(tally)}, slowest {slowest[0]:.2f} s")
    assert slowest[0] < 20.0, slowest


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda w: bikebot.plan(w, (1, 1, 90.0), (18, 4)), ValueError, ("start[2]", "radians", "math.radians(90")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4, -180)), ValueError, ("goal[2]", "±2π")),
        (lambda w: bikebot.plan(w, (1, nan), (18, 4)), ValueError, ("start[1]", "NaN", "finite")),
        (lambda w: bikebot.plan(w, "1,1", (18, 4)), TypeError, ("start", "(x, y)", "str")),
        (lambda w: bikebot.plan(w, (1,), (18, 4)), ValueError, ("start has 1 numbers",)),
        (lambda w: bikebot.plan(w, np.zeros((2, 2)), (18, 4)), ValueError, ("start", "shape")),
        (lambda w: bikebot.plan("yard", (1, 1), (18, 4)), TypeError, ("world", "World.load")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), max_curvature=0), ValueError, ("max_curvature", "above 0")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), seed=-1), ValueError, ("seed", "from 0")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), seed=1.5), TypeError, ("seed", "whole number")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), method="dijkstra"), ValueError, ("method", '"full"')),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), footprint="disc:-1"), ValueError, ("footprint", "above 0")),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), time_limit=nan), ValueError, ("time_limit",)),
        (lambda w: bikebot.plan(w, (1, 1), (18, 4), (0, 0)), TypeError, ("positional",)),
        (lambda w: bikebot.World.from_array([[0, 1]], resolution=1), TypeError, ("grid", "np.asarray")),
        (lambda w: bikebot.World.from_array(np.zeros((2, 2)), resolution=1), TypeError, ("grid", "float64", "grid > 0.5")),
        (lambda w: bikebot.World.from_array(np.zeros((0, 2), dtype=bool), resolution=1), ValueError, ("grid", "empty")),
        (lambda w: bikebot.World.from_array(np.zeros(3, dtype=bool), resolution=1), ValueError, ("grid", "two")),
        (lambda w: bikebot.World.from_array(np.full((2, 2), 101, dtype=np.int8), resolution=1), ValueError, ("grid holds 101",)),
        (lambda w: bikebot.World.from_array(np.zeros((2, 2), dtype=bool), resolution=0), ValueError, ("resolution",)),
        (lambda w: bikebot.World.from_array(np.zeros((2, 2), dtype=bool), resolution=1, origin=(0, 0, 45)), ValueError, ("origin[2]", "radians")),
        (lambda w: bikebot.World.from_array(np.zeros((2, 2), dtype=bool), resolution=1, rows="up"), ValueError, ("rows", "top_first")),
        (lambda w: w.clearance(np.zeros((3, 3))), ValueError, ("points", "(n, 2)")),
        (lambda w: w.clearance([(nan, 1)]), ValueError, ("points",)),
        (lambda w: bikebot.Scenario.load(3), TypeError, ("path", "os.PathLike")),
        (lambda w: bikebot.sweep("x"), TypeError, ("scenario",)),
    ],
)
def test_the_message_names_the_argument_and_the_remedy(yard, call, kind, words):
    with pytest.raises(kind) as caught:
        call(yard)
    assert type(caught.value) is kind
    for word in words:
        assert word in str(caught.value)
