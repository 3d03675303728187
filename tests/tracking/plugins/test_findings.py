"""Words of findings."""

import pytest

from tracking.plugins.findings import describe_time


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        ([0.0123, 0.0125, 0.0124], "12.4 ms a scan, at most 12.5 ms"),
        ([1.0, 0.001], "500 ms a scan, at most 1 s; longer than the time between scans"),
        ([1.084, 0.25, 0.9], "900 ms a scan, at most 1.08 s; longer than the time between scans"),
    ],
)
def test_times_are_those_of_people(seconds, text):
    assert describe_time(seconds, "a scan") == text
    late = [describe_time([s], "a scan").endswith("; longer than the time between scans") for s in (0.2, 0.201)]
    assert late == [False, True]
    assert describe_time([1.5], "a decision", 1.0, "a step of its plan").endswith("; longer than a step of its plan")
