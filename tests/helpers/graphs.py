"""Graphs of fleets, and messages exchanged on them."""

import numpy as np

from helpers.information import information_form
from tracking.fusion.consensus import combine
from tracking.fusion.message import Message, Partition

SCAN = 40  # number of the scan in which messages are exchanged
NOW = 7.0  # s, of partitions that meet


def graph(kind: str, n: int) -> np.ndarray:
    i, j = np.indices((n, n))
    near = np.abs(i - j)
    return {"complete": near > 0, "ring": (near == 1) | (near == n - 1), "line": near == 1}[kind]


def metropolis(adjacency: np.ndarray) -> np.ndarray:
    degree = adjacency.sum(axis=1)
    W = adjacency / (1 + np.maximum(degree[:, None], degree[None]))
    return W + np.diag(1 - W.sum(axis=1))


def message(uav: int, ids, means, covariances, *, degree: int, weight=1.0, seen=0.0, deleted=(), **others) -> Message:
    """Message on people who exist for certain, seen at these times [s] by the fleet."""
    q, omega = information_form(np.reshape(means, (-1, 4)), np.reshape(covariances, (-1, 4, 4)))
    columns = np.ones((len(q), 1)), q, omega.reshape(-1, 16), np.full((len(q), 1), 20.0)
    shares = np.concatenate(columns, axis=1) * np.broadcast_to(weight, len(q))[:, None]
    seen = np.broadcast_to(np.asarray(seen, dtype=float), len(q))
    partition = Partition(*others.pop("partition", (0, 0.0)))
    said = {
        "partition": partition,
        "keys": np.column_stack([np.full(len(q), partition[0]), np.array(ids, np.int64)]),
        "times": np.column_stack([seen, seen, seen, seen]),
        "views": np.zeros((len(q), 2), np.int64),
        "misses": np.zeros(len(q), np.int64),
        "sightings": np.column_stack([np.reshape(means, (-1, 4))[:, :2], seen]),
        "novel": np.zeros((len(q), 0)),
        "scan": SCAN,
        "time": float(seen.max(initial=0.0)),
        **others,
    }
    return Message(uav, degree, ids=np.array(ids, np.int64), shares=shares, deleted=deleted, **said)


def told(uav: int, places, variances, ids, seen, **others):
    """Message of a UAV, two of which are a partition, on tracks in a row, standing still, last seen at these times."""
    means = [(x, 0.0, 0.0, 0.0) for x in places]
    covariances = [v * np.diag([1.0, 1.0, 4.0, 4.0]) for v in variances]
    others = {"partition": (uav // 2 * 2, NOW), "time": NOW, **others}
    return message(uav, ids, means, covariances, degree=0, seen=seen, **others)


def exchange(messages: list[Message], adjacency: np.ndarray, rounds: int) -> list[Message]:
    for _ in range(rounds):
        heard = [[messages[j] for j in np.flatnonzero(row)] for row in adjacency]
        messages = [combine(m, others, 3.0) for m, others in zip(messages, heard, strict=True)]
    return messages
