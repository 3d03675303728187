"""What happened in a mission, in words: who was lost when and why, what was touched, what broke."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sim.evaluation.contacts import contacts
from sim.evaluation.score import HELD
from sim.mission.snapshot import Ints
from sim.recording.fault_text import read
from sim.recording.recording import Recording
from sim.replay.history import History, Loss
from sim.replay.page.data import HIDDEN, MISSED, SEEN, codes

_MOST_CAUSES = 3
_CODES = {"seen": SEEN, "missed": MISSED}


@dataclass(frozen=True)
class Event:
    """Something from one scan to another, both included."""

    first: int
    last: int
    text: str
    why: str = ""
    person: int | None = None
    uav: int | None = None  # whose frames tell most about it
    fault: bool = False  # of planner or detector


def losses(recording: Recording, history: History) -> list[Event]:
    """Everybody who was lost, by scan, and what cameras made of them meanwhile."""
    told = codes(history)
    return [_lost(recording, history, told, loss) for loss in history.losses]


def _lost(recording: Recording, history: History, told: Ints, loss: Loss) -> Event:
    times, scans = history.times, slice(loss.first, loss.last + 1)
    what = "lost" if loss.found else "not yet found"
    when = f"{times[loss.first]:.1f} to {times[loss.last]:.1f} s"
    if loss.first == loss.last:
        when = f"at {times[loss.first]:.1f} s"
    elif loss.last == len(times) - 1:
        when = f"from {times[loss.first]:.1f} s to the end"
    step = float(times[1] - times[0]) if len(times) > 1 else 0.0
    why = _causes(told[scans, :, loss.person], step)
    return Event(
        first=loss.first,
        last=loss.last,
        text=f"person {loss.person} {what} {when}",
        why=why,
        person=loss.person,
        uav=_witness(recording, history, told, loss),
    )


def _causes(told: Ints, step: float) -> str:
    """What the fleet's cameras made of one person, in order of time: told (S, n)."""
    counted: dict[tuple[str, tuple[int, ...]], int] = {}
    among: defaultdict[tuple[str, int], set[int]] = defaultdict(set)  # UAVs, by what they had and by the tree
    for row in told:
        kind = next((kind for kind, code in (("seen", SEEN), ("missed", MISSED)) if code in row), "hidden")
        having = np.flatnonzero(row >= HIDDEN if kind == "hidden" else row == _CODES[kind]).tolist()
        trees = [int(row[i]) - HIDDEN - 1 if kind == "hidden" else -1 for i in having]
        key = (kind, tuple(sorted(set(trees))))
        counted[key] = counted.get(key, 0) + 1
        for i, tree in zip(having, trees, strict=True):
            among[kind, tree].add(i)
    most = sorted(counted, key=lambda key: -counted[key])[:_MOST_CAUSES]
    parts = []
    for kind, trees_ in (key for key in counted if key in most):
        lasting = f" ({_seconds(counted[kind, trees_] * step)})" if len(counted) > 1 else ""
        parts.append(_cause(kind, {tree: sorted(among[kind, tree]) for tree in trees_}) + lasting)
    return "; ".join(parts)


def _cause(kind: str, uavs: dict[int, list[int]]) -> str:
    """One cause in words; `uavs` are those concerned, by the tree between; -1 for none."""
    fleet = {tree: _listed(f"UAV {i}" for i in who) for tree, who in uavs.items()}
    if not fleet:
        return "outside every view"
    if kind == "seen":
        return f"detected by {fleet[-1]}, but no track within {HELD:g} m"
    if kind == "missed":
        return f"shown to {fleet[-1]}, but not detected"
    return "hidden " + ", ".join(f"by {f'tree {t}' if t >= 0 else 'somebody'} from {who}" for t, who in fleet.items())


def _witness(recording: Recording, history: History, told: Ints, loss: Loss) -> int:
    """The UAV whose frames tell most of a loss: one with the person inside most of the time, else the nearest one."""
    inside = np.count_nonzero(told[loss.first : loss.last + 1, :, loss.person], axis=0)
    if inside.any():
        return int(inside.argmax())
    gap = np.linalg.norm(recording.poses[loss.first, :, :2] - recording.people[loss.first, loss.person], axis=1)
    return int(np.where(history.working[loss.first], gap, np.inf).argmin())


def incidents(recording: Recording, history: History) -> list[Event]:
    """UAVs that broke down, contacts and faults, by scan."""
    found = [*_breakdowns(history), *_contacts(recording), *_faults(recording, history)]
    return sorted(found, key=lambda event: event.first)


def _breakdowns(history: History) -> list[Event]:
    times, works = history.times, history.working
    broken = [(int(np.argmin(works[:, i])), i) for i in range(works.shape[1]) if not works[:, i].all()]
    return [Event(k, k, f"UAV {i} broke down at {times[k]:.1f} s", uav=i) for k, i in broken]


def _contacts(recording: Recording) -> list[Event]:
    found = []
    for entry in contacts(recording):
        first, last = (int(np.argmin(np.abs(recording.times - entry[name]))) for name in ("time", "until"))
        when = f"at {entry['time']:.1f} s" if first == last else f"{entry['time']:.1f} to {entry['until']:.1f} s"
        touched = {"uav": "UAV", "canopy": "the canopy of tree", "trunk": "the trunk of tree"}
        what = "the ground" if entry["kind"] == "ground" else f"{touched.get(entry['kind'], 'person')} {entry['other']}"
        found.append(Event(first, last, f"UAV {entry['uav']} touched {what} {when}", uav=entry["uav"]))
    return found


def _faults(recording: Recording, history: History) -> list[Event]:
    """What planners and detectors did wrong, each thing once, however often; breakdowns are told apart."""
    times = recording.times
    grouped: dict[tuple[int | None, str], list[int]] = {}
    for fault in read(recording.faults):
        k = min(int(np.searchsorted(times, fault.time - 1e-6)), len(times) - 1)
        if fault.uav is None or history.working[k, fault.uav]:
            grouped.setdefault((fault.uav, fault.message), []).append(k)
    found = []
    for (uav, message), scans in grouped.items():
        first, last, who = scans[0], scans[-1], "the fleet" if uav is None else f"UAV {uav}"
        often = f", {len(scans)} times until {times[last]:.1f} s" if len(scans) > 1 else ""
        found.append(
            Event(first, first, f"fault of {who} at {times[first]:.1f} s{often}", why=message, uav=uav, fault=True)
        )
    return found


def _seconds(time: float) -> str:
    return f"{time:.1f} s"


def _listed(words: Iterable[str]) -> str:
    *most, last = words
    return f"{', '.join(most)} and {last}" if most else last
