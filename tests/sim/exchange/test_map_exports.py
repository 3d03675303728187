"""A mission on the map: layers for maps, and files with coordinates and subtitles that give its tracks again."""

import json
import re

import av
import numpy as np
import pytest
from helpers.flights import recorded
from helpers.made_logs import write_srt_flight

from sim.exchange.export import export
from sim.exchange.scanned_flight import read_flight
from sim.exchange.tracked_flight import track_flight
from sim.facts.flight import Flight
from sim.facts.rerender import Rerenderer
from tracking.errors import InputError

SETTINGS = ("tracking.initial_tracks=none", "geo.origin=[48.1374,11.5755]", "uavs.0.rate=2.5", "uavs.1.mount=body")


@pytest.fixture(scope="module")
def mission():
    return recorded("sensing.mode=ideal", *SETTINGS, duration=6)


def test_a_mission_with_coordinates_and_logs_has_its_tracks_within_the_digits_of_the_logs(mission, tmp_path):
    write_srt_flight(mission, tmp_path / "out")
    (tmp_path / "out" / "tracks.csv").unlink()
    names = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert "poses.csv" not in names and "uav2.srt" in names
    for name in ("detections", "trees", "truth"):
        assert "latitude,longitude" in (tmp_path / "out" / f"{name}.csv").read_text()
    again = track_flight(read_flight(tmp_path / "out")).recording
    compare_layers(mission, again, tmp_path)
    assert len(mission.track_ids) > 100
    np.testing.assert_array_equal(again.track_ids, mission.track_ids)
    np.testing.assert_allclose(again.track_means, mission.track_means, atol=1e-4)
    np.testing.assert_allclose(again.people, mission.people, atol=2e-6)
    taken = mission.frames_taken
    np.testing.assert_allclose(again.believed_cameras[taken][:, :3], mission.believed_cameras[taken][:, :3], atol=3e-4)
    assert again.setting.geo == mission.setting.geo


def compare_layers(one, other, folder):
    """That layers of the tracks of two recordings differ by less than the digits of logs, 0.1 mm or 1e-9 deg."""
    layers = []
    for name, recording in (("one", one), ("other", other)):
        export(recording, "geojson", folder / name)
        layers.append(json.loads((folder / name / "tracks.geojson").read_text())["features"])
    assert [feature["properties"] for feature in layers[0]] == [feature["properties"] for feature in layers[1]]
    places = [[feature["geometry"]["coordinates"] for feature in layer] for layer in layers]
    for mine, again in zip(*places, strict=True):
        np.testing.assert_allclose(again, mine, atol=3e-9)


def test_stems_as_geojson_in_degrees_give_the_tracks_of_the_mission(mission, tmp_path):
    export(mission, "csv", tmp_path / "out")
    (tmp_path / "out" / "trees.csv").unlink()
    places = mission.setting.geo.find_degrees(mission.trees[:, :2])[:, ::-1].tolist()
    names = ("crown_radius", "crown_base", "height", "trunk_radius")
    features = [
        {"geometry": {"type": "Point", "coordinates": place}, "properties": dict(zip(names, row, strict=True))}
        for place, row in zip(places, mission.trees[:, 2:6].tolist(), strict=True)
    ]
    (tmp_path / "out" / "trees.geojson").write_text(json.dumps({"features": features}))
    flight = read_flight(tmp_path / "out")
    np.testing.assert_allclose(flight.forest.table[:, :6], mission.trees[:, :6], atol=2e-6)
    np.testing.assert_allclose(track_flight(flight).recording.track_means, mission.track_means, atol=1e-4)


def test_layers_have_tracks_people_uavs_and_losses_where_the_recording_has_them(mission, tmp_path):
    export(mission, "geojson", tmp_path / "out")
    layers = {path.stem: json.loads(path.read_text())["features"] for path in (tmp_path / "out").iterdir()}
    assert {*layers} == {"tracks", "people", "uavs", "losses"}

    def place(feature, time):
        n = feature["properties"]["times_s"].index(time)
        longitude, latitude = np.reshape(feature["geometry"]["coordinates"], (-1, 2))[n]
        return mission.setting.geo.find_metres(np.array([latitude]), np.array([longitude]))[0]

    assert [feature["properties"]["uav"] for feature in layers["uavs"]] == [0, 1, 2]
    for k, time in enumerate(mission.times.tolist()):
        for i in range(3):
            np.testing.assert_allclose(place(layers["uavs"][i], time), mission.believed_cameras[k, i, :2], atol=2e-4)
        for m in range(4):
            np.testing.assert_allclose(place(layers["people"][m], time), mission.people[k, m], atol=2e-4)
    reported = mission.reported
    points = sum(len(feature["properties"]["times_s"]) for feature in layers["tracks"])
    assert points == reported.sum() > 50
    losses = Flight(mission).columns("losses")
    assert [f["properties"]["person"] for f in layers["losses"]] == losses["person"].tolist() != []
    assert {f["geometry"]["type"] for f in layers["losses"]} == {"Point"}


def test_a_recording_that_is_nowhere_on_the_map_says_what_it_lacks(tmp_path):
    with pytest.raises(InputError, match=r"--to: geojson needs a place on the map.*--set geo\.origin="):
        export(recorded("sensing.mode=ideal", duration=1), "geojson", tmp_path / "out")


def test_layers_end_where_a_uav_breaks_down_and_may_be_empty(tmp_path):
    mission = recorded("sensing.mode=ideal", *SETTINGS[:2], "people.count=0", "uavs.1.fails_at=1.1", duration=2)
    export(mission, "geojson", tmp_path / "out")
    uavs, people, tracks, losses = (
        json.loads((tmp_path / "out" / f"{name}.geojson").read_text())["features"]
        for name in ("uavs", "people", "tracks", "losses")
    )
    assert [feature["properties"]["until_s"] for feature in uavs] == [2.0, 1.0, 2.0]
    assert people == tracks == losses == []


UAV = "uavs=[{start=[-28,0],footprint=24,pixels=256}]"


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """A mission of one UAV, and its flight as a log and a video of its frames."""
    mission = recorded(*SETTINGS[:2], UAV, "sensing.noise=camera", duration=5)
    folder = tmp_path_factory.mktemp("filmed") / "flight"
    write_srt_flight(mission, folder)
    for name in ("detections.csv", "tracks.csv", "truth.csv"):
        (folder / name).unlink()
    with av.open(str(folder / "uav0.MP4"), "w", format="mp4") as video, Rerenderer(mission) as again:
        stream = video.add_stream("libx264", rate=5, options={"qp": "0"})
        stream.width = stream.height = 256
        stream.pix_fmt = "yuv444p"
        for k in range(len(mission.times)):
            image = again.image(k, 0)
            video.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")))
        video.mux(stream.encode())
    return mission, folder


def test_a_log_with_a_video_is_a_flight_in_which_people_are_found(filmed):
    mission, folder = filmed
    flight = read_flight(folder)
    assert flight.frames.all() and len(flight.frames) == len(mission.times)
    for k in range(len(mission.times)):
        seen, again = mission.scan_at(k, 0).measurements, flight.observed[k, 0].scan.measurements
        assert len(seen) == len(again)
        np.testing.assert_allclose(np.sort(again, axis=0), np.sort(seen, axis=0), atol=0.1)
    assert any(re.search(r"26 frames, 5 in a second, are used", remark) for remark in flight.remarks)


def test_a_video_of_another_length_is_one_line_unless_an_offset_is_given(filmed, tmp_path):
    _, folder = filmed
    for path in folder.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    blocks = (folder / "uav0.srt").read_text().split("\n\n")
    (tmp_path / "uav0.srt").write_text("\n\n".join(blocks[:16]) + "\n\n")
    told = r"uav0\.MP4: lasts 5\.2 s, but uav0\.srt tells of 3\.2 s; if they belong together, pose_offset_s in cameras"
    with pytest.raises(InputError, match=told):
        read_flight(tmp_path)
    header, row = (folder / "cameras.csv").read_text().split()
    (tmp_path / "cameras.csv").write_text(f"{header},pose_offset_s\n{row},2\n")
    poses = read_flight(tmp_path).poses
    np.testing.assert_allclose(poses[10:, 0, :2], read_flight(folder).poses[:16, 0, :2], atol=1e-9)


def test_without_cameras_the_focal_length_of_the_log_counts_and_is_said(filmed, tmp_path):
    _, folder = filmed
    for name in ("uav0.MP4", "trees.csv", "scenario.toml"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    with pytest.raises(InputError, match=r"cameras\.csv is missing, and uav0\.srt tells no focal length"):
        (tmp_path / "uav0.srt").write_text((folder / "uav0.srt").read_text())
        read_flight(tmp_path)
    text = (folder / "uav0.srt").read_text().replace("[rel_alt", "[focal_len: 24.00] [rel_alt")
    (tmp_path / "uav0.srt").write_text(text)
    flight = read_flight(tmp_path)
    assert flight.setting.uavs[0].fov_deg == pytest.approx(2 * np.degrees(np.arctan(34.6 / 2 / 24)), abs=0.01)
    assert any("UAV 0 sees 71.6 deg across, by 24 mm in uav0.srt" in remark for remark in flight.remarks)
