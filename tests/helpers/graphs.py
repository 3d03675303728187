"""Graphs of fleets, and messages exchanged on them."""

import numpy as np

from tracking.filter.information import information_form
from tracking.fusion.consensus import combine
from tracking.fusion.message import Message
from tracking.management.deletion import DetectionHistory

GATE = 13.28  # chi-square, four degrees of freedom, 0.99


def graph(kind: str, n: int) -> np.ndarray:
    i, j = np.indices((n, n))
    near = np.abs(i - j)
    return {"complete": near > 0, "ring": (near == 1) | (near == n - 1), "line": near == 1}[kind]


def metropolis(adjacency: np.ndarray) -> np.ndarray:
    degree = adjacency.sum(axis=1)
    W = adjacency / (1 + np.maximum(degree[:, None], degree[None]))
    return W + np.diag(1 - W.sum(axis=1))


def message(uav: int, ids, means, covariances, *, degree: int, weight=1.0, seen=0.0, deleted=(), **others) -> Message:
    q, omega = information_form(np.reshape(means, (-1, 4)), np.reshape(covariances, (-1, 4, 4)))
    shares = np.concatenate([np.ones((len(q), 1)), q, omega.reshape(-1, 16)], axis=1)
    shares *= np.broadcast_to(weight, len(q))[:, None]
    ids = np.array(ids, np.int64)
    sightings = np.column_stack([np.reshape(means, (-1, 4))[:, :2], np.full(len(q), seen)])
    said = {"aliases": ids, "sightings": sightings, "novel": np.zeros((len(q), 0)), "partition": (0, 0.0), **others}
    return Message(uav, degree, ids, shares, DetectionHistory.at(seen, len(q)), deleted, **said)


def exchange(messages: list[Message], adjacency: np.ndarray, rounds: int) -> list[Message]:
    for _ in range(rounds):
        messages = [
            combine(m, [messages[j] for j in np.flatnonzero(row)], GATE)
            for m, row in zip(messages, adjacency, strict=True)
        ]
    return messages
