"""Progress: True, a function of the share done, or a bar of tqdm's make."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, Protocol


class Bar(Protocol):
    """What is used of a tqdm bar."""

    n: Any
    total: Any

    def refresh(self) -> Any: ...


Progress = bool | Callable[[float], object] | Bar


class _Line:
    """Where there is no tqdm: a line that counts up to a hundred."""

    def __init__(self, what: str) -> None:
        self.what = what
        self.shown = -1

    def __call__(self, share: float) -> None:
        percent = int(100 * share)
        if percent != self.shown:
            self.shown = percent
            end = "\n" if percent == 100 else ""
            print(f"\r{self.what}: {percent} %", end=end, file=sys.stderr, flush=True)


class _Tqdm:
    """Moves a bar to the share done."""

    def __init__(self, bar: Any, own: bool) -> None:
        self.bar = bar
        self.own = own

    def __call__(self, share: float) -> None:
        total = self.bar.total or 1
        self.bar.n = round(share * total, 3) if isinstance(total, float) else int(share * total)
        self.bar.refresh()
        if self.own and share >= 1.0:
            self.bar.close()


def reporter(progress: Any, what: str) -> Callable[[float], object] | None:
    """A function of the share done, from 0 to 1; None for none.

    >>> reporter(False, "ride") is None
    True
    >>> reporter(print, "ride") is print
    True
    """
    if progress is None or progress is False:
        return None
    if progress is True:
        try:
            from tqdm.auto import tqdm
        except ImportError:
            return _Line(what)
        form = "{l_bar}{bar}| [{elapsed}<{remaining}]"
        return _Tqdm(tqdm(total=1.0, desc=what, bar_format=form), own=True)
    if hasattr(progress, "refresh") and hasattr(progress, "total"):
        return _Tqdm(progress, own=False)
    if callable(progress):
        return progress  # type: ignore[no-any-return]
    kind = type(progress).__name__
    raise TypeError(f"progress takes True, a function of the share done, or a tqdm bar, not {kind}")
