"""Associations worked out from a recording, against those that the trackers made in flight."""

import math
from dataclasses import replace

import numpy as np
import pytest
from helpers.flights import recorded
from sim.replay.explain.association import Association

import tracking.tracker
from tracking.measurement_update import associate, scan_update

CASES = {
    "m_of_n": ["trees.density=75"],
    "existence": ["tracking.management=existence", "tracking.initial_tracks=none", "sensing.false_alarms=1"],
    "discs, nearly constant velocity, a slow camera, one that breaks down": [
        "sensing.occlusion=disc", "tracking.motion=ncv", "uavs.1.rate=1", "uavs.2.fails_at=2",
        "network.fusion=hcmci",
    ],
}  # fmt: skip


def flown(case, monkeypatch):
    """A recording, and what each tracker saw, found and weighed, in the order of scans and UAVs."""
    spied = []

    def updated(before, z, R, lost, p):
        beta = associate(before, z, R, lost, p.association)[1]
        spied.append((before, z, R, lost, scan_update(before, z, R, lost, p), beta))
        return spied[-1][4]

    monkeypatch.setattr(tracking.tracker, "scan_update", updated)
    return recorded("sensing.mode=ideal", *CASES[case], duration=5), spied


@pytest.mark.parametrize("case", CASES)
def test_associations_are_those_of_the_flight(case, monkeypatch):
    recording, spied = flown(case, monkeypatch)
    hidden, ambiguous, turned = 0, 0, 0
    for k, uav in np.ndindex(recording.poses.shape[:2]):
        found = Association.of(recording, k, uav)
        if found is None:
            assert (uav == 1 and k % 5) or (uav == 2 and k >= 10)
            continue
        before, z, R, lost, after, beta = spied.pop(0)
        np.testing.assert_equal(found.before._asdict(), before._asdict())
        made = (found.measurements, found.covariances, found.gated, found.beta, found.existence)
        gated = np.zeros_like(found.gated)
        gated[tuple(after.gates.T)] = True
        np.testing.assert_equal(made, (z, R, gated, beta, after.existence))
        np.testing.assert_array_equal(found.beta[:, 0], after.missed)
        turned += np.count_nonzero(lost)
        hidden += np.count_nonzero(found.before.visible < 0.5)
        ambiguous += np.count_nonzero((found.beta[:, 1:] > 0.01) & (found.beta[:, 1:] < 0.99))
    assert spied == [] and hidden > 5 and turned > 5
    assert ambiguous > 0 or case != "existence"


def test_weights_distances_gates_and_visibility_are_what_they_say(monkeypatch):
    recording, _ = flown("existence", monkeypatch)
    gate = -2 * math.log(1 - recording.setting.tracking.gate_probability)
    order = list(dict.fromkeys(recording.track_ids.tolist()))
    pairs = 0
    for k, uav in np.ndindex(recording.poses.shape[:2]):
        found = Association.of(recording, k, uav)
        np.testing.assert_allclose(found.beta.sum(axis=1), 1.0, atol=1e-12)
        np.testing.assert_array_equal(found.beta[:, 1:] > 0, found.gated)
        np.testing.assert_array_equal(found.gated, found.distances <= gate)
        assert [order[n] for n in found.numbers] == found.ids.tolist()
        for t, j in np.argwhere(found.gated)[:3]:
            nu = found.measurements[j] - found.before.means[t, :2]
            S = found.before.covariances[t, :2, :2] + found.covariances[j]
            assert found.distances[t, j] == pytest.approx(nu @ np.linalg.inv(S) @ nu, rel=1e-9)
            pairs += 1
    assert pairs > 50


def test_a_mission_of_one_scan_has_its_first_association(monkeypatch):
    recording, spied = flown("m_of_n", monkeypatch)
    names = "times people headings poses cameras commands ospa visible matched".split()
    one = replace(recording, **{name: getattr(recording, name)[:1] for name in names})
    for uav in range(3):
        np.testing.assert_array_equal(Association.of(one, 0, uav).beta, spied[uav][5])
