"""Settings of no possible mission are refused in one line that names field, value and what is allowed."""

import pytest

from sim.scenario.loading import load_scenario
from tracking.errors import InputError

# Settings, parted by spaces where there are several, and words of the line; one of each kind, as the bounds of all
# numbers are tested in test_loading, and whatever else may be given in tests/test_hostile_inputs.py.
WRONG = {
    # Keys
    "trees.densty=3": ["trees.densty", "did you mean density"],
    "alpha=1": ["alpha: unknown key; did you mean uavs.0.alpha?"],
    "trees.count=1": ["trees.count: unknown key; allowed are density", "did you mean people.count?"],
    "factors.H=1": ["factors: unknown key; it is not part of a scenario, but one of a study", "`understory compare`"],
    "duration.x=3": ["duration", "no keys"],
    "uavs.7.alpha=1": ["'7'", "0 to 2"],
    "uavs=[{alpha=1}]": ["uavs.0.start: is missing, and has no default"],
    "uavs={start=[0,0]}": ["uavs: expected `array`, got `object`; each of several is [[uavs]]"],
    "x" + ".x" * 5000 + "=1": ["x", "unknown key"],
    "nonsense": ["key=value"],
    # Values
    "trees.density=nan": ["trees.density", "nan", ">= 0"],
    "uavs=[]": ["uavs", "length >= 1"],
    "appearance=ful": ["appearance: 'ful' is unknown; allowed are none, mild, full; did you mean full?"],
    'people.walks=["levi"]': ["people.walks: 'levi' is unknown; allowed are levy", "did you mean levy?"],
    "duration=3\nseed=3": ["duration: '3\\nseed=3' is not allowed"],
    # Values that others rule out
    "rates.planning=2": ["rates: planning 2 Hz", "rates.sensing 5 Hz", "2.5 Hz (0.4 s) and 1.66666666667 Hz (0.6 s)"],
    "rates.physics=20": ["rates.physics: at 20 Hz", "25 Hz or more"],
    "first_decision=0.4": ["first_decision: 0.4 s", "1 s between decisions", "nearest are 0 and 1"],
    "trees.canopy_base=9": ["canopy_base 9", "canopy_top 6"],
    "uavs.0.footprint=8": ["uavs.0", "altitude", "6.9 m, not 1 m above trees.canopy_top 6 m"],
    "uavs.0.start=[500,0]": ["uavs.0.start", "outside the area"],
    "uavs=[{start=[0,0]},{start=[0.5,0]}]": ["uavs.1.start", "[0.5, 0.0]", "1 m from uavs.0"],
    "uavs.0.tilt_deg=50 uavs.0.fov_deg=80": ["uavs.0", "tilt_deg 50", "fov_deg 80", "less than 50"],
    "tracking.confirm=[4,3]": ["confirm", "4 of 3"],
    "wind.velocity=[12,5]": ["wind", "velocity [12.0, 5.0]", "13 m/s", "at most 12 m/s"],
    "wind.gust=1 dynamics=kinematic": ["wind", "kinematic", "quadrotor"],
    "uavs=[{start=[0,0],fails_at=0}]": ["uavs: all have fails_at 0; at least one has to work at the start"],
    "sensing.field_of_view=unlimited": ['field_of_view "unlimited" has no image; allowed with mode "ideal"'],
    "sensing.mode=ideal sensing.field_of_view=unlimited sensing.false_alarms=1": ["false_alarms are spread over an"],
    # Links
    "network.links=[[0,3]]": ["network.links: [0, 3] names UAV 3; allowed are 0 to 2"],
    "network.links=[[0,1],[1,0]]": ["network.links: [1, 0] is there twice; allowed is each pair once"],
    "network.cuts=[{links=[[0,1]],start=9,end=9}]": ["network.cuts.0: end 9 must be after start 9"],
    "network.plan_delay=0.3": ["0.3 s is not a multiple of the 0.2 s between scans; the nearest are 0.2 and 0.4"],
    "network.delay=30 network.jitter=10": ["40 s with network.jitter is not below the duration of 40 s"],
    # What settings come to together
    "duration=100 people.count=5000": ["duration and people.count", "500000 seconds of walking", "360000"],
    "area.width=20000 area.height=20000": ["area and uavs", "1.2e+09 m²", "6e+08"],
}


@pytest.mark.parametrize("settings", WRONG)
def test_a_wrong_value_is_named_in_one_line(settings):
    with pytest.raises(InputError) as caught:
        load_scenario("forest", settings.split(" "))
    message = str(caught.value)
    assert "\n" not in message
    for word in WRONG[settings]:
        assert word in message
