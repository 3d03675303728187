"""Settings of no possible mission are refused in one line that names field, value and what is allowed."""

import pytest

from sim.scenario.loading import load
from tracking.errors import InputError

ALL_ROUND = "sensing.mode=ideal sensing.field_of_view=unlimited"
# Settings, parted by spaces where there are several, and words of the line. That each number has its bounds is tested
# in test_loading.
WRONG = {
    "trees.densty=3": ["trees.densty", "did you mean density"],
    "tree.density=3": ["tree", "did you mean trees"],
    "uavs.0.fov_rad=1": ["uavs.0.fov_rad", "did you mean fov_deg"],
    "trees.density=-3": ["trees.density", "-3", ">= 0"],
    "trees.density=nan": ["trees.density", "nan", ">= 0"],
    "trees.density=many": ["trees.density", "'many'", "`float`"],
    "duration=inf": ["duration", "inf", "<= 86400"],
    "duration=0": ["duration", "> 0"],
    "duration.x=3": ["duration", "no keys"],
    "rates.sensing=7": ["rates", "240 Hz", "7 Hz"],
    "rates.planning=2": ["rates: planning 2 Hz", "rates.sensing 5 Hz", "2.5 Hz (0.4 s) and 1.66666666667 Hz (0.6 s)"],
    "rates.planning=0.3": ["rates: planning 0.3 Hz", "nearest: 0.3125 Hz (3.2 s) and 0.294117647059 Hz (3.4 s)"],
    "rates.planning=10": ["rates: planning 10 Hz", "nearest: 5 Hz (0.2 s)"],
    "rates.planning=0": ["rates.planning: 0 is not allowed", ">= 0.01"],
    "first_decision=3 rates.planning=0.5": ["first_decision: 3 s", "2 s between decisions", "nearest are 2 and 4"],
    "rates.physics=20": ["rates.physics: at 20 Hz", "25 Hz or more"],
    "first_decision=0.4": ["first_decision: 0.4 s", "1 s between decisions", "nearest are 0 and 1"],
    "first_decision=41": ["first_decision: 41 s is after the duration of 40 s"],
    "dynamics=quad": ["dynamics", "quadrotor", "did you mean quadrotor"],
    "trees.canopy_base=9": ["canopy_base 9", "canopy_top 6"],
    "trees.largest_radius=4": ["trees", "largest_radius 4", "canopy_radius 5"],
    'people.walks=["levi"]': ["people.walks: 'levi' is unknown; allowed are levy", "did you mean levy?"],
    "people.walks=levy": ["people.walks: 'levy' is not allowed", "expected `array`"],
    "people.walks=[]": ["people.walks", "length >= 1"],
    "uavs.0.footprint=4 sensing.mode=ideal": ["uavs.0", "altitude", "3.5 m, not above trees.canopy_top 6 m"],
    "uavs.0.footprint=8": ["uavs.0", "altitude", "6.9 m, not 1 m above trees.canopy_top 6 m"],
    "uavs.0.start=[500,0]": ["uavs.0.start", "outside the area"],
    "uavs=[{start=[0,0]},{start=[0.5,0]}]": ["uavs.1.start", "[0.5, 0.0]", "1 m from uavs.0"],
    "uavs.7.alpha=1": ["'7'", "0 to 2"],
    "network.cuts.0.start=1": ["network.cuts.0.start: '0' is not an index; the list is empty"],
    "tracking.confirm.0=4": ["confirm 4 of 3"],
    "alpha=1": ["alpha: unknown key; did you mean uavs.0.alpha?"],
    "trees.count=1": ["trees.count: unknown key; allowed are density", "did you mean people.count?"],
    "factors.H=1": ["factors: unknown key; it is not part of a scenario, but one of a study", "`understory compare`"],
    "duration=3\nseed=3": ["duration: '3\\nseed=3' is not allowed"],
    "uavs.²=1": ["'²' is not an index", "0 to 2"],
    "uavs={start=[0,0]}": ["uavs: expected `array`, got `object`; each of several is [[uavs]]"],
    "trees.leaf_area_density=-0.1": ["trees.leaf_area_density: -0.1 is not allowed; expected `float` >= 0"],
    "trees.density=true": ["trees.density: True is not allowed; expected `float`, got `bool`"],
    "uavs=[{alpha=1}]": ["uavs.0.start: is missing, and has no default"],
    "uavs=[]": ["uavs", "length >= 1"],
    "tracking.confirm=[4,3]": ["confirm", "4 of 3"],
    "people.min_speed=5": ["min_speed 5", "max_speed 3"],
    "version=2": ["version", "2"],
    "nonsense": ["key=value"],
    "tracking.management=existance": ["tracking.management: 'existance'", "existence, m_of_n; did you mean existence?"],
    "tracking.deletion_threshold=0.995": [
        "tracking",
        "deletion_threshold 0.995 must be below confirmation_threshold 0.99",
    ],
    "sensing.mode=idle": ["sensing.mode: 'idle' is unknown; allowed are camera, ideal; did you mean ideal?"],
    "tracking.motion=imm": ["tracking.motion: 'imm' is unknown; allowed are mean-reverting, ncv"],
    "x" + ".x" * 5000 + "=1": ["x", "unknown key"],
    # Cameras
    "uavs.0.mount=gimball": ["uavs.0.mount: 'gimball'", "did you mean gimbal?"],
    "uavs.0.tilt_deg=61": ["uavs.0.tilt_deg: 61", "<= 60"],
    "uavs.0.tilt_deg=60": ["uavs.0", "tilt_deg 60", "less than 60"],
    "uavs.0.tilt_deg=50 uavs.0.fov_deg=80": ["uavs.0", "tilt_deg 50", "fov_deg 80", "less than 50"],
    "uavs.2.rate=2": ["uavs.2.rate", "2 Hz", "rates.sensing 5 Hz", "2.5 Hz (0.4 s) and 1.66666666667 Hz (0.6 s)"],
    "uavs.2.rate=10": ["uavs.2.rate: 10 Hz", "nearest: 5 Hz (0.2 s)"],
    "uavs.0.rate=fast": ["uavs.0.rate", "'fast'", "`float`"],
    "uavs.0.pixels=99.5": ["uavs.0.pixels: 99.5 is not allowed", "int"],
    "sensing.renderer=elg": ["sensing.renderer: 'elg'", "did you mean egl?"],
    # Wind
    "wind.velocity=[12,5]": ["wind", "velocity [12.0, 5.0]", "13 m/s", "at most 12 m/s"],
    "wind.gust=1 dynamics=kinematic": ["wind", "kinematic", "quadrotor"],
    # Numbers beyond all measure
    "people.count=1e9": ["people.count: 1000000000.0", "expected `int`"],
    "area.height=1e-320": ["area.height", ">= 1"],
    "duration=1e308": ["duration: 1e+308", "<= 86400"],
    "network.cuts=[{links=[[0,1]],end=1e308}]": ["network.cuts.0.end", "<= 86400"],
    # What settings come to together
    "duration=86400 rates.sensing=10": ["duration, rates.sensing and uavs", "2.592e+06 scans", "2e+06"],
    "duration=80000 rates.physics=10000": ["duration, rates.physics and uavs", "2.4e+09", "1e+09"],
    "duration=100 people.count=5000": ["duration and people.count", "500000 seconds of walking", "360000"],
    "people.count=9000 rates.sensing=80": ["uavs and people.count", "8.64e+07 lines of sight", "1e+07"],
    "area.width=20000 area.height=20000": ["area and uavs", "1.2e+09 m²", "6e+08"],
    "uavs.0.pixels=4096 duration=50000": ["pixels", "4.2025e+12", "1e+12"],
    "network.rounds=1000 duration=40000": ["network.rounds", "1.8e+09 messages"],
    "people.paths=[[[-1e308,0],[1e308,0]]]": ["people.paths.0.0.0: -1e+308", ">= -1000000"],
    "uavs.0.footprint=9000 uavs.0.fov_deg=1": ["uavs.0: footprint 9000 m", "altitude", "10000 m"],
}
ALLOWED_OF_CUTS = "allowed are links, start, end; did you mean start?"
# The whole line.
LINES = {
    "network.links=[[0,3]]": "network.links: [0, 3] names UAV 3; allowed are 0 to 2",
    "network.links=[[1,1]]": "network.links: [1, 1] links UAV 1 to itself; allowed are pairs of two UAVs",
    "network.links=[[0,1],[1,0]]": "network.links: [1, 0] is there twice; allowed is each pair once",
    "network.links=[[0,1,2]]": "network.links.0: [0, 1, 2] is not allowed; expected `array` of length 2, got 3",
    "network.links=[[0,-1]]": "network.links.0.1: -1 is not allowed; expected `int` >= 0",
    "network.cuts=[{links=[[0,5]]}]": "network.cuts.0.links: [0, 5] names UAV 5; allowed are 0 to 2",
    "network.cuts=[{links=[]}]": "network.cuts.0.links: [] is not allowed; expected `array` of length >= 1",
    "network.cuts=[{links=[[0,1]],start=9,end=9}]": "network.cuts.0: end 9 must be after start 9",
    "network.cuts=[{links=[[0,1]],strat=9}]": f"network.cuts.0.strat: unknown key; {ALLOWED_OF_CUTS}",
    "network.loss=1.5": "network.loss: 1.5 is not allowed; expected `float` <= 1.0",
    "network.fusion=hcmi": "network.fusion: 'hcmi' is unknown; allowed are kla, hcmci; did you mean hcmci? "
    "(or package.module:Class)",
    "network.plan_delay=0.3": "network.plan_delay: 0.3 s is not a multiple of the 0.2 s between scans; "
    "the nearest are 0.2 and 0.4",
    "network.plan_delay=-1": "network.plan_delay: -1 is not allowed; expected `float` >= 0.0",
    "network.rate=0": "network.rate: 0 is not allowed; expected `float` > 0.0",
    "network.jitter=-1": "network.jitter: -1 is not allowed; expected `float` >= 0.0",
    "network.delay=30 network.jitter=10": "network.delay: 40 s with network.jitter is not below the duration of 40 s",
    "network.delay=1 network.hold=0.5": "network.hold: 0.5 s must not be less than the 1 s that messages may take",
    "network.rate=1e4 network.hold=0.1": "network.hold: 0.1 s must not be less than the 0.2 s between scans",
    "uavs.1.fails_at=-1": "uavs.1.fails_at: -1 is not allowed; expected `float` >= 0.0",
    "uavs=[{start=[0,0],fails_at=0}]": "uavs: all have fails_at 0; at least one has to work at the start",
    "sensing.field_of_view=unlimited": 'sensing: field_of_view "unlimited" has no image; allowed with mode "ideal"',
    f"{ALL_ROUND} sensing.false_alarms=1": "sensing: false_alarms are spread over an image; "
    'allowed with field_of_view "camera"',
    "sensing.field_of_view=unlimted": "sensing.field_of_view: 'unlimted' is not allowed; "
    "allowed are camera, unlimited; did you mean unlimited?",
}


@pytest.mark.parametrize("settings", [*WRONG, *LINES])
def test_a_wrong_value_is_named_in_one_line(settings):
    with pytest.raises(InputError) as caught:
        load("forest", settings.split(" "))
    message = str(caught.value)
    assert "\n" not in message and message == LINES.get(settings, message)
    for word in WRONG.get(settings, []):
        assert word in message
