"""Types of arguments."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any, SupportsFloat, SupportsIndex, TypeAlias, Union

import numpy as np
import numpy.typing as npt

Floats: TypeAlias = npt.NDArray[np.float64]
Number: TypeAlias = Union[SupportsFloat, SupportsIndex]
Integer: TypeAlias = SupportsIndex
Path: TypeAlias = Union[str, "os.PathLike[str]"]
#: (x, y), (x, y, heading) or (x, y, None): metres, radians.
End: TypeAlias = Union[Sequence[Union[Number, None]], npt.NDArray[Any]]
#: [[x, y], …] in metres.
Points: TypeAlias = Union[Sequence[Sequence[Number]], npt.NDArray[Any]]
#: A name, a specification such as "disc:0.4", or the vertices of a polygon.
Footprint: TypeAlias = Union[str, Points]
