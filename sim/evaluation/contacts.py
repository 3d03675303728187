"""Contacts of a mission: what UAVs touched, and for how long."""

from __future__ import annotations

from typing import Any

from sim.recording.recording import Recording
from sim.world.contacts import KINDS


def contacts(recording: Recording) -> list[dict[str, Any]]:
    """Contacts, each with UAV, what it touched, and first and last scan's time [s]; one that lasts counts once."""
    found: list[dict[str, Any]] = []
    open_: dict[tuple[int, ...], tuple[int, dict[str, Any]]] = {}
    for k, *pair in recording.contacts.tolist():
        time, (uav, kind, other) = float(recording.times[k]), pair
        last, entry = open_.get(tuple(pair), (-2, {}))
        if last < k - 1:
            entry = {"time": time, "until": time, "uav": uav, "kind": KINDS[kind], "other": other}
            found.append(entry)
        entry["until"] = time
        open_[tuple(pair)] = (k, entry)
    return found
