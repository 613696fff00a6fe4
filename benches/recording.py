"""What recording a ride costs: processor time of `bikebot run` beside that of a sweep of one ride, which records nothing.

    python benches/recording.py target/release/bikebot
"""

import pathlib
import resource
import subprocess
import sys
import tempfile

SCENARIOS = pathlib.Path(__file__).resolve().parents[1] / "scenarios"


def processor_time(*line):
    """The least of five, s."""
    least = float("inf")
    for _ in range(5):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([str(it) for it in line], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        least = min(least, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return least


def main():
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    program = pathlib.Path(sys.argv[1]).resolve()
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder)
        for name in ["fig7", "figure-eight", "fig6", "blocked-way", "unknown-yard", "street"]:
            scenario = SCENARIOS / f"{name}.toml"
            recorded = processor_time(program, "run", scenario, "-o", out / "ride.mcap", "--force", "-q")
            plain = processor_time(program, "sweep", scenario, "--jobs", 1, "-o", out / "ride.csv", "--force", "-q")
            size = (out / "ride.mcap").stat().st_size / 1e6
            print(f"{name:14} {1e3 * plain:6.0f} ms, recorded {1e3 * recorded:6.0f} ms (+{100 * (recorded / plain - 1):.0f} %), {size:.1f} MB")


if __name__ == "__main__":
    main()
