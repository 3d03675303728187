"""PyBullet's OpenGL renderer: it shows what TinyRenderer shows, or is refused with one line."""

import msgspec
import numpy as np
import pytest
from helpers.frames import frame
from helpers.views import CAMERA, SCENARIO

from sim.mission.mission import Mission, Trial
from sim.recording.recording import Recorder
from sim.replay.frames.rerender import Rerenderer
from sim.scenario.errors import InputError
from sim.scenario.perception import Sensing
from sim.scenario.scenario import Scenario, resolved
from sim.sensing.renderer import Renderer
from sim.world.world import World, opengl
from tracking.detection.blob_detector import BlobDetector
from tracking.geometry.camera import Pose
from tracking.geometry.visibility import Forest, Tree

EGL = msgspec.structs.replace(SCENARIO, sensing=Sensing(renderer="egl"))
OPEN = Forest(())


@pytest.fixture
def started():
    """Skips where there is no OpenGL."""
    if opengl.refusal():
        pytest.skip(opengl.refusal())


@pytest.fixture
def absent(monkeypatch):
    """OpenGL cannot start: the plug-in is told to use a device that does not exist."""
    monkeypatch.setenv("EGL_VISIBLE_DEVICES", "99")
    opengl.refusal.cache_clear()
    yield
    opengl.refusal.cache_clear()


def test_opengl_shows_what_tiny_renderer_shows_and_says_nothing(started, capfd):
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
            one, other = (renderer.render(CAMERA, pose) for renderer in renderers)
            differ += np.count_nonzero(one.people != other.people)
            people += np.count_nonzero(one.people >= 0)
            # Trees look otherwise, as OpenGL filters textures and casts shadows.
            found = [BlobDetector().detect(frame(view.image, pose)).ground for view in (one, other)]
            assert found[0] == pytest.approx(found[1], abs=0.1)
        bare = [renderer.render(CAMERA, Pose.level(30.0, 20.0, 19.0)).image for renderer in renderers]
        assert bare[0].tobytes() == bare[1].tobytes()
    assert people > 500
    assert differ < 0.01 * people
    assert capfd.readouterr() == ("", "")


def test_a_mission_flies_on_opengl_and_its_frames_come_out_again_byte_for_byte(started):
    trial = Trial(Scenario(duration=0.6, sensing=Sensing(renderer="egl", noise="camera")), "hover", 1)
    mission, recorder, images = Mission.of(trial), Recorder(), []
    for snapshot in mission.fly():
        recorder.add(snapshot)
        images.append([frame.tobytes() for frame in mission.frames])
    assert any(len(scan.measurements) for scan in snapshot.scans) and mission.faults == []
    recording = recorder.recording(scenario=resolved(trial.scenario), planner="hover", seed=1, forest=mission.forest)
    with Rerenderer(recording) as again:
        assert [[again.image(k, i).tobytes() for i in range(3)] for k in range(4)] == images


def test_one_world_at_a_time_has_opengl(started):
    with World(EGL, OPEN, 0), pytest.raises(RuntimeError, match="one world at a time"):
        World(EGL, OPEN, 0)
    World(EGL, OPEN, 0).close()


def test_images_larger_than_its_window_are_refused():
    large = msgspec.structs.replace(EGL.uavs[0], pixels=1000)
    with pytest.raises(InputError, match=r"uavs.pixels: 1000 is not allowed with 'egl'; expected at most 768"):
        World(msgspec.structs.replace(EGL, uavs=(large,)), OPEN, 0)


def test_ideal_sensing_needs_no_renderer(absent):
    ideal = msgspec.structs.replace(EGL, sensing=Sensing(mode="ideal", renderer="egl"))
    with World(ideal, OPEN, 1) as world:
        assert not world.opengl
