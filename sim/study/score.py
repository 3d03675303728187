"""Floor and bound that a study places its planners between."""

from msgspec import Struct

VIEW = "view"  # a factor that the trials of the bound alone have
UNLIMITED = {"sensing.mode": "ideal", "sensing.field_of_view": "unlimited"}  # their settings


class Score(Struct, frozen=True, forbid_unknown_fields=True):
    """Ends between which a study places its planners; both are flown, whatever planners are compared."""

    floor: str  # a planner
    bound: str  # a planner, which flies with an unlimited field of view and ideal sensing
    metric: str = "gospa.mean_m"
