"""Layout of the Rerun viewer: the forest at large, cameras beside it, curves and events below."""

from __future__ import annotations

import rerun.blueprint as rrb

from sim.recording.recording import Recording
from sim.scenario.scenario import Scenario

_CURVES = {
    "OSPA [m]": "plots/ospa",
    "Covariance, trace [m²]": "plots/covariance",
    "UAVs' gap [m]": "plots/agreement",
    "Bytes sent": "plots/bytes",
    "Pixels of people": "plots/visible",
    "Planning [ms]": "plots/planning",
}
_AWAY, _NEAREST = 0.75, 40.0  # of the viewer's eye: in widths of where UAVs have been, and that at least [m]
_COLUMN = 4  # images one above the other


def layout(recording: Recording, scenario: Scenario, *, planning: bool) -> rrb.Blueprint:
    """The arrangement of all views; `planning`: the time of decisions is known."""
    uavs = range(len(scenario.uavs))
    images = [rrb.Spatial2DView(origin=f"world/camera/{i}", name=f"Camera of UAV {i}") for i in uavs]
    weights = [rrb.TextDocumentView(origin=f"association/{i}", name=f"Weights, UAV {i}") for i in uavs]
    curves = [
        rrb.TimeSeriesView(origin=path, name=name)
        for name, path in _CURVES.items()
        if planning or path != "plots/planning"
    ]
    people = rrb.StateTimelineView(origin="people", name="People")
    events = rrb.TextLogView(
        origin="events",
        name="Events",
        columns=rrb.TextLogColumns(text_log_columns=["LogLevel", "Body"]),
        rows=rrb.TextLogRows(filter_by_log_level=["INFO", "WARN", "ERROR"]),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                _forest(recording, scenario), rrb.Horizontal(rrb.Tabs(people, *curves), events), row_shares=[5, 3]
            ),
            rrb.Vertical(
                rrb.Vertical(*images) if len(images) <= _COLUMN else rrb.Grid(*images),
                rrb.Tabs(*weights),
                row_shares=[4, 1],
            ),
            column_shares=[4, 1],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline="time", play_state="paused"),
    )


def _forest(recording: Recording, scenario: Scenario) -> rrb.Spatial3DView:
    """From the south and above, all places where UAVs have been in sight.

    What lies in the planes of images is left to the images.
    """
    places = recording.poses[:, :, :2].reshape(-1, 2)
    low, high = places.min(axis=0), places.max(axis=0)
    (x, y), away = (low + high) / 2, _AWAY * max(*(high - low), _NEAREST)
    hidden = [
        f"- /world/camera/{i}/{name}"
        for i in range(len(scenario.uavs))
        for name in ("detections", "tracks", "association")
    ]
    return rrb.Spatial3DView(
        origin="world",
        name="Forest",
        contents=["+ $origin/**", *hidden],
        line_grid=False,
        eye_controls=rrb.EyeControls3D(position=(x, y - away, 0.8 * away), look_target=(x, y, 0), eye_up=(0, 0, 1)),
    )
