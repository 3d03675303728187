"""The objective of squared errors up to a cut-off: what it makes of lost people; `test_nbo` has a transcription."""

import dataclasses

import numpy as np
from helpers.nominal import nominal
from helpers.teams import planned

from planning.objective.nbo import Measure, objective
from tracking.filter.kalman import Gaussian
from tracking.track import Track


def test_a_person_lost_for_longer_costs_no_more(random_team):
    situation, still = random_team(2)[0], np.zeros((3, 3, 2))
    view = nominal(situation, 3)
    found = {}
    for cutoff in (np.inf, 10.0):
        for grown in (1e4, 1e6):  # of three of four people
            scales = np.array([1.0, grown, grown, grown])[:, None, None]
            lost = view._replace(covariances=view.covariances * scales)
            values = objective(lost, still, [0], 0.0, measure=Measure(gains=False, cutoff=cutoff))
            found[cutoff, grown] = values(still[None, :1])[0]
    assert found[np.inf, 1e6] > 90.0 * found[np.inf, 1e4]
    assert found[10.0, 1e4] <= found[10.0, 1e6] <= min(1.01 * found[10.0, 1e4], 4 * 3 * 100.0)


def test_a_lost_person_draws_a_uav_away_only_without_a_cutoff(random_team):
    """One UAV holds a person; another is lost 36 m away, and seeing that one takes leaving the first."""
    situation = random_team(2, uavs=1, targets=2, trees=0)[0]
    here = situation.own.position[:2]
    held = Track(0, Gaussian(np.array([*here, 0.0, 0.0]), np.diag([0.1, 0.1, 4.0, 4.0])))
    lost = Track(1, Gaussian(np.array([here[0] + 36.0, here[1], 0.0, 0.0]), np.diag([200.0, 200.0, 0.5, 0.5])))
    situation = dataclasses.replace(situation, tracks=(held, lost))
    plans = [planned(f"sma-nbo-gospa(search=0, cutoff={c}, evaluations=2000)", [situation])[0] for c in (0, 10)]
    without, with_one = (plan[:, 0].sum() for plan in plans)
    assert without > 15.0 and with_one < 0.0
