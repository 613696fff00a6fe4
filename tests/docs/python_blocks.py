"""Runs the Python of README.md and docs/python.md as it is written there, page by page, in a scratch folder.

python tests/docs/python_blocks.py, with the package `bikebot` installed. What is left out, and why, stands in LEFT_OUT."""

import os
import re
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = ["README.md", "docs/python.md"]

# A part of the block, and why it is not run here.
LEFT_OUT = {
    "dask.distributed": "starts a cluster of eight processes; crates/py/tests/test_dask.py starts a smaller one",
    "num_envs=1024": "asks for gymnasium; crates/py/tests/test_gym.py tests it where that is installed",
    "bikebot.sweep(": "200 rides; crates/py/tests/test_sweep.py sweeps less",
    "plot.histories": "draws rides and a table that the reader has made; crates/py/tests/test_plot.py makes some",
}


def blocks(text: str) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def scratch(folder: Path) -> None:
    """What the pages name: a map of 100 m by 100 m, and the scenarios."""
    (folder / "yard.pgm").write_bytes(b"P5 200 200 255\n" + b"\xff" * 40_000)
    (folder / "yard.yaml").write_text(
        "image: yard.pgm\nresolution: 0.5\norigin: [0.0, 0.0, 0.0]\n"
        "negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    (folder / "scenarios").symlink_to(ROOT / "scenarios")


def main() -> int:
    ran = 0
    for page in PAGES:
        with tempfile.TemporaryDirectory() as folder:
            scratch(Path(folder))
            os.chdir(folder)
            names: dict[str, object] = {"__name__": "__main__"}
            for block in blocks((ROOT / page).read_text(encoding="utf-8")):
                reason = next((why for part, why in LEFT_OUT.items() if part in block), None)
                if reason is not None:
                    print(f"left out of {page}: {block.splitlines()[0]}: {reason}")
                    continue
                exec(compile(block, page, "exec"), names)
                ran += 1
            os.chdir(ROOT)
    print(f"{ran} blocks ran")
    return 0 if ran >= 3 else 1


if __name__ == "__main__":
    sys.exit(main())
