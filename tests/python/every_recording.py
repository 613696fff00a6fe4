"""Rides every shipped scenario and has each recording read by readers that know nothing of each other.

    pip install mcap mcap-protobuf-support rerun-sdk
    python tests/python/every_recording.py target/release/bikebot

`bikebot log check` finds it whole; the official Python packages decode every message (`read_recording.py`); Rerun finds
nothing wrong with it, sees as many messages on each topic, and makes a recording of its own of it that it finds whole. Where
`rerun-sdk` is not installed, that part is skipped, and said to be.
"""

import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

import read_recording
from mcap.reader import make_reader

SCENARIOS = pathlib.Path(__file__).resolve().parents[2] / "scenarios"
# What a line of `rerun mcap info` says of a topic: number, name, messages.
CHANNEL = re.compile(r"^\s*\d+\s+(/\S+)\s+(\d+)\s")


def run(*line, codes=(0,)):
    done = subprocess.run([str(it) for it in line], capture_output=True, text=True, check=False)
    if done.returncode not in codes:
        sys.exit(f"{' '.join(map(str, line))} ended with {done.returncode}:\n{done.stdout}{done.stderr}")
    return done.stdout + done.stderr


def rerun_program():
    beside = pathlib.Path(sys.executable).with_name("rerun")
    return str(beside) if beside.exists() else shutil.which("rerun")


def read_by_rerun(rerun, recording, counts):
    checked = run(rerun, "mcap", "check", "--full", recording)
    verdicts = {topic: verdict for verdict, topic in re.findall(r"^(\S+)\s+\d+\s+\d+\s+(/\S+)", checked, re.M)}
    assert set(verdicts) >= set(counts) and set(verdicts.values()) == {"ok"}, f"{recording}: rerun mcap check\n{checked}"
    info = run(rerun, "mcap", "info", recording)
    seen = {found[1]: int(found[2]) for found in map(CHANNEL.match, info.splitlines()) if found and int(found[2])}
    assert seen == counts, f"{recording}: rerun counts {seen}, the mcap package {counts}"
    converted = recording.with_suffix(".rrd")
    run(rerun, "mcap", "convert", recording, "-o", converted)
    assert "verified without error" in run(rerun, "rrd", "verify", converted), f"{converted} is not whole"
    rows = run(rerun, "rrd", "stats", converted)
    # Each message becomes at least one row.
    found = int(re.sub(r"\D", "", re.search(r"num_rows = ([\d\s]+)", rows)[1]))
    assert found >= sum(counts.values()), f"{converted} has {found} rows of {sum(counts.values())} messages"
    converted.unlink()


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    program, rerun = pathlib.Path(sys.argv[1]).resolve(), rerun_program()
    if rerun is None:
        print("skipped: Rerun, which is not installed (pip install rerun-sdk)")
    scenarios = sorted([*SCENARIOS.glob("*.toml"), *SCENARIOS.glob("falls/*.toml")])
    assert len(scenarios) > 10, scenarios
    with tempfile.TemporaryDirectory(prefix="bikebot-recordings-") as folder:
        for scenario in scenarios:
            recording = pathlib.Path(folder, scenario.stem + ".mcap")
            run(program, "run", scenario, "-o", recording, "-q")
            told = json.loads(run(program, "log", "check", recording, "--json"))
            assert told["whole"] and told["problem_count"] == 0, told
            read_recording.check_recording(recording)
            with open(recording, "rb") as file:
                summary = make_reader(file).get_summary()
            per_channel = summary.statistics.channel_message_counts
            counts = {it.topic: per_channel[it.id] for it in summary.channels.values() if per_channel.get(it.id)}
            assert sum(counts.values()) == told["messages"] == told["decoded"], (counts, told)
            if rerun:
                read_by_rerun(rerun, recording, counts)
            recording.unlink()
    print(f"{len(scenarios)} recordings are whole and read in full by " + ("log check, mcap and Rerun" if rerun else "log check and mcap; Rerun is not installed"))


if __name__ == "__main__":
    main()
