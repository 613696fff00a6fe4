"""Controllers of one's own in a ride."""

from __future__ import annotations

import pickle
import sys

import numpy as np
import pytest
from conftest import SCENARIOS

import bikebot


@pytest.fixture(scope="module")
def course() -> bikebot.Scenario:
    return bikebot.Scenario.load(SCENARIOS / "course.toml")


def stiff(seen: bikebot.BalancerView) -> float:
    """A linear law about the lean asked for."""
    return (
        800.0 * (seen.roll_rad - seen.roll_reference_rad)
        + 220.0 * (seen.roll_rate_radps - seen.roll_reference_rate_radps)
        + 4.0 * seen.balancer_rate_radps
    )


class PurePursuit:
    """What [follow] controller = "pure_pursuit" does, off the rows of the curve."""

    def __init__(self, scenario: bikebot.Scenario) -> None:
        settings = scenario.to_dict()
        follow, self.wheelbase = settings["follow"], settings["bike"]["wheelbase_m"]
        law = follow["pure_pursuit"]
        self.distance, self.time = law["distance_m"], law["time_s"]
        self.steering, self.speed = law["steering_gain_per_s"], follow["speed_gain_per_s"]

    def __call__(self, seen: bikebot.FollowerView) -> tuple[float, float]:
        ahead = self.distance + self.time * max(seen.speed_mps, 0.0)
        s, at = seen.path_s_m, lambda s, column: np.interp(s, seen.path[:, 4], seen.path[:, column])
        target = np.array([at(s + ahead, 0), at(s + ahead, 1)])
        slope = (at(s + 0.05, 5) - at(s - 0.05, 5)) / 0.1
        to = target - seen.state[:2]
        bearing = np.arctan2(to[1], to[0]) - seen.heading_rad
        wanted = np.arctan(2 * self.wheelbase * np.sin(bearing) / max(np.hypot(*to), 0.1 * ahead))
        wished = seen.speed_reference_mps
        return wished * slope + self.speed * (wished - seen.speed_mps), self.steering * (wanted - seen.steer_rad)


def test_a_balance_law_of_ones_own_rides_the_course(course):
    ride = course.run(balancer=stiff)
    assert ride.outcome == "arrived" and ride.metrics["roll_max_deg"] < 12.0
    again = course.run(balancer=stiff)
    assert again.result_hash == ride.result_hash != course.run().result_hash
    assert course.run(balancer=lambda seen: 0.0).outcome == "fell"
    # The torque asked for is what the recording says.
    assert np.abs(ride.trace["balancer_torque_command_nm"]).max() > 0.5


def test_a_follower_of_ones_own_rides_the_course(course):
    course = course.with_(follow={"controller": "pure_pursuit"})
    ride, ours = course.run(follower=PurePursuit(course)), course.run()
    assert ride.outcome == "arrived"
    # The same law, but for what lies between the rows of the curve.
    apart = np.hypot(*(ride.trace[name][:1500] - ours.trace[name][:1500] for name in ("x_m", "y_m")))
    assert apart.max() < 0.05
    assert ride.metrics["lateral_error_max_m"] < 2 * ours.metrics["lateral_error_max_m"] + 0.02


def test_both_at_once_with_everything_seen(course):
    seen: list[bikebot.BalancerView] = []
    views: list[bikebot.FollowerView] = []

    def balancer(view):
        seen.append(view)
        return np.float64(stiff(view))

    def follower(view):
        views.append(view)
        return np.array([0.5 * (1.0 - view.speed_mps), 0.0])

    ride = course.with_(run={"duration_s": 1.0}).run(balancer=balancer, follower=follower)
    roll = ride.trace["roll_rad"]
    # Ideal sensors say the truth.
    assert [view.roll_rad for view in seen] == roll.tolist()
    assert [view.time_s for view in seen] == ride.trace["time_s"].tolist()
    assert len(views) == len(seen)
    view, path = views[3], views[3].path
    assert seen[3].state.tolist() == [view.roll_rad, view.balancer_rad, view.roll_rate_radps, view.balancer_rate_radps]
    assert view.state.tolist() == [
        view.x_m, view.y_m, view.heading_rad, view.steer_rad, view.roll_rad, view.balancer_rad, view.speed_mps,
        view.roll_rate_radps, view.balancer_rate_radps, view.steer_rate_radps,
    ]  # fmt: skip
    assert path is views[-1].path and path.shape[1] == 6 and not path.flags.writeable
    np.testing.assert_array_equal(path, ride.followed)
    with pytest.raises(ValueError):
        view.state[0] = 1.0
    with pytest.raises(AttributeError):
        view.x_m = 1.0
    assert "roll" in repr(seen[0]) and "along" in repr(view)


def test_what_a_controller_raises_comes_out_as_it_is(course):
    class Enough(Exception):
        pass

    raised = Enough("of this")

    def tired(seen):
        if seen.time_s > 0.1:
            raise raised
        return stiff(seen)

    with pytest.raises(Enough) as caught:
        course.run(balancer=tired)
    assert caught.value is raised and caught.traceback[-1].name == "tired"

    def interrupted(seen):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        course.run(follower=interrupted)
    with pytest.raises(SystemExit):
        course.run(follower=lambda seen: sys.exit(3))


@pytest.mark.parametrize(
    ("arguments", "kind", "words"),
    [
        ({"balancer": 3.0}, TypeError, ("balancer takes a function", "BalancerView", "float")),
        ({"follower": "pvfc"}, TypeError, ("follower takes a function", "FollowerView", "str")),
        ({"balancer": lambda seen: None}, TypeError, ("balancer returned NoneType", "at 0 s", "N m")),
        ({"balancer": lambda seen: "1"}, TypeError, ("balancer returned str", "N m")),
        ({"balancer": lambda seen: True}, TypeError, ("balancer returned bool",)),
        ({"balancer": lambda seen: 1j}, TypeError, ("balancer returned complex",)),
        ({"balancer": lambda seen: np.zeros(1)}, TypeError, ("balancer returned ndarray", "a number")),
        ({"balancer": lambda seen: np.nan}, ValueError, ("balancer returned NaN", "finite")),
        ({"balancer": lambda seen: -np.inf}, ValueError, ("balancer returned -inf", "finite")),
        ({"balancer": lambda: 0.0}, TypeError, ("positional argument",)),
        ({"follower": lambda seen: 1.0}, TypeError, ("follower returned float", "acceleration", "rad/s")),
        ({"follower": lambda seen: "ab"}, TypeError, ("follower returned str",)),
        ({"follower": lambda seen: (1.0,)}, ValueError, ("follower returned 1 numbers", "two numbers")),
        ({"follower": lambda seen: np.zeros(3)}, ValueError, ("follower returned more than 2 numbers",)),
        ({"follower": lambda seen: np.zeros((2, 2))}, TypeError, ("follower returned ndarray",)),
        ({"follower": lambda seen: (0.0, np.nan)}, ValueError, ("follower returned NaN", "finite")),
    ],
)
def test_what_is_no_controller_or_no_command_is_refused(course, arguments, kind, words):
    with pytest.raises(kind) as caught:
        course.run(**arguments)
    assert type(caught.value) is kind
    for word in words:
        assert word in str(caught.value), caught.value


def test_a_follower_needs_a_path(stand):
    with pytest.raises(ValueError, match="follower: the scenario has no path"):
        stand.run(follower=lambda seen: (0.0, 0.0))


def test_a_recording_is_written_while_it_rides_and_not_after(stand, tmp_path):
    def law(seen):
        return 840.0 * seen.roll_rad + 230.0 * seen.roll_rate_radps + 3.5 * seen.balancer_rate_radps

    shares: list[float] = []
    ride = stand.run(balancer=law, record=tmp_path / "own.mcap", progress=shares.append)
    assert shares[-1] == 1.0 and any("not one of ours" in line for _, _, line in ride.log)
    read = bikebot.read_log(tmp_path / "own.mcap")
    assert read.result_hash == ride.result_hash
    for one in (ride, pickle.loads(pickle.dumps(ride))):
        with pytest.raises(ValueError, match="record=path"):
            one.write_mcap(tmp_path / "again.mcap")
    assert not (tmp_path / "again.mcap").exists()
    with pytest.raises(bikebot.BikebotError, match="controllers of your own"):
        read.write_mcap(tmp_path / "again.mcap")


def test_progress_that_raises_ends_a_ride_with_a_controller(stand):
    def progress(share):
        raise LookupError("no bar")

    with pytest.raises(LookupError):
        stand.with_(run={"duration_s": 100.0}).run(balancer=lambda seen: 500 * seen.roll_rad + 150 * seen.roll_rate_radps, progress=progress)
