"""The same question has the same answer from Python and from the program: fifty rides, two hundred plans."""

from __future__ import annotations

import json
import math
import random
import subprocess

import bikebot
from conftest import SCENARIOS

#: Ridden for a few simulated seconds each, so that fifty take little.
RIDES = [
    "balance-recover", "blocked-way", "course", "course-smooth", "crossing", "dead-end", "fig6", "fig7", "fig7-balancer", "figure-eight",
    "laser-yard", "mode-change", "push", "street", "unknown-yard",
]
COUNT_OF_RIDES = 50
COUNT_OF_PLANS = 200


def told(program: str, *arguments: str) -> list[dict]:
    """What the program prints, one object a line."""
    done = subprocess.run([program, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def test_fifty_rides(program, tmp_path, capsys):
    chance = random.Random(1)
    names = sorted(path.stem for path in SCENARIOS.glob("*.toml"))
    assert set(RIDES) <= set(names)
    for count in range(COUNT_OF_RIDES):
        name, seed = RIDES[count % len(RIDES)], chance.randrange(1000)
        changes = {"run.duration_s": round(chance.uniform(0.5, 2.5), 2), "run.seed": seed}
        if count >= len(RIDES) and name not in ("balance-recover",):
            changes["follow.max_speed_mps"] = round(chance.uniform(0.8, 2.0), 3)
        path = SCENARIOS / f"{name}.toml"
        sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
        log = tmp_path / f"{count}.mcap"
        [there] = told(program, "run", str(path), *sets, "--json", "-o", str(log))
        ride = bikebot.Scenario.load(path).with_(changes).run()
        assert ride.result_hash == there["result_hash"], (name, changes)
        assert (ride.outcome, ride.reason) == (there["outcome"], there["reason"])
        clock = {"plan_time_s", "wall_time_s", "real_time_factor"}
        here = {key: value for key, value in ride.metrics.items() if key not in clock}
        assert here == {key: value for key, value in there["metrics"].items() if key not in clock}
        if count % 10 == 0:
            assert bikebot.read_log(log).result_hash == ride.result_hash
        log.unlink()
    with capsys.disabled():
        print(f"\n{COUNT_OF_RIDES} rides: the same hash from Python and from the program")


def test_recordings_have_the_same_bytes_but_for_the_host(program, tmp_path):
    there, here = tmp_path / "there.mcap", tmp_path / "here.mcap"
    path = SCENARIOS / "fig7.toml"
    told(program, "run", str(path), "--json", "-o", str(there))
    bikebot.Scenario.load(path).run(record=here)
    a, b = there.read_bytes(), here.read_bytes()
    # Up to the record that tells of the host and its clock, which stands behind all messages.
    end = a.index(b"bikebot.host")
    assert a[: end - 16] == b[: end - 16]


def test_two_hundred_plans(program, capsys):
    done = 0
    for path in sorted((SCENARIOS / "planning").glob("*.toml")):
        runs = 10
        scenario = bikebot.Scenario.load(path)
        rows = told(program, "plan", str(path), "--runs", str(runs), "--iterations", "1500", "--json")
        for row in rows:
            plan = scenario.plan(seed=row["seed"], iterations=1500)
            assert plan.result_hash == row["result_hash"], (path.name, row["seed"])
            assert plan.outcome == row["outcome"] and plan.iterations == row["iterations"]
            assert not plan.found or plan.length == row["length_m"]
            done += 1
    chance = random.Random(2)
    maps = SCENARIOS / "maps" / "fig6.json"
    world = bikebot.World.load(maps)
    x0, y0, x1, y1 = world.bounds
    methods = ["full", "paper", "birrt_smooth", "rrt_star", "laplace"]
    while done < COUNT_OF_PLANS:
        start = (chance.uniform(x0, x1), chance.uniform(y0, y1), chance.choice([None, chance.uniform(-180, 180)]))
        goal = (chance.uniform(x0, x1), chance.uniform(y0, y1), chance.choice([None, chance.uniform(-180, 180)]))
        if min(world.clearance([start[:2], goal[:2]])) < 1.5:
            continue
        method, curvature = methods[done % len(methods)], round(chance.uniform(0.3, 1.2), 3)
        footprint, seed, runs = chance.choice(["point", "disc:0.4", "capsule:1.8x0.6", "bike"]), chance.randrange(1000), 4

        def typed(end) -> str:
            return ",".join(repr(number) for number in end if number is not None)

        rows = told(
            program, "plan", str(maps), f"--start={typed(start)}", f"--goal={typed(goal)}", "--method", method, "--max-curvature",
            str(curvature), "--footprint", footprint, "--iterations", "800", "--seed", str(seed), "--runs", str(runs), "--json",
        )

        def turned(end):
            return (*end[:2], None if end[2] is None else math.radians(end[2]))

        planner = bikebot.Planner(world, max_curvature=curvature, footprint=footprint, method=method)
        for row in rows:
            if row["outcome"] == "invalid":
                break
            plan = planner.plan(turned(start), turned(goal), seed=row["seed"], iterations=800)
            assert plan.result_hash == row["result_hash"], (start, goal, method, footprint, row)
            done += 1
    with capsys.disabled():
        print(f"\n{done} plans: the same hash from Python and from the program")


def test_both_verify_a_plan_of_the_other(program, tmp_path):
    maps = SCENARIOS / "maps" / "fig6.json"
    world = bikebot.World.load(maps)
    scenario = bikebot.Scenario.load(SCENARIOS / "planning" / "fig6.toml")
    plan = scenario.plan(iterations=2000)
    file = tmp_path / "plan.json"
    plan.to_json(file)
    [verdict] = told(program, "verify", str(file), str(SCENARIOS / "planning" / "fig6.toml"), "--json")
    assert verdict["holds"], verdict
    other = tmp_path / "other.json"
    subprocess.run(
        [program, "plan", str(SCENARIOS / "planning" / "fig6.toml"), "-o", str(other)], check=True, capture_output=True
    )
    read = bikebot.Plan.from_json(other)
    certificate = bikebot.verify(read, world)
    assert certificate.holds, (certificate.violations, certificate.mismatches)
    assert read.result_hash == json.loads(other.read_text())["result_hash"]


def test_both_record_at_the_rates_of_the_scenario(program, tmp_path):
    there, here = tmp_path / "there.mcap", tmp_path / "here.mcap"
    path = SCENARIOS / "fig7.toml"
    told(program, "run", str(path), "--set", "record.state_hz=10", "--json", "-o", str(there))
    bikebot.Scenario.load(path).with_(record={"state_hz": 10.0}).run(record=here)
    slow, same = (bikebot.read_log(log).trace["time_s"] for log in (there, here))
    assert len(slow) == len(same) and 0.09 < float(slow[1] - slow[0]) < 0.11
