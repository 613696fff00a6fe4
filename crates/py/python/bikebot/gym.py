"""Bikes to learn on: environments for gymnasium (`pip install bikebot[gym]`).

>>> import gymnasium, bikebot.gym
>>> env = gymnasium.make("bikebot/Balance-v0", mode="balancer")
>>> observation, info = env.reset(seed=7)
>>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
>>> env.close()
>>> bikes = gymnasium.make_vec("bikebot/Balance-v0", num_envs=256, mode="balancer")   # all of them stepped in Rust
>>> observations, infos = bikes.reset(seed=7)
>>> observations.shape
(256, 4)
>>> bikes.close()

| name | the agent gives | the bike |
|---|---|---|
| `bikebot/Balance-v0` | balancer torque | stands (two-link roll model); `mode` is "balancer" or "flywheel" |
| `bikebot/Follow-v0` | acceleration, steering rate | rides along a path (simplified 3D bike), balanced by the scenario's law, which also brakes before the goal |
| `bikebot/Ride-v0` | drive force, steering rate, balancer torque | the same, and nobody helps |

One step is one control period of the scenario (5 ms unless it says otherwise): sensors, motors with their limits and lags, disturbances
and faults are the scenario's, and the plant is the one of `Scenario.run`.

**Actions** are shares of the largest value, float32 from -1 to 1: of `balancer_torque_max_nm`, of `steer_rate_max_radps` (positive to
the left), of `drive_force_max_n`, of the acceleration and deceleration the follower may use. Beyond ±1 they are cut off.

**Observations** are what the sensors say, float32, in the order of `observation_names`, whose names carry the units (rad, rad/s, m, m/s,
1/m). The balancer's angle counts turns. On a path, errors and curvatures are those of the followed point, look-ahead distance
ahead of the rear contact; `heading_error_rad` is the bike's heading less the curve's.

**Rewards**: balancing, `1 - (roll/0.7)**2 - 0.1 (balancer_rate/its largest)**2 - 0.05 action**2` a step; on a path, the metres made along it,
less `(lateral error / 0.2 m)**2` a second.

**Ends**: terminated where the bike fell (|roll| above 0.7 rad, or certain to fall), slipped, lifted a wheel, met an obstacle, is more
than 1 m beside the path or 0.5 m past its end, or is at rest at the goal; truncated after `run.duration_s`. `info["ending"]` says which:
`"roll"`, `"slip"`, `"wheel_lift"`, `"obstacle"`, `"moving_obstacle"`, `"left_path"`, `"past_goal"`, `"not_finite"`, `"control_failed"`,
`"at_goal"`, `"duration"`.

**Chance**: the k-th episode after `reset(seed=s)` depends on s and k and on nothing else; bike i of a vector environment has seed s + i and
does bit for bit what an environment of its own would do.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, ClassVar, SupportsFloat, SupportsIndex, TypeAlias

import numpy as np
import numpy.typing as npt

try:
    import gymnasium
    from gymnasium import error, spaces
    from gymnasium.vector import VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError as _missing:
    raise ImportError("bikebot.gym needs gymnasium: pip install bikebot[gym]") from _missing

try:
    from gymnasium.vector import AutoresetMode

    _NEXT_STEP: Any = AutoresetMode.NEXT_STEP
except ImportError:  # gymnasium 1.0 knows no other
    _NEXT_STEP = "NextStep"

from bikebot._bikebot import Scenario, _Bikes

__all__ = [
    "BalanceEnv",
    "BalanceVectorEnv",
    "FollowEnv",
    "FollowVectorEnv",
    "RideEnv",
    "RideVectorEnv",
]

_Array: TypeAlias = npt.NDArray[np.float32]
_Flags: TypeAlias = npt.NDArray[np.bool_]

#: What a start is spread in, as far as a bike has it.
_STARTS = ("roll", "roll_rate", "balancer", "balancer_rate", "lateral", "heading")

#: Largest seed.
_SEEDS = 2**63 - 1

_STAND = """
format = 1
name = "balance"
[plant]
model = "two_link"
[bike]
mode = "{mode}"
[run]
duration_s = 20.0
"""

_YARD = """
format = 1
name = "yard"
[map]
bounds_m = [0.0, 0.0, 16.0, 12.0]
[[map.disc]]
center_m = [6.0, 5.5]
radius_m = 1.2
[[map.box]]
min_m = [9.5, 6.5]
max_m = [11.0, 12.0]
[start]
x_m = 2.0
y_m = 3.0
heading_deg = 20.0
speed_mps = 0.5
[goal]
x_m = 13.5
y_m = 9.0
[run]
duration_s = 40.0
"""


def _checked(scenario: object, default: str) -> Scenario:
    if scenario is None:
        return Scenario.from_text(default)
    if not isinstance(scenario, Scenario):
        raise TypeError(
            f"scenario takes a bikebot.Scenario, made by Scenario.load or Scenario.from_text, not {type(scenario).__name__}"
        )
    return scenario


def _standing(scenario: object, mode: object) -> Scenario:
    if mode not in (None, "balancer", "flywheel"):
        raise ValueError(f'mode is {mode!r}: it takes "balancer" or "flywheel"')
    if scenario is not None and mode is not None:
        return _checked(scenario, "").with_(bike={"mode": mode})
    return _checked(scenario, _STAND.format(mode=mode or "balancer"))


def _spread(name: str, value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, (bool, str, complex)) or not isinstance(value, SupportsFloat):
        raise TypeError(f"{name} takes a number, not {type(value).__name__}")
    try:
        number = float(value)
    except (TypeError, ValueError, OverflowError) as refused:
        raise TypeError(f"{name} takes a number, not {type(value).__name__}") from refused
    if not 0.0 <= number < np.inf:
        raise ValueError(f"{name} is {number}: it takes a finite number of 0 or more")
    return number


def _seed(name: str, seed: object) -> int:
    if isinstance(seed, (bool, np.bool_)) or not isinstance(seed, SupportsIndex):
        raise TypeError(f"{name} takes a whole number, not {type(seed).__name__}")
    try:
        number = operator.index(seed)
    except (TypeError, ValueError) as refused:
        raise TypeError(f"{name} takes a whole number, not {type(seed).__name__}") from refused
    if not 0 <= number <= _SEEDS:
        raise ValueError(f"{name} is {number}: it takes a whole number from 0 to {_SEEDS}")
    return number


def _no_rendering(render_mode: object) -> None:
    if render_mode is not None:
        raise ValueError(
            f"render_mode is {render_mode!r}: it takes None; to see a bike ride, give its controller to Scenario.run, whose Ride has svg()"
        )


class _Core:
    """Bikes, their spaces, and the arrays that Rust writes into."""

    def __init__(
        self,
        scenario: Scenario,
        task: str,
        count: int,
        threads: int,
        spread: tuple[object, ...],
    ) -> None:
        spreads = tuple(_spread(f"start_{name}", value) for name, value in zip(_STARTS, spread, strict=False))
        spreads += (None,) * (len(_STARTS) - len(spread))
        self.scenario = scenario
        self.bikes = _Bikes(scenario, task, [0] * count, threads=threads, spread=spreads)
        described = self.bikes.observations
        self.names = tuple(name for name, _ in described)
        self.action_names = tuple(self.bikes.actions)
        bound = np.array([bound for _, bound in described], dtype=np.float32)
        self.observation_space = spaces.Box(-bound, bound, dtype=np.float32)
        self.action_space = spaces.Box(-1.0, 1.0, (len(self.action_names),), np.float32)
        self.endings = np.array(self.bikes.endings, dtype=object)
        self.times = self.bikes.times
        self.observations = np.zeros((count, len(self.names)), dtype=np.float32)
        self.rewards = np.zeros(count, dtype=np.float64)
        self.terminated = np.zeros(count, dtype=np.bool_)
        self.truncated = np.zeros(count, dtype=np.bool_)
        self.ended = np.zeros(count, dtype=np.uint8)

    def actions(self, name: str, actions: object, shape: tuple[int, ...]) -> _Array:
        """Actions as Rust takes them."""
        array = actions if isinstance(actions, np.ndarray) else np.asarray(actions)
        if array.dtype.kind not in "fiu":
            raise TypeError(
                f"{name} is of dtype {array.dtype}: it takes numbers from -1 to 1, as float32"
            )
        if array.shape != shape:
            raise ValueError(f"{name} is of shape {array.shape}: it takes {shape}")
        if array.dtype != np.float32:
            # What is beyond a float32 is beyond ±1 all the more; NaN stays.
            array = np.clip(array, -2.0, 2.0)
        return np.ascontiguousarray(array, dtype=np.float32).reshape(-1, len(self.action_names))

    def step(self, actions: _Array) -> None:
        self.bikes.step(
            actions,
            self.observations,
            self.rewards,
            self.terminated,
            self.truncated,
            self.ended,
        )


class _Env(gymnasium.Env[_Array, _Array]):
    """One bike."""

    metadata: dict[str, Any] = {"render_modes": []}

    def __init__(
        self, scenario: Scenario, task: str, render_mode: str | None, spread: tuple[object, ...]
    ) -> None:
        _no_rendering(render_mode)
        self.render_mode = None
        self._core: _Core | None = _Core(scenario, task, 1, 1, spread)
        self.observation_space = self._core.observation_space
        self.action_space = self._core.action_space
        #: Names of the numbers of an observation, with their units.
        self.observation_names = self._core.names
        #: Names of the numbers of an action.
        self.action_names = self._core.action_names
        #: Control period, s.
        self.period, _ = self._core.times
        self._is_seeded = False
        self._is_under_way = False

    @property
    def scenario(self) -> Scenario:
        """The scenario ridden."""
        return self._opened().scenario

    @property
    def state(self) -> npt.NDArray[np.float64]:
        """The true state: (x_m, y_m, heading_rad, steer_rad, roll_rad, balancer_rad, speed_mps, roll_rate_radps, balancer_rate_radps)."""
        return np.array(self._opened().bikes.state(0))

    @property
    def path(self) -> npt.NDArray[np.float64] | None:
        """The path of the rear contact: (500, 2), m; None where the bike stands."""
        return self._opened().bikes.path(500)

    def _opened(self) -> _Core:
        if self._core is None:
            raise error.ClosedEnvironmentError("the environment is closed: make a new one")
        return self._core

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[_Array, dict[str, Any]]:
        """Begins an episode: the first one of `seed`, or the next one of the seed given last. `options` has no effect."""
        core = self._opened()
        given = None if seed is None else _seed("seed", seed)
        super().reset(seed=given)
        if given is None and not self._is_seeded:
            given = int(self.np_random.integers(_SEEDS))
        core.bikes.reset([given], None, core.observations)
        self._is_seeded = self._is_under_way = True
        return core.observations[0].copy(), {}

    def step(self, action: _Array) -> tuple[_Array, float, bool, bool, dict[str, Any]]:
        """One control period under `action`."""
        core = self._opened()
        if not self._is_under_way:
            raise error.ResetNeeded(
                "the episode has ended or not begun: call reset() before step()"
            )
        core.step(core.actions("action", action, self.action_space.shape or ()))
        terminated, truncated = bool(core.terminated[0]), bool(core.truncated[0])
        info: dict[str, Any] = {}
        if terminated or truncated:
            self._is_under_way = False
            info["ending"] = core.endings[core.ended[0]]
        return core.observations[0].copy(), float(core.rewards[0]), terminated, truncated, info

    def close(self) -> None:
        """Gives the memory back; nothing else works after."""
        self._core = None


class BalanceEnv(_Env):
    """A standing bike to be kept upright (`bikebot/Balance-v0`).

    `mode` is "balancer" (the weight sits above the pivot and can hold a lean; the default) or "flywheel". `scenario` is one with
    plant.model = "two_link"; by default ideal sensors and 20 s. Episodes start within ±`start_roll` (rad), `start_roll_rate` (rad/s),
    `start_balancer` (rad) and `start_balancer_rate` (rad/s) of the scenario's start, evenly; by default 0.03, 0.05, 0.1 and 0.2.

    Observation, shape (4,): `roll_rad`, `balancer_rad`, `roll_rate_radps`, `balancer_rate_radps`. Action, shape (1,): torque of the frame on
    the balancer as a share of the largest.
    """

    def __init__(
        self,
        *,
        mode: str | None = None,
        scenario: Scenario | None = None,
        start_roll: float | None = None,
        start_roll_rate: float | None = None,
        start_balancer: float | None = None,
        start_balancer_rate: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        spread = (start_roll, start_roll_rate, start_balancer, start_balancer_rate)
        super().__init__(_standing(scenario, mode), "balance", render_mode, spread)


class FollowEnv(_Env):
    """A bike that keeps its balance, to be led along its path (`bikebot/Follow-v0`).

    `scenario` is one with a path, given or planned (the plan is made here, by the scenario's seed); by default a small yard with two
    obstacles. Episodes start within ±`start_lateral` (m), `start_heading` (rad) and the four of `BalanceEnv` of the scenario's start; by
    default 0.05, 0.05, and 0.01, 0.02, 0.05, 0.1.

    Observation, shape (15,): see `observation_names`. Action, shape (2,): acceleration and steering rate.
    """

    _TASK: ClassVar[str] = "follow"

    def __init__(
        self,
        *,
        scenario: Scenario | None = None,
        start_lateral: float | None = None,
        start_heading: float | None = None,
        start_roll: float | None = None,
        start_roll_rate: float | None = None,
        start_balancer: float | None = None,
        start_balancer_rate: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        spread = (start_roll, start_roll_rate, start_balancer, start_balancer_rate, start_lateral, start_heading)
        super().__init__(_checked(scenario, _YARD), self._TASK, render_mode, spread)


class RideEnv(FollowEnv):
    """A bike to be ridden along its path with nobody's help (`bikebot/Ride-v0`): as `FollowEnv`.

    Action, shape (3,): drive force, steering rate, balancer torque.
    """

    _TASK: ClassVar[str] = "ride"


class _VectorEnv(VectorEnv[_Array, _Array, npt.NDArray[Any]]):
    """Many bikes, stepped in Rust on all cores with the interpreter's lock released."""

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": _NEXT_STEP}

    def __init__(
        self,
        num_envs: int,
        scenario: Scenario,
        task: str,
        render_mode: str | None,
        threads: int | None,
        copy: bool,
        spread: tuple[object, ...],
    ) -> None:
        _no_rendering(render_mode)
        count = _seed("num_envs", num_envs)
        if not 1 <= count <= 1_000_000:
            raise ValueError(f"num_envs is {count}: it takes a whole number from 1 to 1000000")
        many = 0 if threads is None else _seed("threads", threads)
        if many > 1024:
            raise ValueError(f"threads is {many}: it takes a whole number from 1 to 1024, or None")
        self.num_envs = count
        self.render_mode = None
        self._core: _Core | None = _Core(scenario, task, count, many, spread)
        self.single_observation_space = self._core.observation_space
        self.single_action_space = self._core.action_space
        self.observation_space = batch_space(self.single_observation_space, count)
        self.action_space = batch_space(self.single_action_space, count)
        #: Names of the numbers of an observation, with their units.
        self.observation_names = self._core.names
        #: Names of the numbers of an action.
        self.action_names = self._core.action_names
        #: Control period, s.
        self.period, _ = self._core.times
        self._copy = bool(copy)
        self._is_seeded = False
        self._is_under_way = False

    @property
    def scenario(self) -> Scenario:
        """The scenario ridden."""
        return self._opened().scenario

    def _opened(self) -> _Core:
        if self._core is None or self.closed:
            raise error.ClosedEnvironmentError("the environment is closed: make a new one")
        return self._core

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[_Array, dict[str, Any]]:
        """Begins anew: with a seed s, bike i the first episode of s + i; with a list, each of its own; without, the next of the last.

        `options={"reset_mask": mask}` leaves the bikes alone where the mask (bool, shape (num_envs,)) is False.
        """
        core = self._opened()
        seeds: list[int | None]
        if seed is None:
            seeds = [None] * self.num_envs
        elif isinstance(seed, (list, tuple, np.ndarray)):
            seeds = [None if one is None else _seed("seed", one) for one in seed]
            if len(seeds) != self.num_envs:
                raise ValueError(
                    f"seed has {len(seeds)} entries: it takes one whole number, or one for each of the {self.num_envs} bikes"
                )
        else:
            first = _seed("seed", seed)
            if first > _SEEDS - self.num_envs:
                raise ValueError(f"seed is {first}: seed + num_envs has to stay below {_SEEDS}")
            super().reset(seed=first)
            seeds = [first + i for i in range(self.num_envs)]
        if not self._is_seeded:
            drawn = self.np_random.integers(_SEEDS, size=self.num_envs).tolist()
            seeds = [own if one is None else one for one, own in zip(seeds, drawn, strict=True)]
        mask = None if options is None else options.get("reset_mask")
        if mask is not None:
            if not (isinstance(mask, np.ndarray) and mask.dtype == np.bool_):
                raise TypeError("options['reset_mask'] takes a numpy array of bool")
            if mask.shape != (self.num_envs,):
                raise ValueError(
                    f"options['reset_mask'] is of shape {mask.shape}: it takes ({self.num_envs},)"
                )
            if not self._is_seeded:
                raise error.ResetNeeded("the first reset is of all bikes: leave reset_mask out")
            mask = np.ascontiguousarray(mask)
        core.bikes.reset(seeds, mask, core.observations)
        self._is_seeded = self._is_under_way = True
        return core.observations.copy() if self._copy else core.observations, {}

    def step(
        self, actions: _Array
    ) -> tuple[_Array, npt.NDArray[np.float64], _Flags, _Flags, dict[str, Any]]:
        """One control period of every bike. One whose episode ended in the last step begins its next, and its action has no effect."""
        core = self._opened()
        if not self._is_under_way:
            raise error.ResetNeeded("no episode has begun: call reset() before step()")
        core.step(core.actions("actions", actions, self.action_space.shape or ()))
        infos: dict[str, Any] = {}
        if core.ended.any():
            infos = {"ending": core.endings[core.ended], "_ending": core.ended > 0}
        seen, rewards = core.observations, core.rewards
        terminated, truncated = core.terminated, core.truncated
        if self._copy:
            seen, rewards = seen.copy(), rewards.copy()
            terminated, truncated = terminated.copy(), truncated.copy()
        return seen, rewards, terminated, truncated, infos

    def close_extras(self, **kwargs: Any) -> None:
        """Gives the memory back."""
        self._core = None


class BalanceVectorEnv(_VectorEnv):
    """Many standing bikes: `BalanceEnv` times `num_envs`.

    `threads` is None for all cores; the results do not depend on it. With `copy=False` the arrays that `step` returns are the
    same ones every time, written in place.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        mode: str | None = None,
        scenario: Scenario | None = None,
        start_roll: float | None = None,
        start_roll_rate: float | None = None,
        start_balancer: float | None = None,
        start_balancer_rate: float | None = None,
        threads: int | None = None,
        copy: bool = True,
        render_mode: str | None = None,
    ) -> None:
        spread = (start_roll, start_roll_rate, start_balancer, start_balancer_rate)
        standing = _standing(scenario, mode)
        super().__init__(num_envs, standing, "balance", render_mode, threads, copy, spread)


class FollowVectorEnv(_VectorEnv):
    """Many bikes to be led along one path: `FollowEnv` times `num_envs`; `threads` and `copy` as of `BalanceVectorEnv`."""

    _TASK: ClassVar[str] = "follow"

    def __init__(
        self,
        num_envs: int = 1,
        *,
        scenario: Scenario | None = None,
        start_lateral: float | None = None,
        start_heading: float | None = None,
        start_roll: float | None = None,
        start_roll_rate: float | None = None,
        start_balancer: float | None = None,
        start_balancer_rate: float | None = None,
        threads: int | None = None,
        copy: bool = True,
        render_mode: str | None = None,
    ) -> None:
        spread = (start_roll, start_roll_rate, start_balancer, start_balancer_rate, start_lateral, start_heading)
        riding = _checked(scenario, _YARD)
        super().__init__(num_envs, riding, self._TASK, render_mode, threads, copy, spread)


class RideVectorEnv(FollowVectorEnv):
    """Many bikes to be ridden: `RideEnv` times `num_envs`; `threads` and `copy` as of `BalanceVectorEnv`."""

    _TASK: ClassVar[str] = "ride"


for _name in ("Balance", "Follow", "Ride"):
    if f"bikebot/{_name}-v0" not in gymnasium.registry:
        gymnasium.register(
            f"bikebot/{_name}-v0",
            entry_point=f"bikebot.gym:{_name}Env",
            vector_entry_point=f"bikebot.gym:{_name}VectorEnv",
        )
del _name
