"""PyBullet's OpenGL renderer: it shows what TinyRenderer shows, or is refused with one line."""

import json

import msgspec
import numpy as np
import pybullet
import pytest
from helpers import synthetic
from helpers.flights import filmed
from helpers.recordings import record
from helpers.views import CAMERA, SCENARIO

from sim.exchange.export import write_labelled_images
from sim.facts.rerender import Rerenderer
from sim.mission.archive import save
from sim.scenario.loading import load_scenario
from sim.scenario.remarks import find_remarks
from sim.scenario.sensing import Sensing
from sim.sensing.renderer import Renderer
from sim.world import opengl
from sim.world.world import World
from tracking.detection.blob_detector import BlobDetector
from tracking.detection.detector import Frame
from tracking.errors import InputError
from tracking.geometry.camera import Camera, Pose
from tracking.geometry.visibility import Forest, Tree

EGL = msgspec.structs.replace(SCENARIO, sensing=Sensing(renderer="egl"))
BENT = Camera.calibrated(160, 120, (140.0, 138.0), (82.0, 59.0), (-0.3, 0.09, 0.001, -0.001))
OPEN = Forest(())
SET = "--set"


@pytest.fixture
def started():
    """Skips where there is no OpenGL."""
    if opengl.explain_refusal():
        pytest.skip(opengl.explain_refusal())


@pytest.fixture(params=["device", "library"])
def absent(request, monkeypatch, tmp_path):
    """OpenGL cannot start: the plug-in is told to use a device that does not exist, or finds a library that is none."""
    if request.param == "device":
        monkeypatch.setenv("EGL_VISIBLE_DEVICES", "99")
    else:
        for name in ("libEGL.so", "libEGL.so.1"):
            (tmp_path / name).touch()
        monkeypatch.setenv("LD_LIBRARY_PATH", str(tmp_path))
    opengl.explain_refusal.cache_clear()
    yield
    opengl.explain_refusal.cache_clear()


@pytest.mark.parametrize("camera", [CAMERA, BENT], ids=["straight", "through a lens"])
def test_opengl_shows_what_tiny_renderer_shows_and_says_nothing(started, capfd, camera):
    rng = np.random.default_rng(0)
    forest = Forest((Tree(0.0, 0.0, 4.0), Tree(9.0, 2.0, 4.0), Tree(-8.0, 5.0, 4.0)))
    differ, people = 0, 0
    with World(SCENARIO, forest, 6) as soft, World(EGL, forest, 6) as hard:
        renderers = Renderer(soft), Renderer(hard)
        for k in range(20):
            places, headings = rng.uniform(-10, 10, (6, 2)), rng.uniform(-3, 3, 6)
            places[: k % 3] = np.nan
            pose = Pose.level(*rng.uniform(-4, 4, 2), 19.0)
            for world in (soft, hard):
                world.place_people(places, headings)
            one, other = (renderer.render(camera, pose) for renderer in renderers)
            differ += np.count_nonzero(one.people != other.people)
            people += np.count_nonzero(one.people >= 0)
            # Trees look otherwise, as OpenGL filters textures and casts shadows.
            found = [BlobDetector().detect(Frame(0, 0.0, camera, pose, view.image)).ground for view in (one, other)]
            assert found[0] == pytest.approx(found[1], abs=0.1)
        bare = [renderer.render(camera, Pose.level(30.0, 20.0, 19.0)).image for renderer in renderers]
        assert bare[0].tobytes() == bare[1].tobytes()
    assert people > 500 and differ < 0.01 * people and capfd.readouterr() == ("", "")


def test_a_mission_flies_on_opengl_and_its_frames_come_out_again_byte_for_byte(started):
    recording, images = filmed("sensing.renderer=egl", "sensing.noise=camera", duration=0.6)
    assert len(recording.measurements) > 0 and recording.faults == "[]"
    with Rerenderer(recording) as again:
        for k, row in enumerate(images):
            assert [again.image(k, i).tobytes() for i in range(3)] == [image.tobytes() for image in row]


def test_the_whole_of_a_person_is_counted_beside_a_world_on_opengl(started, tmp_path):
    recording, _ = filmed("sensing.renderer=egl", "trees.density=0", duration=0.4)
    with Rerenderer(recording) as again:
        for k, i, m in np.argwhere(recording.visible > 5).tolist():
            assert again.count_whole(k, i, m) == pytest.approx(recording.visible[k, i, m], abs=2)
    write_labelled_images([recording], "coco", tmp_path / "coco", splits={})
    labels = json.loads((tmp_path / "coco" / "annotations" / "instances_train.json").read_text())
    shares = [one["visible_share"] for one in labels["annotations"]]
    assert len(shares) > 5 and min(shares) > 0.7 and max(shares) == 1.0


def test_one_world_at_a_time_has_opengl(started):
    with World(EGL, OPEN, 0), pytest.raises(RuntimeError, match="one world at a time"):
        World(EGL, OPEN, 0)
    World(EGL, OPEN, 0).close()


def test_opengl_is_free_again_after_a_world_that_could_not_be_made(started, monkeypatch, tmp_path):
    with monkeypatch.context() as patch, pytest.raises(pybullet.error):
        patch.setattr("sim.world.bodies.ASSETS", tmp_path)
        World(EGL, OPEN, 0)
    World(EGL, OPEN, 0).close()


def test_large_images_and_mixed_trees_are_refused_and_ideal_sensing_needs_no_renderer(absent):
    large = msgspec.structs.replace(EGL.uavs[0], pixels=1000)
    with pytest.raises(InputError, match=r"uavs.pixels: 1000 is not allowed with 'egl'; expected at most 768"):
        World(msgspec.structs.replace(EGL, uavs=(large,)), OPEN, 0)
    mixed = Forest((Tree(0.0, 0.0, 1.0), Tree(9.0, 0.0, 3.0), Tree(-9.0, 0.0, 3.0)))
    told = r"sensing.renderer: 'egl' draws trees of one size only, not of 2 \(.*\); allowed is tiny"
    with pytest.raises(InputError, match=told):
        World(EGL, mixed, 0)
    with pytest.raises(InputError, match=r"'egl' draws opaque trees only \(trees.leaf_area_density\); allowed is tiny"):
        World(EGL, Forest((Tree(0.0, 0.0, leaf_area_density=0.5),)), 0)
    ideal = msgspec.structs.replace(EGL, sensing=Sensing(mode="ideal", renderer="egl"))
    with World(ideal, OPEN, 1) as world:
        assert not world.opengl


@pytest.fixture
def capsys(capfd):
    """Output of libraries counts as well."""
    return capfd


@pytest.mark.parametrize(
    "arguments",
    [["run", SET, "sensing.renderer=egl"], ["frames", "egl.npz", "--uav", "0", "--time", "1"]],
    ids=["run", "frames"],
)
def test_without_opengl_what_needs_it_is_refused(refused, tmp_path, absent, arguments):
    drawn = msgspec.structs.replace(synthetic.scenario(), sensing=Sensing(renderer="egl"))
    save(record(6, setting=drawn), tmp_path / "egl.npz")
    told = refused(*arguments)
    assert "sensing.renderer: 'egl' cannot start here (" in told and "); allowed is tiny" in told


def test_misses_for_which_the_tracker_is_not_set_are_remarked_on():
    assert find_remarks(load_scenario("forest", ["sensing.miss_probability=0.3"])) == [
        "tracking.detection_probability: 0.99 is far above the 0.7 that sensing.miss_probability means; "
        "misses will end tracks of people"
    ]
    for ready in (
        ["sensing.miss_probability=0.01"],
        ["sensing.miss_probability=0.3", "tracking.detection_probability=0.7"],
    ):
        assert find_remarks(load_scenario("forest", ready)) == []


def test_false_alarms_for_which_the_tracker_is_not_set_are_remarked_on():
    assert find_remarks(load_scenario("forest", ["sensing.false_alarms=1", "tracking.management=m_of_n"])) == [
        "tracking.clutter_density: 1e-06 per m2 is far below the 0.0025 that sensing.false_alarms means; "
        "tracks will follow false alarms",
        'tracking.management: 2 of 3 false alarms make a track; "existence" weighs them against clutter',
    ]
    ready = ["sensing.false_alarms=1", "tracking.clutter_density=0.002"]
    assert find_remarks(load_scenario("forest", ready)) == []
    for duration in ("0.2", "1", "40", "40.6", "3600", "0.6", "100.2"):
        assert find_remarks(load_scenario("forest", [f"duration={duration}", "people.count=7"])) == []


@pytest.mark.parametrize(
    ("changes", "remark"),
    [
        (["duration=0.5"], "duration: 0.5 s is not a multiple of the 0.2 s between scans; the last scan is at 0.4 s"),
        (["tracking.confirm=[3, 4]"], 'tracking.confirm: not used with tracking.management = "existence"'),
        (["sensing.mode=ideal", "sensing.renderer=egl"], 'sensing.renderer: not used with sensing.mode = "ideal"'),
        (["wind.gust_time=2"], "wind.gust_time: not used, as wind.gust is 0"),
        (
            ["sensing.occlusion=disc", "trees.leaf_area_density=0.3"],
            'trees.leaf_area_density: trackers and planners take crowns to be opaque with sensing.occlusion = "disc"',
        ),
    ],
)
def test_settings_that_others_leave_without_effect_are_remarked_on(changes, remark):
    assert find_remarks(load_scenario("forest", changes)) == [remark]
