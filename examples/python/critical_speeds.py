"""How fast a bicycle has to be to stay up by itself.

    python critical_speeds.py [FOLDER]       writes speeds.png there
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

import bikebot
from bikebot import plot


def main(folder: Path) -> None:
    speeds = np.linspace(0.0, 10.0, 201)
    for name in ("benchmark", "default"):
        bicycle = bikebot.eigenvalues(name, speeds=speeds)
        ranges = [f"{low:.2f} to {high:.2f} m/s" for low, high in bicycle.stable_ranges]
        print(f"{name}: stable hands off {' and '.join(ranges) or 'at no speed'}")
    axes = plot.eigenvalues(bikebot.eigenvalues("benchmark", speeds=speeds))
    axes[0].figure.suptitle("the bicycle of Meijaard et al. (2007)")
    axes[0].figure.savefig(folder / "speeds.png", dpi=120)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "."))
