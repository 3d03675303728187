"""Trackers that take the recorded scans again, against the trackers of the mission."""

import dataclasses
import math
import sys
from dataclasses import replace

import numpy as np
import pytest
from helpers.flights import IDEAL, fly, recorded, recording_of
from helpers.identities import swapping
from msgspec import structs

from sim.facts.tracking_replay import replay_tracking
from sim.scenario.scenario import encode_scenario
from tracking.account import ScanAccount

CASES = {
    "late scans, a queue, one that breaks down": (
        *(*IDEAL, "network.delay=0.3", "network.jitter=0.5", "network.rate=2000", "network.loss=0.2"),
        *("network.links=[[0, 1], [1, 2]]", "tracking.initial_tracks=none", "sensing.false_alarms=1"),
        *("sensing.miss_probability=0.1", "uavs.1.fails_at=4"),
    ),
    "poses that err": (*IDEAL, "uavs.0.navigation=consumer", "uavs.2.navigation=gnss"),
    "images, m of n": ("trees.density=75", "tracking.management=m_of_n"),
    "unknown tracks": (
        *IDEAL,
        "tracking.initial_tracks=none",
        "sensing.false_alarms=1",
        "sensing.miss_probability=0.1",
    ),
    "discs, nearly constant velocity, a slow camera, one that breaks down": (
        *(*IDEAL, "sensing.occlusion=disc", "tracking.motion=ncv", "uavs.1.rate=1", "uavs.2.fails_at=2"),
    ),
    "lost messages, out of range": (
        *(*IDEAL, "network.loss=0.5", "network.range=20", "network.rounds=2", "network.fusion=kla"),
        *("tracking.initial_tracks=none", "sensing.false_alarms=0.5", "trees.density=75"),
    ),
}


def told(value):
    """The values of an account with arrays as bytes, to compare it."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value) if field.name != "find_association"]
        return [told(getattr(value, name)) for name in names + ["association"] * isinstance(value, ScanAccount)]
    return [told(part) for part in value] if isinstance(value, list | tuple) else value


def flown(options, duration=5, planner="greedy"):
    """A recording, and each tracker of its mission after each scan: its account in comparable form, and its motion."""
    states = []

    def see(mission):
        trackers = [mission._knowledge.trackers[i] for i in range(len(mission.scenario.uavs))]
        states.append([(told(tracker.account), tracker.motion) for tracker in trackers])

    mission, snapshots = fly(*options, planner=planner, seed=3, duration=duration, repeat=1, see=see)
    return recording_of(mission, snapshots, seed=3, repeat=1), states


@pytest.mark.parametrize("case", CASES)
def test_trackers_do_and_tell_again_what_they_did_in_flight(case):
    recording, states = flown(CASES[case])
    replay = replay_tracking(recording)
    assert replay.note == "" and len(replay.states) == len(recording.times)
    for k, i in np.ndindex(*recording.working.shape):
        again = replay.states[k].get(i)
        assert (again is not None) == recording.working[k, i]
        if again is not None:
            assert (told(again.account), again.motion) == states[k][i]
            assert (again.account.association is None) == (not recording.setting.has_frame(i, k))
    accounts = [account for k in range(len(recording.times)) for _, account in replay.accounts_at(k)]
    if "none" in " ".join(CASES[case]):
        assert sum(len(a.births) for a in accounts) > 5 and sum(len(a.deletions) for a in accounts) > 1


def test_plans_that_keep_scans_waiting_do_so_again():
    recording, states = flown((*IDEAL, "network.rate=1200"), planner="pma-nbo(horizon=3)")
    replay = replay_tracking(recording)
    assert replay.note == "" and recording.plan_bytes.any()
    for k, i in np.ndindex(*recording.working.shape):
        assert (told(replay.states[k][i].account), replay.states[k][i].motion) == states[k][i]


def test_associations_are_what_they_say():
    recording, _ = flown(CASES["unknown tracks"])
    gate, pairs = -2 * math.log(1 - recording.setting.tracking.gate_probability), 0
    for k, i in np.ndindex(*recording.working.shape):
        a, scan = replay_tracking(recording).association(k, i), recording.scan_at(k, i)
        np.testing.assert_array_equal(a.measurements, scan.measurements)
        weights, gated, distances = a.weights(), a.gated(), a.distances()
        np.testing.assert_allclose(a.after.missed + weights.sum(axis=1), 1.0, atol=1e-12)
        np.testing.assert_array_equal(weights > 0, gated)
        np.testing.assert_array_equal(gated, distances <= gate)
        for t, j in np.argwhere(gated)[:3]:
            nu = a.measurements[j] - a.before.means[t, :2]
            S = a.before.covariances[t, :2, :2] + a.covariances[j]
            assert distances[t, j] == pytest.approx(nu @ np.linalg.inv(S) @ nu, rel=1e-9)
            pairs += 1
    assert pairs > 50


def test_the_accounts_end_where_the_recording_departs_from_the_trackers():
    recording = recorded(*IDEAL, duration=2)
    means = recording.track_means.copy()
    means[recording.track_offsets[5 * 3], 0] += 1e-9
    replay = replay_tracking(replace(recording, track_means=means))
    assert len(replay.states) == 5 and replay.note.startswith("from 1.0 s on this version's trackers make other tracks")
    assert replay.association(4, 0) and replay.association(5, 0) is replay.motion(5, 0) is None
    assert replay.accounts_at(4) and replay.accounts_at(5) == []
    assert replay_tracking(swapping()).states == []
    names = "times people headings poses cameras commands ospa visible matched".split()
    one = replace(recording, **{name: getattr(recording, name)[:1] for name in names})
    assert replay_tracking(one).states == []  # initial velocities need a second scan


@pytest.mark.parametrize(("part", "key"), [("tracking", "tracker"), ("tracking", "motion"), ("network", "fusion")])
def test_plug_ins_that_a_recording_names_are_not_run(part, key):
    recording = recorded(*IDEAL, duration=1)
    setting = recording.setting
    outside = structs.replace(setting, **{part: structs.replace(getattr(setting, part), **{key: "antigravity:Model"})})
    replay = replay_tracking(replace(recording, scenario=encode_scenario(outside)))
    assert replay.states == [] and replay.note.startswith("antigravity:Model is a plug-in, which is not run again: ")
    assert "antigravity" not in sys.modules


def test_a_scan_that_no_tracker_takes_is_told_of_in_one_line():
    recording = recorded(*IDEAL, duration=1)
    wrong = replace(recording, measurement_covariances=-recording.measurement_covariances)
    note = replay_tracking(wrong).note
    assert note.startswith("the trackers cannot be run again: covariances[0] must be finite") and "\n" not in note
