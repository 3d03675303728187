"""Coverage of intervals over few maps: the share that contains the true mean, counted on trials that were flown."""

from collections.abc import Iterable, Sequence

from sim.evaluation.metric import Metric

# Share [%] of intervals that contain the mean of all maps flown, by number of maps in a sample; 4000 samples each, for
# planners and their differences, missions of 20 s and 40 s. tests/sim/analysis/test_coverage.py counts again.
SHARES = {2: 86, 3: 90, 5: 91, 8: 94, 10: 93, 20: 94, 50: 95}  # for scans with OSPA under 1 m: the lowest coverage
# For a mission's mean and median OSPA, and its mean GOSPA in the worlds of bench-1: median and lowest coverage.
ERRORS = {
    "ospa.mean_m": {2: (92, 81), 3: (91, 80), 5: (86, 70), 8: (85, 67), 10: (83, 58), 20: (91, 44), 50: (91, 45)},
    "ospa.median_m": {2: (91, 84), 3: (92, 81), 5: (90, 68), 8: (91, 67), 10: (91, 60), 20: (92, 42), 50: (94, 28)},
    "gospa.mean_m": {2: (93, 87), 3: (96, 83), 5: (96, 79), 8: (96, 77), 10: (96, 76), 20: (95, 76), 50: (95, 86)},
}
ENOUGH = 8  # number of maps from which on intervals of shares have the coverage that they claim
COVERED = (
    f"With {ENOUGH} maps or more, intervals of shares of scans contain the true mean in at least 92 % of cases. "
    "This was counted by drawing maps from trials that were flown.",
    "Intervals of mean OSPA in metres do not, with any number of maps up to 50. On about one map in fifty a planner "
    "loses people for good, and such a map outweighs all others; samples without one miss the mean. Shares of scans "
    "tell more, and so do medians over the maps, whose intervals are reliable with six maps or more.",
    "Intervals of mean GOSPA contain the true mean in 95 % of cases (median over planners and worlds of bench-1), at "
    "worst in 76 %. For other metrics, such as run times, this was not counted.",
)
_SHARE = "ospa.share_under_1m"


def caveats(measured: Iterable[tuple[Metric, int]]) -> list[str]:
    """Caveats about intervals of means, given metrics and numbers of maps; none if the coverage is as claimed.

    For a difference the number of maps is that of its pairs. Coverage is known for `ospa.share_under_1m` and for the
    errors in `ERRORS`, which differ so much that nothing follows for other metrics, in m or in %. Intervals of medians
    over maps have their coverage for any metric.
    """
    counted = [(metric, maps) for metric, maps in measured if maps > 1]
    found = []
    few = min((maps for metric, maps in counted if metric.name == _SHARE), default=ENOUGH)
    if few < ENOUGH:
        least = min(SHARES[n] for n in _nearest(few))
        found.append(f"Intervals over only {few} maps are right in {least} % of cases.")
    errors = [(maps, metric.name) for metric, maps in counted if metric.name in ERRORS]
    if errors:
        found.append(_of_errors(errors))
    unknown = [metric.label for metric in dict(counted) if metric.name not in (_SHARE, *ERRORS)]
    if unknown:
        found.append(f"It was not counted how often intervals are right for: {', '.join(unknown)}.")
    return found


def _nearest(maps: int) -> set[int]:
    """The neighbours of a number of maps among those counted: itself, two, or the largest alone."""
    return {max(n for n in SHARES if n <= maps), min((n for n in SHARES if n >= maps), default=max(SHARES))}


def _of_errors(errors: Sequence[tuple[int, str]]) -> str:
    """Caveat with the lowest coverage of intervals of mean errors, given numbers of maps and names of metrics."""
    counted = [ERRORS[name][n] for maps, name in errors for n in _nearest(maps)]
    usual, least = (min(shares) for shares in zip(*counted, strict=True))
    fewest, most = min(errors)[0], max(errors)[0]
    many = str(most) if fewest == most else f"{fewest} to {most}"
    return f"Intervals of mean errors over {many} maps are right in {usual} % of cases, at worst in {least} %."
