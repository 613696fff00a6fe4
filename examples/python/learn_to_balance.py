"""Learns to hold a standing bike upright: a linear policy, found by random search.

    python examples/python/learn_to_balance.py [--mode balancer|flywheel] [--seed 1]

Four numbers say how much torque each of roll, balancer angle and their rates asks for. Every generation tries some of them around the
best so far, each from several starts, all bikes at once in Rust; the best eighth says where the next generation looks. It takes
seconds. Needs `pip install bikebot[gym]`.
"""

from __future__ import annotations

import argparse
import time
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from bikebot.gym import BalanceVectorEnv

Floats: TypeAlias = npt.NDArray[np.float64]

#: What a large value of each number of the observation is: roll rad, balancer rad, their rates rad/s.
LARGE = np.array([0.1, 1.0, 0.4, 4.0])
#: Held for longer than this, s, an episode of 20 s was held to its end.
HELD = 19.99


def ride(bikes: BalanceVectorEnv, policies: Floats, seed: int) -> tuple[Floats, Floats]:
    """Rewards and steps of one episode of every bike, each with its row of `policies` (n, 4)."""
    weights = (policies / LARGE).astype(np.float32)
    seen, _ = bikes.reset(seed=seed)
    rewards, steps = np.zeros(bikes.num_envs), np.zeros(bikes.num_envs)
    rides = np.ones(bikes.num_envs, dtype=np.bool_)
    while rides.any():
        torque = np.einsum("ij,ij->i", seen, weights)
        seen, reward, terminated, truncated, _ = bikes.step(torque[:, np.newaxis])
        rewards += reward * rides
        steps += rides
        rides &= ~(terminated | truncated)
    return rewards, steps


def learn(
    mode: str = "balancer",
    *,
    seed: int = 1,
    generations: int = 60,
    candidates: int = 64,
    starts: int = 4,
    threads: int | None = None,
    tell: bool = False,
) -> Floats:
    """A policy (4,) for `mode`: the torque, as a share of the largest, is `observation / LARGE @ policy`.

    It ends when the policy holds the bike from 1024 starts that it did not learn from. The same seed learns the same policy.
    """
    bikes = BalanceVectorEnv(candidates * starts, mode=mode, threads=threads, copy=False)
    chance = np.random.default_rng(seed)
    best, spread = np.zeros(4), np.full(4, 3.0)
    for generation in range(generations):
        tried = best + spread * chance.normal(size=(candidates, 4))
        tried[0] = best
        first = 1000 * (seed + generation)
        rewards, steps = ride(bikes, np.repeat(tried, starts, axis=0), first)
        scores = np.reshape(rewards, (candidates, starts)).mean(axis=1)
        times = bikes.period * np.reshape(steps, (candidates, starts)).min(axis=1)
        better = np.argsort(-scores)[: candidates // 8]
        # The spread shrinks with what the better ones agree on, and not so fast that they agree by chance.
        best = tried[better].mean(axis=0)
        spread = tried[better].std(axis=0) + 0.9**generation
        if tell:
            print(f"generation {generation:2}: best {scores.max():7.1f}, {np.sum(times > HELD):2} of {candidates} hold 20 s from {starts} starts")
        if (times[better] > HELD).all() and (held(best, mode, seed=5 * 10**8, episodes=1024, threads=threads) > HELD).all():
            break
    bikes.close()
    return best


def held(policy: Floats, mode: str = "balancer", *, seed: int, episodes: int, threads: int | None = None) -> Floats:
    """For how long (s) the policy holds the bike, from starts of `seed` on."""
    bikes = BalanceVectorEnv(episodes, mode=mode, threads=threads, copy=False)
    _, steps = ride(bikes, np.tile(policy, (episodes, 1)), seed)
    bikes.close()
    return steps * bikes.period


def main() -> None:
    options = argparse.ArgumentParser(description="learns to hold a standing bike upright")
    options.add_argument("--mode", choices=("balancer", "flywheel"), default="balancer")
    options.add_argument("--seed", type=int, default=1)
    chosen = options.parse_args()
    began = time.perf_counter()
    policy = learn(chosen.mode, seed=chosen.seed, tell=True)
    took = time.perf_counter() - began
    times = held(policy, chosen.mode, seed=10**9, episodes=1000)
    print(f"learnt in {took:.1f} s: torque / largest = observation / {LARGE.tolist()} @ {[round(float(part), 3) for part in policy]}")
    print(f"from 1000 starts it never saw it holds {chosen.mode} mode for 20 s {np.sum(times > HELD)} times, {times.min():.2f} s at least")


if __name__ == "__main__":
    main()
