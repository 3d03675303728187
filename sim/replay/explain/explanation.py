"""Why a person was seen, or held, or not: a recording in words."""

from __future__ import annotations

import math

import numpy as np

from sim.evaluation.score import HELD
from sim.mission.snapshot import Ints
from sim.recording.recording import Recording
from sim.replay.episodes import BROKEN, HOLDS, episodes, holds, lanes, trees
from sim.replay.explain.observation import Found, Weight, Witness
from sim.replay.explain.person import Account, Holder
from sim.replay.explain.planned_visibility import HIDDEN, IN_VIEW, Outlook
from sim.replay.history import STATES, History
from tracking.numerics.compiled import Array

Group = tuple[str, list[str]]  # a heading, and facts under it

_COMPASS = ("east", "north-east", "north", "north-west", "west", "south-west", "south", "south-east")
_LEAST = 0.005  # probability below which a measurement is not worth a line


def explanation(account: Account, recording: Recording) -> list[Group]:
    """What is known of one person at one scan: of the person, each UAV, the track, and what the UAVs meant to do."""
    groups = [(f"person {account.person} at {recording.times[account.k]:.1f} s", _person(account, recording))]
    if np.isnan(account.place[0]):
        return groups
    groups += [(f"UAV {w.uav}", _witness(w, account, recording)) for w in account.witnesses]
    if account.holder:
        groups.append((f"track {account.holder.number}", _track(account.holder, account, recording)))
    groups.append(("intents", _intents(account)))
    return groups


def _person(account: Account, recording: Recording) -> list[str]:
    if np.isnan(account.place[0]):
        return ["is not there at this time"]
    lines = [f"is at {_at(account.place)}{_motion(account.velocity)}"]
    return [*lines, *_holding(account), _seen(account)]


def _motion(velocity: Array) -> str:
    if np.isnan(velocity[0]):
        return ""
    eighth = round(math.atan2(velocity[1], velocity[0]) / (math.pi / 4)) % 8
    return f" and walks {math.hypot(*velocity):.1f} m/s to the {_COMPASS[eighth]}"


def _holding(account: Account) -> list[str]:
    """Who holds the person; if nobody does, since when and until when."""
    times, holder = account.history.times, account.holder
    if holder and holder.holds:
        by = [(holder.number, holder.holds), *holder.others]
        return [f"held by {_uavs(uavs)} as track {number}" for number, uavs in by]
    (loss,) = (x for x in account.history.losses if x.person == account.person and x.first <= account.k <= x.last)
    end = loss.last + 1
    later = f"held from {times[end]:.1f} s on" if end < len(times) else "not held again by the end of the mission"
    if holder is None:
        return [f"not found yet: no track has been within {HELD:g} m so far", later]
    lines = [f"lost since {times[loss.first]:.1f} s{_ago(times, loss.first, account.k)}: no track within {HELD:g} m"]
    return [*lines, f"last held as track {holder.number} at {holder.until:.1f} s; {later}"]


def _seen(account: Account) -> str:
    """When the person was detected last."""
    seen = account.history.detected[: account.k + 1, :, account.person]
    scans = np.flatnonzero(seen.any(axis=1))
    if len(scans) == 0:
        return "not detected so far"
    who = _uavs(np.flatnonzero(seen[scans[-1]]).tolist())
    if scans[-1] == account.k:
        return f"detected by {who}"
    times = account.history.times
    return f"last detected by {who} at {times[scans[-1]]:.1f} s{_ago(times, int(scans[-1]), account.k)}"


def _ago(times: Array, scan: int, k: int) -> str:
    return f", {times[k] - times[scan]:.1f} s ago" if k > scan else ""


def _witness(w: Witness, account: Account, recording: Recording) -> list[str]:
    if not w.works:
        return ["has broken down"]
    lines = [] if w.sighting.looked else ["took no frame at this scan; what geometry tells:"]
    lines += _view(w, recording)
    if w.found:
        lines += _detection(w, w.found)
    elif w.sighting.looked and w.sighting.pixels:
        lines.append("not detected")
    return lines + _association(w, account.holder)


def _view(w: Witness, recording: Recording) -> list[str]:
    """In which view the person is, and what hides them."""
    sighting = w.sighting
    lines = [f"{sighting.status}, {w.away:.1f} m from below the camera"]
    for tree in sighting.hidden_by:
        x, y, radius = recording.trees[tree, :3].tolist()
        lines.append(f"tree {tree} stands at ({x:.1f}, {y:.1f}) m, its canopy reaches {radius:.1f} m")
    if w.whole:
        share = 100 * sighting.pixels / w.whole
        lines.append(f"shows {sighting.pixels} of {w.whole} pixels that it would show without trees, {share:.0f} %")
    return lines


def _detection(w: Witness, found: Found) -> list[str]:
    """Where the person was detected, and what that was taken for."""
    at = "measured" if found.pixel is None else f"detected at pixel ({found.pixel[0]:.1f}, {found.pixel[1]:.1f})"
    lines = [f"{at}: {_at(found.place)}, an error of {found.error:.2f} m, {found.sigmas:.1f} σ"]
    gates = [weight for weight in w.weights if weight.measurement == found.measurement]
    if not gates:
        return [*lines, "in the gate of no track"]
    return [*lines, *(f"in the gate of {_gate(weight)}" for weight in _by_weight(gates))]


def _gate(weight: Weight) -> str:
    return f"track {weight.track} at {weight.sigmas:.1f} σ, weight {_percent(weight.probability)}"


def _association(w: Witness, holder: Holder | None) -> list[str]:
    """What the person's track expected of the scan, and which others' measurements it took for its own."""
    if holder is None or holder.number not in w.visible:
        return []
    lines = [f"expected track {holder.number} in plain view with {_percent(w.visible[holder.number])}"]
    mine = w.found.measurement if w.found else -1
    for weight in _by_weight([x for x in w.weights if x.track == holder.number and x.measurement != mine]):
        if weight.probability >= _LEAST:
            owner = int(w.owners[weight.measurement])
            whose = f"person {owner}" if owner >= 0 else "nobody"
            place = _at(w.measurements[weight.measurement])
            weighs = f"weight {_percent(weight.probability)}"
            lines.append(f"the measurement of {whose} at {place} was in the gate of track {weight.track} too, {weighs}")
    return lines


def _track(holder: Holder, account: Account, recording: Recording) -> list[str]:
    now = float(recording.times[account.k])
    role = f"stands for the person for {_uavs(holder.holds)}" if holder.holds else "held the person last"
    lines = [f"{role}; exists since {holder.since:.1f} s, for {now - holder.since:.1f} s"]
    if holder.belief is None:
        return [f"{role}; began at {holder.since:.1f} s and has ended"]
    error, square = holder.error(account.place)
    major, minor = holder.axes.tolist()
    speed = math.hypot(*holder.belief.mean[2:])
    lines.append(f"believed at {_at(holder.belief.mean[:2])}, {speed:.1f} m/s")
    lines.append(f"error {error:.2f} m, {math.sqrt(square):.1f} σ (NEES {square:.1f}, 2 expected)")
    lines.append(f"standard deviations {major:.2f} × {minor:.2f} m")
    if not math.isnan(holder.existence):
        lines.append(f"existence {holder.existence:.4f}")
    return lines


def _intents(account: Account) -> list[str]:
    lines = []
    for witness, look in zip(account.witnesses, account.outlooks, strict=True):
        if look is None:
            lines.append(f"UAV {witness.uav}: no plan{'' if witness.works else ', as it has broken down'}")
            continue
        parts = [] if account.holder is None or look.track is None else [
            f"track {account.holder.number} {_ahead(look, look.track)}"
        ]  # fmt: skip
        parts.append(f"the person {_ahead(look, look.person)}")
        lines.append(f"UAV {look.uav}, plan of {look.made:.1f} s to {look.times[-1]:.1f} s: " + "; ".join(parts))
    return lines


def _ahead(look: Outlook, states: Ints) -> str:
    """When a place is first in view on the way, or what else it is."""
    for state, words in ((IN_VIEW, "in view"), (HIDDEN, "in the frame, hidden,")):
        ahead = [e for e in episodes(states) if e.value == state]
        if ahead:
            first, last = (f"{look.times[s]:.1f}" for s in ahead[0][:2])
            return f"{words} at {first} s" if first == last else f"{words} from {first} to {last} s"
    return "not known, as the mission ends" if (states < 0).all() else "out of view"


def told(history: History, person: int) -> list[tuple[float, float, str, str]]:
    """A person's mission as stretches of one wording: first and last scan [s], who held, and who saw what."""
    seen, between = lanes(history)[:, :, person], trees(history)[:, :, person]
    words = [
        (HOLDS[hold], _views(*views) if there else "")
        for hold, there, *views in zip(
            holds(history)[:, person], history.present[:, person], seen, between, strict=True
        )
    ]
    numbers = {text: n for n, text in enumerate(dict.fromkeys(words))}
    return [
        (float(history.times[e.first]), float(history.times[e.last]), *words[e.first])
        for e in episodes(np.array([numbers[text] for text in words], dtype=np.int64))
    ]


def _views(seen: Ints, between: Ints) -> str:
    parts = []
    for state, words in (("seen", "seen by"), ("missed", "shown to, not detected by")):
        who = np.flatnonzero(seen == STATES.index(state)).tolist()
        parts += [f"{words} {_uavs(who)}"] if who else []
    hidden = seen == STATES.index("hidden")
    for tree in np.unique(between[hidden]).tolist():
        who = np.flatnonzero(hidden & (between == tree)).tolist()
        parts.append(f"hidden from {_uavs(who)}" + (f" by tree {tree}" if tree >= 0 else ""))
    if not parts:
        return "no UAV works" if (seen == BROKEN).all() else "out of view"
    return "; ".join(parts)


def _by_weight(weights: list[Weight]) -> list[Weight]:
    return sorted(weights, key=lambda w: -w.probability)


def _uavs(uavs: list[int] | tuple[int, ...]) -> str:
    names = [str(i) for i in uavs]
    return f"UAV{'s' * (len(names) > 1)} " + " and ".join([", ".join(names[:-1]), names[-1]] if names[1:] else names)


def _at(place: Array) -> str:
    return f"({place[0]:.1f}, {place[1]:.1f}) m"


def _percent(probability: float) -> str:
    """In per cent; what rounding would make certain is more or less than that."""
    if 0.0 < probability < 0.001:
        return "under 0.1 %"
    if 0.999 < probability < 1.0:
        return "over 99.9 %"
    return f"{100 * probability:.{0 if 0.1 <= probability <= 0.9 or probability in (0.0, 1.0) else 1}f} %"
