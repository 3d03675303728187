"""The MWTP side by side against the MWTP of one plan, to the last bit."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from planning.objective.mwtp import weighted_trace_penalty
from planning.objective.mwtp_lanes import mark_in_view_lanes, penalties, workspace
from planning.prediction.field_of_view import view_quadrangle
from planning.prediction.predicted_belief import LANES
from tracking.geometry.camera import ALL_ROUND, Camera


def views(team, rng, kind):
    """Fields of view of level or tilted cameras, or of some all round."""
    out = []
    for i, s in enumerate(team):
        attitude = (
            Rotation.from_euler("xyz", rng.uniform(-0.4, 0.4, 3)).as_quat() if kind == "tilted" else s.own.attitude
        )
        camera = Camera(ALL_ROUND, 128) if kind == "all round" and i % 2 else s.own.camera
        out.append(view_quadrangle(dataclasses.replace(s.own, attitude=attitude, camera=camera)))
    return np.array(out)


@pytest.mark.parametrize("kind", ["level", "tilted", "all round"])
def test_side_by_side_the_penalty_is_that_of_each_plan(random_team, kind):
    rng, positive = np.random.default_rng(3), 0
    for case in range(60):
        n, T = int(rng.integers(1, 6)), int(rng.integers(0, 9))
        fields = views(random_team(case, uavs=n, targets=1), rng, kind)
        targets, sensors = rng.uniform(-40, 40, (T, 3)), rng.uniform(-40, 40, (n, 2, LANES))
        traces = rng.uniform(0.1, 9.0, (T, LANES))
        if case % 3 == 0:
            traces = np.ceil(traces)  # some are equal
        work, sums = workspace(T, n), np.zeros(LANES)
        work.unseen[:], work.sensors[:, :2], work.sensors[:, 2] = 1.0, sensors, 0.0
        for uav in range(n):
            mark_in_view_lanes(work, targets, uav, fields)
        penalties(work, targets, traces, fields, sums)
        lanes = [(np.ascontiguousarray(traces[:, k]), np.ascontiguousarray(sensors[:, :, k])) for k in range(LANES)]
        expected = [weighted_trace_penalty(targets, trace, sensor, fields) for trace, sensor in lanes]
        np.testing.assert_array_equal(sums, expected)
        positive += np.sum(np.array(expected) > 0)
    assert positive > (1000 if kind != "all round" else 100)
