"""How often intervals over few maps hold the true mean: counted on trials that were flown."""

from __future__ import annotations

from collections.abc import Iterable

from sim.study.measures import Measure

# Of 4000 samples of so many maps, the share [%] of intervals that held the mean of all maps flown, over planners and
# their differences, missions of 20 s and 40 s; tests/test_coverage.py counts again.
SHARES = {3: 90, 5: 91, 8: 94, 10: 93, 20: 94, 50: 95}  # of scans with OSPA under 1 m: the lowest
ERRORS = {3: (91, 80), 5: (86, 70), 8: (85, 67), 10: (83, 58), 20: (91, 44), 50: (91, 45)}  # mean OSPA: median, lowest
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
        known = max((n for n in SHARES if n <= maps), default=min(SHARES))
        if measure.unit == "m":
            usual, least = ERRORS[known]
            found.append(
                f"Intervals of mean errors over {maps} maps hold in {usual} % of cases, at worst in {least} %."
            )
        elif measure.unit == "%" and maps < ENOUGH:
            found.append(f"Intervals over {maps} maps, which are few, hold in {SHARES[known]} % of cases.")
    return list(dict.fromkeys(found))
