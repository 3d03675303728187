"""States of a person to the cameras of a fleet, in words."""

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from sim.mission.snapshot import Ints
from sim.replay.history import BROKEN, STATES, History

_View = tuple[str, dict[int, list[int]]]  # a state, and the UAVs that have it by the tree between, -1 for none


def views_at(states: Ints, trees: Ints) -> list[_View]:
    """States that cameras have of one person, the best first; out of view only if no camera has another.

    states (n,) and trees (n,) as in `History.camera_states` and `History.hiding_trees`.
    """
    found = []
    for state in ("seen", "missed", "hidden"):
        uavs = defaultdict(list)
        for i in np.flatnonzero(states == STATES.index(state)).tolist():
            uavs[int(trees[i]) if state == "hidden" else -1].append(i)
        found += [(state, dict(uavs))] if uavs else []
    return found or [("broken" if (states == BROKEN).all() else "out of view", {})]


def view_texts(history: History, person: int) -> list[str]:
    """The same in words, scan by scan; empty where the person is absent."""
    known: dict[bytes, str] = {}
    texts = []
    for k, present in enumerate(history.present[:, person].tolist()):
        states, trees = history.camera_states[k, :, person], history.hiding_trees[k, :, person]
        key = states.tobytes() + trees.tobytes()
        if key not in known:
            known[key] = "; ".join(view_text(*view) for view in views_at(states, trees))
        texts.append(known[key] if present else "")
    return texts


def view_text(state: str, uavs: Mapping[int, Sequence[int]]) -> str:
    """A state of a person to cameras in words; `uavs` are those that have it, by the tree between, -1 for none."""
    if state == "seen":
        return f"seen by {fleet_text(uavs[-1])}"
    if state == "missed":
        return f"shown to {fleet_text(uavs[-1])}, not detected"
    if state == "hidden":
        hiding = ((f"tree {tree}" if tree >= 0 else "a person", fleet_text(uavs[tree])) for tree in sorted(uavs))
        return "hidden " + ", ".join(f"by {what} from {fleet}" for what, fleet in hiding)
    return "no UAV works" if state == "broken" else "outside every view"


def fleet_text(uavs: Sequence[int]) -> str:
    """UAVs in words: "UAV 0", "UAVs 0, 1 and 2"."""
    *most, last = map(str, uavs)
    return f"UAVs {', '.join(most)} and {last}" if most else f"UAV {last}"
