"""Worlds in, worlds out."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import ROOT, SCENARIOS

import bikebot


def test_a_grid_lies_where_its_origin_says_and_row_zero_is_the_lowest(grid):
    world = bikebot.World.from_array(grid, resolution=0.25, origin=(-1.0, 2.0))
    assert world.bounds == (-1.0, 2.0, 14.0, 12.0)
    assert world.resolution == 0.25 and world.origin == (-1.0, 2.0, 0.0)
    # The wall stands in column 30, from row 10 up.
    inside, below = (-1 + 30.5 * 0.25, 2 + 20.5 * 0.25), (-1 + 30.5 * 0.25, 2 + 5.5 * 0.25)
    clearance = world.clearance([inside, below])
    assert clearance[0] < 0 < clearance[1]
    upside = bikebot.World.from_array(grid[::-1], resolution=0.25, origin=(-1.0, 2.0), rows="top_first")
    assert np.array_equal(upside.to_array(), world.to_array())


def test_strides_order_and_flags_make_no_difference(grid):
    plain = bikebot.World.from_array(grid, resolution=0.25).to_array()
    read_only = grid.copy()
    read_only.flags.writeable = False
    wide = np.zeros((40, 120), dtype=bool)
    wide[:, ::2] = grid
    backwards = grid[::-1, ::-1].copy()[::-1, ::-1]
    for same in (read_only, np.asfortranarray(grid), wide[:, ::2], backwards):
        assert np.array_equal(bikebot.World.from_array(same, resolution=0.25).to_array(), plain)
    # A bool that holds another byte than 0 and 1 is true.
    odd = (grid.astype(np.uint8) * 7).view(bool)
    assert np.array_equal(bikebot.World.from_array(odd, resolution=0.25).to_array(), plain)


def test_int8_means_what_it_means_in_ros():
    grid = np.array([[0, 19, 20, 64], [65, 100, -1, 0]], dtype=np.int8)
    world = bikebot.World.from_array(grid, resolution=1.0)
    assert world.to_array().tolist() == [[0, 0, -1, -1], [100, 100, -1, 0]]
    free = bikebot.World.from_array(grid, resolution=1.0, unknown_is_free=True)
    assert free.to_array().tolist() == [[0, 0, 0, 0], [100, 100, 0, 0]]
    again = bikebot.World.from_array(world.to_array(), resolution=1.0)
    assert np.array_equal(again.to_array(), world.to_array())


def test_clearance_takes_arrays_of_any_strides(yard):
    points = np.random.default_rng(0).uniform(0, 20, (50, 2))
    expected = yard.clearance(points)
    assert expected.shape == (50,) and expected.dtype == np.float64
    assert np.array_equal(yard.clearance(np.asfortranarray(points)), expected)
    assert np.array_equal(yard.clearance(points[::-1])[::-1], expected)
    assert np.array_equal(yard.clearance(points.tolist()), expected)
    near_disc = np.hypot(*(points - (6, 14)).T) - 2
    assert np.all(expected <= near_disc + 1e-12)
    assert yard.clearance(np.empty((0, 2))).shape == (0,)


def test_map_files_are_read_and_their_faults_located(tmp_path):
    world = bikebot.World.load(SCENARIOS / "maps" / "fig6.json")
    assert world.name is not None and world.name.endswith("fig6.json")
    (tmp_path / "map.yaml").write_text("image: none.pgm\nresolution: x\n")
    with pytest.raises(bikebot.MapError) as caught:
        bikebot.World.load(tmp_path / "map.yaml")
    assert caught.value.file is not None and caught.value.line is not None
    with pytest.raises(FileNotFoundError):
        bikebot.World.load(tmp_path / "none.yaml")
    with pytest.raises(bikebot.MapError):
        bikebot.World.load(ROOT / "README.md")


def test_a_text_picture_names_its_ends():
    world = bikebot.World.from_text("....\n.##.\nS..G\n")
    assert world.start == (0.5, 0.5, None) and world.goal == (3.5, 0.5, None)
    with pytest.raises(bikebot.MapError) as caught:
        bikebot.World.from_text("..\n...\n")
    assert caught.value.line == 2


def test_a_world_shows_itself(yard, grid):
    assert repr(yard) == "World(20 x 20 m, 3 shapes)"
    assert yard._repr_svg_().startswith("<svg")
    assert "60 x 40 cells of 0.25 m" in repr(bikebot.World.from_array(grid, resolution=0.25))
