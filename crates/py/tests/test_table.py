"""Tables: what others read, and what comes back."""

from __future__ import annotations

import csv
import subprocess
import sys

import numpy as np
import pytest
from conftest import SCENARIOS

import bikebot

VARY = {"start.roll_deg": np.linspace(1.0, 3.0, 3), "bike.mode": ["flywheel", "balancer"]}


@pytest.fixture(scope="module")
def table(stand):
    return bikebot.sweep(stand, vary=VARY, seeds=range(3, 6))


def test_csv_is_read_back_to_the_last_bit(table, tmp_path):
    file = tmp_path / "rows.csv"
    table.to_csv(file)
    with open(file, newline="") as lines:
        rows = list(csv.DictReader(lines))
    assert [float(row["roll_max_deg"]) for row in rows] == table["roll_max_deg"].tolist()
    assert [row["result_hash"] for row in rows] == table["result_hash"].tolist()
    assert rows[0]["end_position_error_m"] == ""
    assert bikebot.Table.from_csv(file).equals(table)
    odd = bikebot.Table(
        {
            "a": np.array([1e-320, -0.0, np.inf]),
            "b": np.array(["x,y", 'a"b', "ä\nö"]),
            "reason": np.array(["1", "", "true"]),
            "passed": np.array([True, False, True]),
            "seed": np.array([0, 2**62, 5]),
        }
    )
    odd.to_csv(file)
    assert bikebot.Table.from_csv(file).equals(odd)
    file.write_text("a,b\n1,2\n3\n")
    with pytest.raises(ValueError, match="line 3"):
        bikebot.Table.from_csv(file)
    file.write_text("")
    with pytest.raises(ValueError):
        bikebot.Table.from_csv(file)


def test_the_csv_of_the_program_is_read_as_well(program, table, tmp_path):
    scenario = tmp_path / "stand.toml"
    from conftest import STAND

    scenario.write_text(STAND)
    file = tmp_path / "rows.csv"
    command = [program, "sweep", str(scenario), "--vary", "start.roll_deg=1:3:3", "--seed", "3", "--runs", "3", "-o", str(file)]
    command += ["--vary", 'bike.mode=["flywheel","balancer"]']
    subprocess.run(command, check=True, capture_output=True)
    there = bikebot.Table.from_csv(file)
    assert list(there) == list(table)
    assert there.equals(table)


def test_parquet_is_read_back_to_the_last_bit(table, tmp_path):
    pytest.importorskip("pyarrow")
    file = tmp_path / "rows.parquet"
    table.to_parquet(file)
    assert bikebot.Table.from_parquet(file).equals(table)
    odd = np.frombuffer(b"\x01\x00\x00\x00\x00\x00\xf8\xff")
    lists = bikebot.Table({"x": np.concatenate([odd, [-0.0]]), "names": np.array(["", "ä"])})
    lists.to_parquet(file)
    assert bikebot.Table.from_parquet(file).equals(lists)


def test_frames_hold_the_same_numbers(table):
    frame = pytest.importorskip("pandas") and table.to_pandas()
    assert frame.shape == (18, len(table)) and frame["bike.mode"].iloc[3] == "balancer"
    assert frame["roll_max_deg"].to_numpy().tobytes() == table["roll_max_deg"].tobytes()
    other = pytest.importorskip("polars") and table.to_polars()
    assert other.shape == (18, len(table)) and other["bike.mode"][3] == "balancer"
    assert other["roll_max_deg"].to_numpy().tobytes() == table["roll_max_deg"].tobytes()
    assert str(other["passed"].dtype) == "Boolean" and str(other["seed"].dtype) == "Int64"
    arrow = pytest.importorskip("pyarrow") and table.to_arrow()
    assert arrow.num_rows == 18 and arrow.column("seed").to_pylist() == table["seed"].tolist()


def test_lists_among_the_values_stay_lists(tmp_path):
    course = bikebot.Scenario.load(SCENARIOS / "course.toml").with_(run={"duration_s": 0.1})
    ways = [[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]], [[0.0, 0.0, 0.0], [3.0, 1.0, 0.0]]]
    table = bikebot.sweep(course, vary={"path.waypoints": ways})
    assert table["path.waypoints"].tolist() == ways
    pytest.importorskip("pyarrow")
    table.to_parquet(tmp_path / "rows.parquet")
    assert bikebot.Table.from_parquet(tmp_path / "rows.parquet")["path.waypoints"].tolist() == ways
    assert table.to_polars()["path.waypoints"].to_list() == ways


@pytest.mark.parametrize(
    ("call", "module", "extra"),
    [
        ("to_pandas", "pandas", "pandas"),
        ("to_polars", "polars", "polars"),
        ("to_arrow", "pyarrow", "arrow"),
        ("to_parquet", "pyarrow", "arrow"),
        ("from_parquet", "pyarrow", "arrow"),
    ],
)
def test_what_is_not_installed_is_named_with_its_extra(table, call, module, extra, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, module, None)
    arguments = [tmp_path / "x"] if "parquet" in call else []
    with pytest.raises(ImportError, match=rf"pip install bikebot\[{extra}\]"):
        getattr(table, call)(*arguments)


def test_a_table_shows_itself(table):
    assert "<table>" in table._repr_html_() and repr(table) == f"Table(18 rows, {len(table)} columns)"
    assert not table.equals(bikebot.Table({}))
    with pytest.raises(ValueError, match="different lengths"):
        bikebot.Table({"a": np.zeros(2), "b": np.zeros(3)})
