"""Fixtures of the benchmarks."""

import pytest


@pytest.fixture(scope="module")
def judged(request):
    """True where times count: not in ordinary test runs, which try each benchmark once, on little."""
    return request.config.getoption("benchmark_enable")
