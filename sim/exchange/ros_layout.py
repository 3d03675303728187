"""A layout of Foxglove for the bag of a mission: scene, cameras, errors and events."""

import json
from typing import Any

Config = dict[str, Any]
_PLOTS = {"OSPA [m]": "ospa", "GOSPA [m]": "gospa", "Bytes sent": "bytes_sent"}
_MOST = 4  # panels in a row or column


def make_layout(uavs: int, width: float) -> str:
    """The content of the file, for a number of UAVs above an area of a width [m]."""
    fleet = [f"uav{i}" for i in range(uavs)]
    shown = {f"/{uav}/markers": {"visible": True} for uav in fleet}
    scene = {topic: {"visible": True} for topic in ("/forest", "/people")}
    panels: Config = {
        "3D!scene": {
            "cameraState": {"distance": width, "perspective": True, "phi": 50, "thetaOffset": 0},
            "followMode": "follow-none",
            "followTf": "map",
            "scene": {"transforms": {"showLabel": False, "axisSize": 1}},
            "topics": scene | shown,
        },
        "RosOut!events": {"topicToRender": "/events", "minLogLevel": 1, "searchTerms": []},
    }
    for uav in fleet:
        camera = f"/{uav}/camera"
        panels[f"Image!{uav}"] = {
            "foxglovePanelTitle": f"Camera of {uav}",
            "imageMode": {"imageTopic": f"{camera}/image/compressed", "calibrationTopic": f"{camera}/camera_info"},
            "topics": {f"/{uav}/markers": {"visible": True, "namespaces": {"view": {"visible": False}}}},
        }
    for title, name in _PLOTS.items():
        lines = [{"value": f"/{uav}/{name}.data", "label": uav, "enabled": True} for uav in fleet]
        panels[f"Plot!{name}"] = {"foxglovePanelTitle": title, "paths": lines, "showLegend": True}
    below = _arrange(["RosOut!events", *(f"Plot!{name}" for name in _PLOTS.values())], "row")
    left = {"direction": "column", "first": "3D!scene", "second": below, "splitPercentage": 70}
    images = _arrange([f"Image!{uav}" for uav in fleet], "column")
    layout = {"direction": "row", "first": left, "second": images, "splitPercentage": 75}
    return json.dumps({"configById": panels, "globalVariables": {}, "userNodes": {}, "layout": layout}, indent=1)


def _arrange(panels: list[str], direction: str) -> Any:  # noqa: ANN401 - a panel, or a split of panels
    """Panels of equal sizes in a row or column, in two of them if there are many."""
    if len(panels) == 1:
        return panels[0]
    if len(panels) > _MOST:
        half, across = len(panels) // 2, {"row": "column", "column": "row"}[direction]
        halves = _arrange(panels[:half], direction), _arrange(panels[half:], direction)
        return {"direction": across, "first": halves[0], "second": halves[1]}
    rest = _arrange(panels[1:], direction)
    return {"direction": direction, "first": panels[0], "second": rest, "splitPercentage": 100 / len(panels)}
