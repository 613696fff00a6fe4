"""Environments for gymnasium."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import threading
import warnings

import numpy as np
import pytest
from conftest import ROOT, SCENARIOS

import bikebot

gymnasium = pytest.importorskip("gymnasium")
gym = pytest.importorskip("bikebot.gym")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode, SyncVectorEnv  # noqa: E402

NOISY = """
format = 1
name = "noisy"
[plant]
model = "two_link"
[noise]
roll_sigma_deg = 0.1
[run]
duration_s = 0.4
"""
SHORT = {"run": {"duration_s": 0.5}}

CASES = {
    "balancer": ("bikebot/Balance-v0", {"mode": "balancer"}),
    "flywheel": ("bikebot/Balance-v0", {"mode": "flywheel"}),
    "follow": ("bikebot/Follow-v0", {}),
    "ride": ("bikebot/Ride-v0", {}),
}


@pytest.fixture(scope="module")
def noisy() -> bikebot.Scenario:
    return bikebot.Scenario.from_text(NOISY)


@pytest.fixture(scope="module")
def course() -> bikebot.Scenario:
    return bikebot.Scenario.load(SCENARIOS / "course.toml").with_(SHORT)


@pytest.mark.parametrize("name", CASES)
def test_the_checker_of_gymnasium_passes_without_a_warning(name):
    identity, arguments = CASES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(identity, **arguments)
        check_env(env.unwrapped)
        # Wrapped as well, some steps far.
        env.reset(seed=3)
        for _ in range(50):
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            if terminated or truncated:
                env.reset()
        env.close()


@pytest.mark.parametrize("name", CASES)
def test_the_vector_environment_is_made_by_its_name(name):
    identity, arguments = CASES[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bikes = gymnasium.make_vec(identity, num_envs=5, **arguments)
    assert isinstance(bikes, gymnasium.vector.VectorEnv) and bikes.num_envs == 5
    assert bikes.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    seen, infos = bikes.reset(seed=1)
    assert seen in bikes.observation_space and infos == {}
    seen, reward, terminated, truncated, infos = bikes.step(bikes.action_space.sample())
    assert seen in bikes.observation_space and seen.dtype == np.float32
    assert reward.shape == terminated.shape == truncated.shape == (5,)
    assert (reward.dtype, terminated.dtype, truncated.dtype) == (np.float64, np.bool_, np.bool_)
    bikes.close()


def outcomes(bikes, steps: int, seed: int, wide: int) -> list:
    """Everything that comes out of so many steps."""
    found = [bikes.reset(seed=seed)[0].tobytes()]
    chance = np.random.default_rng(seed)
    ends = 0
    for _ in range(steps):
        actions = chance.uniform(-1, 1, (bikes.num_envs, wide)).astype(np.float32)
        seen, reward, terminated, truncated, infos = bikes.step(actions)
        ends += int((terminated | truncated).sum())
        told = [str(it) for it in infos.get("ending", ())]
        found.append((seen.tobytes(), reward.tobytes(), terminated.tobytes(), truncated.tobytes(), told))
    assert ends > bikes.num_envs
    return found


def test_many_are_as_many_single_ones_on_any_number_of_threads(noisy, course):
    short = course.with_(run={"duration_s": 0.2})
    for one, many, scenario, count, wide in (
        (gym.BalanceEnv, gym.BalanceVectorEnv, noisy, 40, 1),
        (gym.FollowEnv, gym.FollowVectorEnv, short, 6, 2),
        (gym.RideEnv, gym.RideVectorEnv, short, 33, 3),
    ):
        singles = SyncVectorEnv([lambda one=one, scenario=scenario: one(scenario=scenario)] * count)
        expected = outcomes(singles, 200, 9, wide)
        for threads in (1, 2, 3):
            bikes = many(count, scenario=scenario, threads=threads)
            found = outcomes(bikes, 200, 9, wide)
            for step, (is_so, should) in enumerate(zip(found, expected, strict=True)):
                # gymnasium's own info of a step without an end is None, ours an empty word.
                if step and not should[4]:
                    should = (*should[:4], is_so[4])
                elif step:
                    should = (*should[:4], ["" if it == "None" else it for it in should[4]])
                assert is_so == should, (many, threads, step)


def test_buffers_are_written_in_place_where_no_copy_is_asked_for(noisy):
    bikes = gym.BalanceVectorEnv(3, scenario=noisy, copy=False)
    first, _ = bikes.reset(seed=1)
    seen, *_ = bikes.step(np.zeros((3, 1), np.float32))
    assert seen is first
    careful = gym.BalanceVectorEnv(3, scenario=noisy)
    before, _ = careful.reset(seed=1)
    kept = before.copy()
    careful.step(np.zeros((3, 1), np.float32))
    np.testing.assert_array_equal(before, kept)


def test_seeds_and_masks(noisy):
    bikes = gym.BalanceVectorEnv(4, scenario=noisy)
    first, _ = bikes.reset(seed=5)
    assert len({row.tobytes() for row in first}) == 4
    same, _ = bikes.reset(seed=[5, 6, 7, 8])
    np.testing.assert_array_equal(first, same)
    later, _ = bikes.reset()
    assert not (later == first).any()
    bikes.reset(seed=5)
    mask = np.array([False, True, False, True])
    partly, _ = bikes.reset(options={"reset_mask": mask})
    np.testing.assert_array_equal(partly[~mask], first[~mask])
    np.testing.assert_array_equal(partly[mask], later[mask])
    # Without a seed the first start is by chance.
    one, other = gym.BalanceEnv(), gym.BalanceEnv()
    assert (one.reset()[0] != other.reset()[0]).any()


def test_the_info_says_how_an_episode_ended(noisy, course):
    env = gym.BalanceEnv(scenario=noisy, mode="balancer")
    env.reset(seed=1)
    for step in range(1, 1000):
        *_, terminated, truncated, info = env.step(np.zeros(1, np.float32))
        if terminated or truncated:
            break
        assert info == {}
    assert (terminated, truncated, info) == (False, True, {"ending": "duration"}) and step == 80
    env = gym.BalanceEnv(mode="flywheel", start_roll=0.2)
    env.reset(seed=1)
    while not (terminated := env.step(np.ones(1, np.float32))[2]):
        pass
    assert terminated
    wild = gym.RideEnv(scenario=course.with_(run={"duration_s": 30.0}))
    wild.reset(seed=1)
    while True:
        *_, terminated, truncated, info = wild.step(np.array([1.0, 1.0, 1.0], np.float32))
        if terminated or truncated:
            break
    assert terminated and info["ending"] in {"roll", "slip", "wheel_lift", "left_path"}
    assert wild.path.shape == (500, 2) and env.path is None


def test_an_environment_is_the_scenarios_ride(noisy):
    """The same law, as an agent and as a balancer of one's own: the same roll, to the last bit."""
    most = noisy.to_dict()["bike"]["balancer_torque_max_nm"]

    def share(roll, roll_rate, balancer_rate):
        return np.float32(min(1.0, max(-1.0, 12.0 * roll + 3.3 * roll_rate + 0.05 * balancer_rate)))

    seen: list[np.float32] = []

    def law(view):
        seen.append(share(view.roll_rad, view.roll_rate_radps, view.balancer_rate_radps))
        return float(seen[-1]) * most

    ride = noisy.with_(run={"seed": 11}).run(balancer=law)
    nothing = {f"start_{name}": 0 for name in ("roll", "roll_rate", "balancer", "balancer_rate")}
    env = gym.BalanceEnv(scenario=noisy, **nothing)
    env.reset(seed=11)
    rolls = [env.state[4]]
    for action in seen[:-1]:
        env.step(np.array([action]))
        rolls.append(env.state[4])
    assert rolls == ride.trace["roll_rad"].tolist()


class Odd:
    def __array__(self, dtype=None, copy=None):
        raise ValueError("no array")


@pytest.mark.parametrize(
    ("action", "kind", "words"),
    [
        (np.zeros(2, np.float32), ValueError, ("action is of shape (2,)", "(1,)")),
        (np.zeros((1, 1), np.float32), ValueError, ("shape (1, 1)",)),
        (0.5, ValueError, ("shape ()", "(1,)")),
        (np.array([np.nan], np.float32), ValueError, ("actions[0, 0] is NaN", "finite")),
        (np.array([np.inf], np.float32), ValueError, ("actions[0, 0] is inf",)),
        (np.array([np.nan]), ValueError, ("is NaN",)),
        (np.array(["1"]), TypeError, ("dtype", "float32")),
        (np.array([True]), TypeError, ("dtype bool",)),
        (np.array([1j]), TypeError, ("dtype complex",)),
        (np.array([None]), TypeError, ("dtype object",)),
        (None, TypeError, ("dtype object",)),
        ("x", TypeError, ("dtype",)),
        (Odd(), ValueError, ("no array",)),
    ],
)  # fmt: skip
def test_what_is_no_action_is_refused_and_moves_nothing(action, kind, words):
    env = gym.BalanceEnv()
    env.reset(seed=1)
    before = env.state
    with pytest.raises(kind) as caught:
        env.step(action)
    for word in words:
        assert word in str(caught.value), caught.value
    np.testing.assert_array_equal(env.state, before)


@pytest.mark.parametrize("action", [[0.5], np.array([0.5]), np.array([1], np.int8), np.zeros((3, 1), np.float32)[1], np.array([1e300])])
def test_what_can_be_read_as_an_action_is(action):
    env = gym.BalanceEnv()
    env.reset(seed=1)
    env.step(action)


@pytest.mark.parametrize(
    ("make", "kind", "words"),
    [
        (lambda: gym.BalanceEnv(mode="wheel"), ValueError, ("mode", "flywheel")),
        (lambda: gym.BalanceEnv(scenario="x"), TypeError, ("scenario", "Scenario.load")),
        (lambda: gym.BalanceEnv(start_roll=-1), ValueError, ("start_roll", "0 or more")),
        (lambda: gym.BalanceEnv(start_roll="1"), TypeError, ("start_roll",)),
        (lambda: gym.BalanceEnv(start_roll=np.nan), ValueError, ("start_roll",)),
        (lambda: gym.BalanceEnv(render_mode="human"), ValueError, ("render_mode", "svg")),
        (lambda: gym.BalanceEnv(scenario=bikebot.Scenario.load(SCENARIOS / "course.toml")), ValueError, ("scenario", "two_link")),
        (lambda: gym.FollowEnv(scenario=bikebot.Scenario.from_text(NOISY)), ValueError, ("scenario", "no path")),
        (lambda: gym.FollowEnv(scenario=bikebot.Scenario.load(SCENARIOS / "unknown-yard.toml")), ValueError, ("scenario", "known")),
        (lambda: gym.BalanceVectorEnv(0), ValueError, ("num_envs", "from 1")),
        (lambda: gym.BalanceVectorEnv(2.0), TypeError, ("num_envs", "whole number")),
        (lambda: gym.BalanceVectorEnv(2, threads=-1), ValueError, ("threads",)),
        (lambda: gym.BalanceVectorEnv(2).reset(seed=-1), ValueError, ("seed",)),
        (lambda: gym.BalanceVectorEnv(2).reset(seed=[1]), ValueError, ("seed has 1 entries",)),
        (lambda: gym.BalanceVectorEnv(2).reset(seed=2**63 - 1), ValueError, ("seed",)),
        (lambda: gym.BalanceEnv().reset(seed=1.5), TypeError, ("seed",)),
        (lambda: gym.BalanceEnv().reset(seed=2**64), ValueError, ("seed",)),
    ],
)  # fmt: skip
def test_what_is_no_environment_is_refused(make, kind, words):
    with pytest.raises(kind) as caught:
        make()
    for word in words:
        assert word in str(caught.value), caught.value


def test_steps_before_a_reset_and_after_the_end_or_close_are_refused(noisy):
    env, bikes = gym.BalanceEnv(scenario=noisy), gym.BalanceVectorEnv(2, scenario=noisy)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(1, np.float32))
    with pytest.raises(gymnasium.error.ResetNeeded):
        bikes.step(np.zeros((2, 1), np.float32))
    with pytest.raises(gymnasium.error.ResetNeeded, match="reset_mask"):
        bikes.reset(options={"reset_mask": np.ones(2, np.bool_)})
    env.reset(seed=1)
    while not any(env.step(np.zeros(1, np.float32))[2:4]):
        pass
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(1, np.float32))
    bikes.reset(seed=1)
    for mask in ([True, False], np.ones(3, np.bool_), np.ones(2)):
        with pytest.raises((TypeError, ValueError), match="reset_mask"):
            bikes.reset(options={"reset_mask": mask})
    env.close()
    bikes.close()
    env.close()
    bikes.close()
    for use in (env.reset, bikes.reset, lambda: env.step([0.0]), lambda: bikes.step(np.zeros((2, 1))), lambda: env.state):
        with pytest.raises(gymnasium.error.ClosedEnvironmentError):
            use()


def test_two_threads_cannot_step_one_environment_into_disorder(noisy):
    bikes = gym.BalanceVectorEnv(256, scenario=noisy)
    bikes.reset(seed=1)
    actions, refused = np.zeros((256, 1), np.float32), []

    def step():
        for _ in range(200):
            try:
                bikes.step(actions)
            except bikebot.BikebotError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=step) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all("another thread" in text for text in refused)


def test_without_gymnasium_the_import_says_what_to_install():
    code = "import sys; sys.modules['gymnasium'] = None\nimport bikebot.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode != 0 and "ImportError" in done.stderr and "pip install bikebot[gym]" in done.stderr


def test_the_examples_of_the_documentation_run():
    import doctest

    found = doctest.testmod(gym)
    assert found.failed == 0 and found.attempted >= 9


def example(name: str):
    spec = importlib.util.spec_from_file_location(name, ROOT / "examples" / "python" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_linear_policy_learns_to_hold_balancer_mode():
    example_of = example("learn_to_balance")
    policy = example_of.learn("balancer", seed=3, candidates=32, starts=2)
    times = example_of.held(policy, seed=10**9, episodes=200)
    # From starts it has not seen, for the whole of 20 s; a policy that knows nothing holds none.
    assert (times > 19.99).mean() > 0.97, (policy, times.min())
    assert (example_of.held(np.zeros(4), seed=10**9, episodes=50) < 3.0).all()
    # The same seed learns the same, whatever the threads.
    short = [example_of.learn(seed=2, generations=2, candidates=16, starts=3, threads=n) for n in (1, 2)]
    np.testing.assert_array_equal(*short)
