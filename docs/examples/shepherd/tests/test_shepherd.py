"""The shepherd keeps to what planners must, and keeps the flock together."""

import numpy as np
from shepherd import Shepherd

from understory import check_planner, make_random_team


def test_it_conforms() -> None:
    """As `understory check-planner shepherd` says."""
    for finding in check_planner("shepherd:Shepherd"):
        assert finding.passed, finding


def test_a_stray_is_followed() -> None:
    """Alone with one person out of view, a UAV flies there."""
    (situation,) = make_random_team(5, uavs=1, targets=1, trees=0)
    gap = situation.tracks[0].belief.mean[:2] - situation.own.position[:2]
    (plan,) = Shepherd().plan([situation], np.random.default_rng(0))
    assert np.linalg.norm(gap) > 12.0
    assert plan.controls[0] @ gap > 0.9 * situation.own.max_speed * np.linalg.norm(gap)
