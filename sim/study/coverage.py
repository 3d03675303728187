"""How often intervals over few maps hold the true mean: counted on trials that were flown."""

from __future__ import annotations

from collections.abc import Iterable

from sim.study.measures import Measure

# Of 2000 samples of so many maps, the share [%] of intervals that held the mean of all maps flown: the lowest of the
# planners and of their differences. tests/test_coverage.py counts again.
SHARES = {3: 85, 5: 91, 8: 94, 10: 94, 20: 94, 50: 94}  # of scans with OSPA under 1 m
ERRORS = {3: 40, 5: 40, 8: 40, 10: 40, 20: 40, 50: 40}  # mean OSPA
ENOUGH = 8  # maps from which on intervals of shares hold
COVERED = (
    f"From {ENOUGH} maps on, intervals of shares of scans hold the true mean in at least 92 % of cases: counted by "
    "drawing maps from trials that were flown.",
    "Those of mean errors in metres do not, with any number of maps up to 50: in one map of fifty or so a planner "
    "loses people for good, and such a map is worth as much as all others together. Samples without one miss the mean. "
    "Medians over the maps, whose intervals hold from six maps on, and shares of scans tell more.",
)


def caveats(measured: Iterable[tuple[Measure, int]]) -> list[str]:
    """What is to be said of intervals of means, by metric and number of maps; nothing where they hold as they say."""
    fewest: dict[Measure, int] = {}
    for measure, maps in measured:
        if maps > 1:
            fewest[measure] = min(maps, fewest.get(measure, maps))
    found = []
    for measure, maps in fewest.items():
        held = _held(ERRORS if measure.unit == "m" else SHARES, maps)
        if measure.unit == "m":
            found.append(f"Intervals of mean errors over {maps} maps may hold the truth in {held} % of cases only.")
        elif measure.unit == "%" and maps < ENOUGH:
            found.append(f"Intervals over {maps} maps, which are few, hold the truth in {held} % of cases.")
    return list(dict.fromkeys(found))


def _held(table: dict[int, int], maps: int) -> int:
    """The entry for the most maps that are no more than these; for fewer than all, the first."""
    return table[max((known for known in table if known <= maps), default=min(table))]
