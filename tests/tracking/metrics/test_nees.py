"""The interval of the NEES."""

import numpy as np
import pytest
from scipy.stats import chi2

from tracking.metrics.nees import nees_interval


def test_the_interval_holds_95_percent_of_means():
    low, high = nees_interval(20, 4)
    means = np.random.default_rng(1).chisquare(4, (20_000, 20)).mean(axis=1)
    assert np.mean((means >= low) & (means <= high)) == pytest.approx(0.95, abs=0.005)
    assert nees_interval(1, 2) == pytest.approx(tuple(chi2.interval(0.95, 2)))
    with pytest.raises(ValueError, match="at least 1"):
        nees_interval(0, 2)
