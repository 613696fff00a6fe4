"""Exceptions. Arguments of the wrong type or value are `TypeError` and `ValueError`; files that cannot be read `OSError`."""

from __future__ import annotations

from typing import Any


class BikebotError(Exception):
    """What bikebot refuses, and everything it raises of its own kind."""

    def __init__(self, message: str) -> None:
        super().__init__(message)
        self.message: str = message

    def __reduce__(self) -> tuple[Any, ...]:
        # The facts travel as state, so that exceptions cross processes whole.
        return (type(self), (self.message,), self.__dict__)


class ScenarioError(BikebotError):
    """A scenario that makes no sense: where, and what would do.

    `message` says what was found, `help` what would do; `file`, `line` and `column` (from 1) the place where it is written, `key` the
    dotted key, `change` the change by `with_` or `settings` that is at fault. What does not apply is None.

    >>> from bikebot import Scenario
    >>> try:
    ...     Scenario.from_text('format = 1\\nname = "x"\\n[follow]\\nmax_sped_mps = 1\\n')
    ... except ScenarioError as error:
    ...     print(error.line, error.key)
    4 follow.max_sped_mps
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
        key: str | None = None,
        change: str | None = None,
        help: str | None = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.column = column
        self.key = key
        self.change = change
        self.help = help

    def __str__(self) -> str:
        place = [self.file or ("<text>" if self.line is not None else "")]
        if self.line is not None:
            place += [str(self.line), str(self.column)]
        text = ":".join(part for part in place if part)
        text = f"{text}: {self.message}" if text else self.message
        if self.change:
            text += f" (given by the change of {self.change})"
        if self.help:
            text += f"\n  help: {self.help}"
        return text


class MapError(BikebotError):
    """A map that cannot be used: `file`, `line` (from 1) and `key` say where; what does not apply is None."""

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        key: str | None = None,
    ) -> None:
        super().__init__(message)
        self.file = file
        self.line = line
        self.key = key

    def __str__(self) -> str:
        place = ":".join(str(part) for part in (self.file, self.line) if part is not None)
        key = f"`{self.key}`" if self.key else ""
        return ": ".join(part for part in (place, key, self.message) if part)


class PlanError(BikebotError):
    """A question to the planner that makes no sense, such as a start inside an obstacle.

    `reason` is "start_in_obstacle", "goal_in_obstacle", "outside_map" or "invalid_parameter".
    """

    def __init__(self, message: str, *, reason: str | None = None) -> None:
        super().__init__(message)
        self.reason = reason


class SweepError(BikebotError):
    """A sweep that cannot go on, because those who run its cases die of them again and again.

    `cases` are the numbers of the first and the last case that were lost; None where it is not known which.
    """

    def __init__(self, message: str, *, cases: tuple[int, int] | None = None) -> None:
        super().__init__(message)
        self.cases = cases
