"""What comparisons share."""

import pytest


@pytest.fixture(scope="module")
def judged(request):
    """Whether times count: they do not in ordinary test runs, which try everything once, on little."""
    return request.config.getoption("benchmark_enable")
