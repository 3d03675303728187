"""How the Rerun viewer opens: the forest at large, cameras beside it, curves and events below."""

from __future__ import annotations

import rerun.blueprint as rrb

from sim.scenario import Scenario

_CURVES = {
    "OSPA [m]": "plots/ospa",
    "Covariance, trace [m²]": "plots/covariance",
    "UAVs' gap [m]": "plots/agreement",
    "Bytes sent": "plots/bytes",
    "Pixels of people": "plots/visible",
    "Planning [ms]": "plots/planning",
}
_COLUMN = 4  # images one above the other


def layout(scenario: Scenario, *, planning: bool) -> rrb.Blueprint:
    """Where everything is; `planning`, whether the time of decisions is known."""
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
            rrb.Vertical(_forest(scenario), rrb.Horizontal(rrb.Tabs(people, *curves), events), row_shares=[5, 3]),
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


def _forest(scenario: Scenario) -> rrb.Spatial3DView:
    """From the south and above, the whole area in sight; what lies in image planes is left to the images."""
    width, height = scenario.area.width, scenario.area.height
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
        eye_controls=rrb.EyeControls3D(
            position=(0.0, -0.5 * max(width, height), 0.42 * max(width, height)),
            look_target=(0.0, -0.08 * height, 0.0),
            eye_up=(0.0, 0.0, 1.0),
        ),
    )
