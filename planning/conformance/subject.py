"""A planner under test, and its plans for the ordinary situation."""

from collections.abc import Callable, Sequence
from functools import cached_property

from planning.conformance.calls import Attempt, attempt, difference
from planning.conformance.situations import ordinary_team
from planning.contract import exchange_of
from planning.planner import Planner, Situation
from tracking.plugins.findings import Unfit, Untried

Maker = Callable[[], Planner]
ROUNDING = 1e-9  # m/s, by which a plan may depend on what should not matter


class Subject:
    """A planner under test: its maker, and its plans for the ordinary situation."""

    def __init__(self, make: Maker, named: object) -> None:
        self.make, self.text = make, named if isinstance(named, str) else None
        self.team = ordinary_team()
        planner = make()
        self.claims = bool(getattr(planner, "decentralised", False))
        self.rounds = exchange_of(planner).rounds
        self.first = attempt(planner, self.team, watched=True)

    @cached_property
    def repeats(self) -> str:
        """Difference of the plans of another instance with the same seed, in words; empty: none."""
        return difference_of_plans(self.first, attempt(self.make(), self.team))

    def planned(self) -> Attempt:
        """The first plans; `Untried` if there are none."""
        if "plans" in self.first.defects:
            raise Untried("it does not plan")
        return self.first

    def compare(self, other: Attempt, when: str, within: float = 0.0) -> None:
        """Raise `Unfit` unless plans equal the first ones, within so many m/s."""
        difference = difference_of_plans(self.planned(), other, within)
        if difference:
            raise Unfit(f"{when}, {difference}")

    def comparable(self) -> None:
        """Raise `Untried` if the planner's plans never repeat, so that none can be compared."""
        self.planned()
        if self.repeats:
            raise Untried("its plans do not repeat anyway")


def difference_of_plans(first: Attempt, other: Attempt, within: float = 0.0) -> str:
    """Difference of two attempts beyond `within` m/s, in words; empty: none."""
    if other.defects != first.defects:
        return next((text for kind, text in other.defects.items() if kind not in first.defects), "plans differ")
    gap = max(map(difference, first.controls, other.controls), default=0.0)
    return f"plans differ by {gap:.3g} m/s" if gap > within else ""


def proper_plans(subject: Subject, team: Sequence[Situation]) -> Attempt:
    """Plans for a team; `Unfit` if there are none."""
    tried = attempt(subject.make(), team)
    if "plans" in tried.defects:
        raise Unfit(tried.defects["plans"])
    return tried
