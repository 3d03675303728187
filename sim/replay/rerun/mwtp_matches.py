"""Matches of UAVs and unseen tracks by the MWTP at the end of the plans of a recording."""

import numpy as np

from planning.objective.mwtp import Match
from planning.objective.nbo import terminal_matches
from planning.planner import Situation
from planning.prediction.propagation import Nominal
from planning.prediction.response import mean_velocities, response
from sim.mission.tracker_setup import planned_motion
from sim.recording.recording import Recording
from sim.replay.recorded_fleet import known_forest, vehicles_at
from sim.replay.tracking_replay import replay_tracking
from tracking.numerics.arrays import Array


def matches_at(recording: Recording, k: int, uav: int) -> tuple[tuple[Match, Array], ...]:
    """Matches at the end of the plans made at scan k, by one UAV's belief at that scan, the strongest first.

    Each match of a UAV id and a track id comes with the track's expected position (2,) m at that end. Matches follow
    from the plans by [Li22] Algorithm 2, whether or not the planner used the MWTP as cost-to-go.
    """
    plans, situation = recording.plans_at(k), situation_at(recording, k, uav)
    if plans is None or not situation.tracks:
        return ()
    planned = [plans[v.id].controls for v in situation.vehicles]
    horizon = max(map(len, planned))
    if not horizon:
        return ()
    controls = np.array([np.pad(plan, ((0, horizon - len(plan)), (0, 0))) for plan in planned])  # hover at the end
    view = Nominal().predict(situation, horizon, np.random.default_rng(0))  # this prediction draws no random numbers
    view = view._replace(weights=np.array([t.existence for t in situation.tracks]))
    flown = mean_velocities(response(situation.vehicles, situation.step), controls[None])[0]
    targets, found = terminal_matches(view, flown)
    ids = [v.id for v in situation.vehicles], [t.id for t in situation.tracks]
    return tuple((m._replace(uav=ids[0][m.uav], target=ids[1][m.target]), targets[m.target, :2]) for m in found)


def situation_at(recording: Recording, k: int, uav: int) -> Situation:
    """Situation of one UAV when plans were made at scan k: its tracks, and all UAVs that worked.

    Note: the team is the true one; links that were down and earlier intents are ignored.
    """
    setting = recording.setting
    fleet = [v for v in vehicles_at(recording, k) if recording.working[k, v.id]]
    return Situation(
        time=float(recording.times[k]),
        own=next(v for v in fleet if v.id == uav),
        neighbours=tuple(v for v in fleet if v.id != uav),
        tracks=recording.tracks_at(k, uav),
        forest=known_forest(recording),
        area=(setting.area.width, setting.area.height),
        motion=planned_motion(setting, replay_tracking(recording).motion(k, uav)),
    )
