"""Bytes that UAVs sent, of messages and of plans."""

from __future__ import annotations

import numpy as np

from sim.mission.snapshot import Ints
from sim.recording.recording import Recording


def bytes_sent(recording: Recording) -> Ints | None:
    """Bytes (N,) of messages for each pair of scan and UAV that works; None where they were not recorded."""
    sent = recording.bytes_sent
    known = sent.shape == recording.working.shape and sent.min() >= 0
    return sent[recording.working] if known else None


def plan_bytes(recording: Recording) -> Ints | None:
    """Bytes (N,) of plans for each pair of decision and UAV that works; None where they were not recorded."""
    sent, decides = recording.plan_bytes, np.isin(recording.times, recording.plan_times)
    known = sent.shape == recording.working.shape and decides.any() and sent.min() >= 0
    return sent[recording.working & decides[:, None]] if known else None
