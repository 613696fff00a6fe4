"""What a sweep has done so far, in a folder: so that one that was interrupted, or killed, goes on where it was.

The folder holds `study.json`, which tells of which study it is, and a file for each part that is done. A part is written under another
name, brought to the disk and renamed, so that at any instant there is either a whole part or none. Its name holds the SHA-256 of
its bytes: one that was cut or changed is noticed, set aside and computed again. Every case is the same ride whenever and wherever
it is run, so nothing depends on how the study was cut into parts, and two sweeps that fill one folder waste work and nothing else.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import re
import secrets
import time
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bikebot import _bikebot

if TYPE_CHECKING:
    from bikebot._bikebot import Scenario
    from bikebot._chunks import Columns

_STUDY = "study.json"
_PART = re.compile(r"cases-(\d{7})-(\d{7})-([0-9a-f]{32})\.npz")
#: Hexadecimal digits of the checksum in a part's name.
_DIGITS = 32
#: Seeds, and values of one key, up to which they are written out.
_WRITTEN_OUT = 1000
#: After so long, s, what somebody left half written is taken for left behind.
_STALE = 3600.0


def identity(
    scenario: Scenario,
    written: Mapping[str, Sequence[str]],
    seeds: Sequence[int],
    own: Mapping[str, str | None],
) -> dict[str, Any]:
    """All that decides what the rows are, as it stands in `study.json`; `own` tells of controllers of the caller's own."""
    files = {name: _digest(data) for name, data in sorted(scenario.files.items())}
    return {
        "format": 1,
        "bikebot": _bikebot.__version__,
        "name": scenario.name,
        "scenario": _digest(scenario.to_toml().encode()),
        "files": files,
        "vary": {key: _listed(list(values)) for key, values in written.items()},
        "order": list(written),
        "seeds": _listed(list(seeds)),
        **{name: code for name, code in own.items() if code is not None},
    }


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


def _listed(values: list[Any]) -> Any:
    """Values, or what tells very many apart."""
    if len(values) <= _WRITTEN_OUT:
        return values
    ends = {"count": len(values), "first": values[0], "last": values[-1]}
    return {**ends, "sha256": _digest(json.dumps(values).encode())}


#: In what words a study is told from another.
_WORDS = {
    "format": "the format of the folder",
    "bikebot": "the version of bikebot",
    "name": "the scenario's name",
    "scenario": "the scenario",
    "files": "the scenario's files",
    "vary": "vary",
    "order": "the order of the keys of vary",
    "seeds": "seeds",
    "follower": "follower",
    "balancer": "balancer",
}


class Store:
    """The parts of one study that are done."""

    def __init__(self, folder: str | os.PathLike[str], study: dict[str, Any], rows: int) -> None:
        self.folder = Path(folder)
        self.rows = rows
        if self.folder.exists() and not self.folder.is_dir():
            raise ValueError(f"resume is {self.folder}, which is a file: it takes a folder")
        self.folder.mkdir(parents=True, exist_ok=True)
        about = self.folder / _STUDY
        self._sweep_up()
        if about.exists():
            self._compare(about, study)
        elif any(it.name[:1] != "." for it in self.folder.iterdir()):
            raise ValueError(
                f"resume is {self.folder}, a folder that holds other things and no {_STUDY}: give an empty or a new one"
            )
        else:
            text = json.dumps(study, indent=1, ensure_ascii=False) + "\n"
            self._put(_STUDY, text.encode())

    def _compare(self, about: Path, study: dict[str, Any]) -> None:
        try:
            there = json.loads(about.read_bytes())
            if not isinstance(there, dict):
                raise ValueError("no object")
        except ValueError as error:
            raise ValueError(
                f"resume: {about} cannot be understood ({error}): delete the folder, or give another"
            ) from None
        # As it would be read, so that nothing differs by the way it is written.
        here = json.loads(json.dumps(study))
        differing = [key for key in {**there, **here} if there.get(key) != here.get(key)]
        if differing:
            raise ValueError(
                f"resume: {self.folder} holds another study, whose rows are not those of this one: "
                + "; ".join(_difference(key, there.get(key), here.get(key)) for key in differing)
                + ". Give another folder, or delete this one"
            )

    def load(self) -> list[tuple[int, Columns]]:
        """The parts that are whole, by the number of their first case, none of them overlapping."""
        found = []
        for path in sorted(self.folder.iterdir()):
            named = _PART.fullmatch(path.name)
            if named is None:
                continue
            first, last = int(named[1]), int(named[2])
            data = path.read_bytes()
            columns = _unpacked(data, last - first + 1) if _digest(data)[:_DIGITS] == named[3] else None
            if columns is None or last >= self.rows:
                aside = path.with_name(path.name + ".broken")
                path.replace(aside)
                warnings.warn(
                    f"resume: {path} is not what was written: set aside as {aside.name}, its cases are run again",
                    RuntimeWarning,
                    stacklevel=4,
                )
                continue
            found.append((first, columns))
        parts: list[tuple[int, Columns]] = []
        reached = 0
        for first, columns in sorted(found, key=lambda part: part[0]):
            skip = max(0, reached - first)
            count = len(columns["seed"])
            if skip < count:
                parts.append((first + skip, {name: it[skip:] for name, it in columns.items()}))
                reached = first + count
        return parts

    def add(self, first: int, columns: Columns) -> None:
        """Keeps a part; once this has returned it survives a power cut."""
        packed = io.BytesIO()
        # Names may be anything, such as "file", that savez would take for an argument.
        names = np.array(list(columns), dtype=np.str_)
        arrays: dict[str, Any] = {f"column_{index}": columns[name] for index, name in enumerate(columns)}
        np.savez(packed, names=names, **arrays)
        data = packed.getvalue()
        last = first + len(columns["seed"]) - 1
        self._put(f"cases-{first:07}-{last:07}-{_digest(data)[:_DIGITS]}.npz", data)

    def _put(self, name: str, data: bytes) -> None:
        half = self.folder / f".{name}.{os.getpid()}-{secrets.token_hex(4)}.half"
        try:
            with open(half, "xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(half, self.folder / name)
        except BaseException:
            half.unlink(missing_ok=True)
            raise
        if os.name == "posix":
            # The new name, too, has to reach the disk.
            handle = os.open(self.folder, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)

    def _sweep_up(self) -> None:
        """Removes what a killed sweep left half written."""
        for path in self.folder.glob(".*.half"):
            try:
                if time.time() - path.stat().st_mtime > _STALE:
                    path.unlink()
            except OSError:
                # Another sweep was faster.
                continue


def _unpacked(data: bytes, rows: int) -> Columns | None:
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as packed:
            names = packed["names"].tolist()
            columns = {name: packed[f"column_{index}"] for index, name in enumerate(names)}
    except (ValueError, KeyError, OSError, EOFError):
        return None
    whole = "seed" in columns and all(it.shape == (rows,) for it in columns.values())
    return columns if whole else None


def _difference(key: str, there: Any, here: Any) -> str:
    word = _WORDS.get(key, key)
    if key in ("scenario", "files"):
        return f"{word} differ" if key == "files" else f"{word} differs"
    if key == "vary" and isinstance(there, dict):
        keys = [it for it in {**there, **here} if there.get(it) != here.get(it)]
        return "; ".join(f"vary[{it!r}] is {_short(here.get(it))}, there {_short(there.get(it))}" for it in keys)
    return f"{word}: {_short(here)}, there {_short(there)}"


def _short(value: Any) -> str:
    if value is None:
        return "nothing"
    if isinstance(value, list):
        value = "[" + ", ".join(str(it) for it in value) + "]"
    text = str(value)
    return text if len(text) <= 60 else text[:40] + " … " + text[-15:]
