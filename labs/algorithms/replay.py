"""Experience replay (notes, 3.8.3): transitions (x, u, l, x') kept to learn from again, drawn at
random, so that those of a mini-batch know little of one another."""

from typing import NamedTuple

import numpy as np

from labs.compiled import compiled


class ReplayBuffer(NamedTuple):
    """The last transitions, the newest over the oldest; arrays change in place."""

    observations: np.ndarray
    """(capacity, o) float32"""
    controls: np.ndarray
    """(capacity,) int32: indices."""
    costs: np.ndarray
    """(capacity,) float32"""
    next_observations: np.ndarray
    """(capacity, o) float32"""
    ends: np.ndarray
    """(capacity,) bool: whether the task ended there for good."""
    stored: np.ndarray
    """(1,) int64: how many were ever stored."""


class Minibatch(NamedTuple):
    """Some of them, named as in `ReplayBuffer`."""

    observations: np.ndarray
    controls: np.ndarray
    costs: np.ndarray
    next_observations: np.ndarray
    ends: np.ndarray


def empty_buffer(capacity: int, observation_size: int) -> ReplayBuffer:
    """Room for so many."""
    shape = (capacity, observation_size)
    return ReplayBuffer(
        np.zeros(shape, np.float32),
        np.zeros(capacity, np.int32),
        np.zeros(capacity, np.float32),
        np.zeros(shape, np.float32),
        np.zeros(capacity, np.bool_),
        np.zeros(1, np.int64),
    )


@compiled
def store(replay: ReplayBuffer, new: Minibatch) -> None:
    """Adds transitions."""
    capacity = len(replay.costs)
    for i in range(len(new.costs)):
        at = replay.stored[0] % capacity
        replay.observations[at] = new.observations[i]
        replay.controls[at] = new.controls[i]
        replay.costs[at] = new.costs[i]
        replay.next_observations[at] = new.next_observations[i]
        replay.ends[at] = new.ends[i]
        replay.stored[0] += 1
