"""Which detections of a flight are people: those of some classes, with some score, once in a frame."""

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from sim.exchange.values import CameraFrames, LoggedDetection, LoggedFrame
from tracking.errors import InputError, check_known, spell

_PEOPLE = {"person", "persons", "people", "pedestrian", "pedestrians", "human", "humans"}  # names of their classes


class Selection(NamedTuple):
    """What a user asks for."""

    classes: tuple[str, ...] = ()  # names or numbers of classes that count, or names of groups; by default of people
    least_score: float | None = None  # by default more than 0


def select_people(found: Mapping[int, CameraFrames], selection: Selection) -> tuple[dict[int, CameraFrames], list[str]]:
    """The frames of each UAV with those of their detections and labels that are people, and remarks on these.

    If no class has a name, people are 0 where there is a 0, as detectors count, and else 1, as COCO does.
    InputError if nobody is left, or if an option does not fit the flight.
    """
    every = [one for seen in found.values() for frame in seen.frames for one in frame.detections]
    wanted = _choose_classes(found.values(), {one.category for one in every}, selection.classes)
    of_labels = wanted | {"", "0", "1"} | _PEOPLE if wanted & _PEOPLE else wanted | {""}
    scores = sorted(one.score for one in every if one.category.casefold() in wanted and not math.isnan(one.score))
    least = selection.least_score
    if least is not None and every and not scores:
        raise InputError("--least-score: the detections of this flight have no scores")

    def find_fault(one: LoggedDetection) -> str:
        """Why a detection does not count; empty if it does."""
        if not one.is_somewhere:
            return "without a size"
        if one.category.casefold() not in wanted:
            return f"of class {one.category}" if one.category else "without a class"
        if least is not None and one.score < least:
            return f"with a score below {spell(least)}"
        return "with a score of 0" if least is None and one.score == 0 and any(scores) else ""

    def find_fault_of_label(one: LoggedDetection) -> str:
        return "" if one.category.casefold() in of_labels else f"of class {one.category}"

    frames, told = _filter("detections", {uav: seen.frames for uav, seen in found.items()}, find_fault)
    labels, told_of_labels = _filter("truth", {uav: seen.people for uav, seen in found.items()}, find_fault_of_label)
    if every and not any(frame.detections for own in frames.values() for frame in own):
        raise InputError(f"{told[0]}; so nobody is left; --classes and --least-score choose others")
    used = {one.score for own in frames.values() for frame in own for one in frame.detections}
    used = {score for score in used if not math.isnan(score)}
    if least is None and len(used) > 1:
        span = f"scores are {spell(min(used), 3)} to {spell(max(used), 3)}"
        told.append(f"detections: {span}; --least-score leaves out the lower ones")
    kept = {uav: seen._replace(frames=frames[uav], people=labels[uav]) for uav, seen in found.items()}
    return kept, [*told, *told_of_labels]


def _choose_classes(found: Iterable[CameraFrames], there: set[str], asked: Sequence[str]) -> set[str]:
    """Names in small letters of the classes that count; "" stands for detections without a class."""
    names = {number: name for seen in found for number, name in seen.categories.items()}
    if not asked:
        return _PEOPLE | {""} | (set() if names else {"0" if "0" in there else "1"})
    if there and not any(there):
        raise InputError("--classes: the detections of this flight have no classes")
    own = {name.casefold() for name in (*there, *names.values()) if name}
    groups = defaultdict[str, set[str]](set)
    for name, members in (item for seen in found for item in seen.groups.items() if item[0]):
        groups[name.casefold()] |= {member.casefold() for member in members}
    chosen = set[str]()
    for name in (names.get(name, name).casefold() for name in asked):
        check_known("--classes", name, sorted({*own, *groups, *_PEOPLE}))
        chosen |= {name} if name in own else groups.get(name, {name})
    return chosen


def _filter(
    field: str, frames: Mapping[int, Sequence[LoggedFrame]], find_fault: Callable[[LoggedDetection], str]
) -> tuple[dict[int, list[LoggedFrame]], list[str]]:
    """The frames of each UAV with the detections that count, once each, and what to say if some do not."""
    kept: dict[int, list[LoggedFrame]] = {uav: [] for uav in frames}
    used, left = Counter[str](), Counter[str]()
    for uav, frame in ((uav, frame) for uav, own in frames.items() for frame in own):
        different = dict[object, LoggedDetection]()
        for one in frame.detections:
            if fault := find_fault(one):
                left[fault] += 1
            elif different.setdefault((one.place, one.covariance, one.pixel, one.person), one) is not one:
                left["twice in one frame"] += 1
            else:
                used[f"of class {one.category}" if one.category else ""] += 1
        kept[uav].append(frame._replace(detections=[*different.values()]))
    said = [", ".join(f"{n} {what}".strip() for what, n in sorted(of.items())) or "none" for of in (used, left)]
    return kept, [f"{field}: used: {said[0]}; left out: {said[1]}"] if left or len(used) > 1 else []
