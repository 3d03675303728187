"""Matches of UAVs and unseen tracks at the end of the plans of a recording, as the MWTP makes them."""

import numpy as np

from planning.objective.mwtp import Match
from planning.objective.nbo import terminal_matches
from planning.planner import Situation
from planning.prediction.propagation import Nominal
from planning.prediction.response import mean_velocities, response
from sim.mission.tracker_setup import planned_motion
from sim.recording.recording import Recording
from sim.replay.recorded_fleet import known_forest, motion_at, vehicles_at
from tracking.numerics.arrays import Array


def matches_at(recording: Recording, k: int, uav: int) -> tuple[tuple[Match, Array], ...]:
    """The matches at the end of the plans made at scan k on what one UAV believed then, the strongest first.

    They are by ids of UAVs and tracks, each with where the track is then expected (2,) m. They are what the MWTP would
    make of these plans, [Li22] Algorithm 2, whether or not the planner had it as a cost-to-go.
    """
    plans, situation = recording.plans_at(k), situation_at(recording, k, uav)
    if plans is None or not situation.tracks:
        return ()
    planned = [plans[v.id].controls for v in situation.vehicles]
    horizon = max(map(len, planned))
    if not horizon:
        return ()
    controls = np.array([np.pad(plan, ((0, horizon - len(plan)), (0, 0))) for plan in planned])  # others hover then
    view = Nominal().predict(situation, horizon, np.random.default_rng(0))  # draws nothing
    view = view._replace(weights=np.array([t.existence for t in situation.tracks]))
    flown = mean_velocities(response(situation.vehicles, situation.step), controls[None])[0]
    targets, found = terminal_matches(view, flown)
    ids = [v.id for v in situation.vehicles], [t.id for t in situation.tracks]
    return tuple((m._replace(uav=ids[0][m.uav], target=ids[1][m.target]), targets[m.target, :2]) for m in found)


def situation_at(recording: Recording, k: int, uav: int) -> Situation:
    """Situation of one UAV when plans were made at scan k: its tracks, and all UAVs that worked.

    Note: the team is the true one; links that were down then, and earlier intents, are left out.
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
        motion=planned_motion(setting, motion_at(recording, k, uav)),
    )
