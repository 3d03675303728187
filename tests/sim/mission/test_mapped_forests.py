"""UAVs that map the trees in their own frames, and know of no other."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.flights import fly, recording_of
from helpers.rerun_files import tables

from sim.exchange.export import export
from sim.facts.flight import Flight
from sim.facts.metrics.catalogue import METRICS
from sim.facts.metrics.mapping_score import compare_maps, tell_unmapped
from sim.facts.metrics.trees_met import find_trees_met
from sim.scenario.loading import load_scenario
from sim.views.drawing.map_view import MapView
from sim.views.frames.annotation import annotate
from sim.views.frames.frame_facts import make_frame_facts
from sim.views.page.data import make_page_data
from sim.views.scene import list_unseen_ground, make_scene
from tracking.errors import InputError
from tracking.geometry.camera import Pose
from tracking.geometry.line_of_sight import value_at
from tracking.geometry.visibility import Tree

UNSEEN = Tree(60.0, -40.0)
TURN = np.column_stack([np.cos(np.linspace(0, 6, 100)), np.sin(np.linspace(0, 6, 100))])
STEMS = [(-22.0, -12.0), (-10.0, 8.0), (-24.0, 6.0), (-12.0, -8.0), (0.0, 0.0), (2.0, 14.0)]


def fly_mapping(path, trees, *overrides, duration=8):
    lines = ["x,y,canopy_radius,canopy_base,canopy_top,trunk_radius"]
    lines += [f"{tree.x},{tree.y},{tree.canopy_radius},{tree.canopy_base},{tree.canopy_top},0.2" for tree in trees]
    path.write_text("\n".join(lines))
    mapped = "trees.file=" + str(path), "mapping.forest=mapped"
    mission, snapshots = fly(*mapped, *overrides, planner="sma-nbo-gospa", seed=3, duration=duration)
    return mission, recording_of(mission, snapshots, seed=3)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    trees = [Tree(x, y, 4.0) for x, y in STEMS]
    return [fly_mapping(tmp_path_factory.mktemp("stems") / "stems.csv", known) for known in (trees, [*trees, UNSEEN])]


def test_a_tree_that_no_camera_has_seen_changes_no_belief_plan_or_message(flown):
    (_, one), (_, other) = flown
    assert len(other.trees) == len(one.trees) + 1
    for name in (
        "maps",
        "map_sizes",
        "map_trees",
        "map_unknown",
        "track_means",
        "track_covariances",
        "plans",
        "bytes_sent",
        "map_bytes",
    ):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def test_uavs_begin_without_trees_and_find_those_that_they_fly_over(flown):
    mission, recording = flown[0]
    last = len(recording.times) - 1
    assert all(recording.believed_at(0, uav).trees == () for uav in range(3))
    found = [tree for uav in range(3) for tree in recording.believed_at(last, uav).trees]
    assert len(found) >= 3
    for tree in found:
        nearest = min(mission.forest.trees, key=lambda true: np.hypot(true.x - tree.x, true.y - tree.y))
        assert np.hypot(nearest.x - tree.x, nearest.y - tree.y) < 1.5
    assert len({recording.maps[last, uav] for uav in range(3)}) == 3  # each has a map of its own


def test_ground_that_is_not_yet_seen_may_have_trees_and_open_ground_has_none(flown):
    mission, _ = flown[0]
    person = np.array([[60.0, -36.0, 0.85]])
    for uav, start in enumerate(mission.scenario.uavs):
        believed, lens = mission.beliefs.believed(uav), start.true_camera.lens(Pose.level(60.0, -40.0, 18.0))
        assert 0.3 < np.mean(believed.unknown.values > 0.0) < 0.99
        assert 0.3 < believed.detectabilities(lens, person)[0] < 0.95
        assert value_at(believed.unknown, *start.start) == 0.0


def test_maps_show_what_the_uav_of_the_tracks_has_mapped_and_not_seen(flown):
    mission, recording = flown[0]
    last = len(recording.times) - 1
    scene = make_scene(recording, last, np.zeros(recording.person_count, dtype=np.int64))
    believed = mission.beliefs.believed(0)
    assert scene.owner == 0 and scene.mapped.trees == believed.trees
    strips, (rows, columns) = list_unseen_ground(scene.mapped), np.nonzero(believed.unknown.values >= 0.0)
    centres = believed.unknown.low + believed.unknown.cell * np.column_stack([columns + 0.5, rows + 0.5])
    inside = np.all((strips[:, None, :2] < centres) & (centres < strips[:, None, 2:]), axis=2)
    np.testing.assert_array_equal(inside.sum(axis=0), believed.unknown.values[rows, columns] > 0.0)
    view = MapView(mission.scenario, recording.forest, (800, 560))
    drawn, plain = view.draw(scene)[0].astype(int), view.draw(scene._replace(mapped=None))[0].astype(int)
    unseen, seen = (view.pixels(place).astype(int) for place in ((60.0, -38.3), mission.scenario.uavs[0].start))
    assert (drawn - plain)[unseen[1], unseen[0]].max() < 0
    assert (drawn == plain)[seen[1], seen[0]].all()
    tree = believed.trees[0]
    around = view.pixels((tree.x, tree.y)) + tree.canopy_radius * view.scale * TURN
    assert (drawn != plain)[around[:, 1].astype(int), around[:, 0].astype(int)].any(axis=1).mean() > 0.3


def test_the_page_has_the_map_of_each_uav_at_each_scan(flown):
    _, recording = flown[0]
    maps = make_page_data(Flight(recording), None)["maps"]
    assert len(maps["believed"]) == recording.scan_count
    assert len(maps["made"]) == len({*recording.maps.ravel().tolist()})
    for k, uav in ((0, 0), (recording.scan_count - 1, 2)):
        believed = recording.believed_at(k, uav)
        crowns, strips = (
            np.reshape(part, (-1, n)) for part, n in zip(maps["made"][maps["believed"][k][uav]], (3, 4), strict=True)
        )
        expected = [(tree.x, tree.y, tree.canopy_radius) for tree in believed.trees]
        np.testing.assert_allclose(crowns, np.reshape(expected, (-1, 3)), atol=0.005)
        area = (strips[:, 2] - strips[:, 0]) * (strips[:, 3] - strips[:, 1])
        cell = np.prod(believed.unknown.cell)
        assert area.sum() == pytest.approx(cell * np.count_nonzero(believed.unknown.values), rel=0.01)


def test_a_frame_outlines_the_crowns_on_the_map_of_its_uav_and_no_other(flown):
    _, recording = flown[0]
    last = recording.scan_count - 1
    sight = make_frame_facts(recording, last, 1)
    assert sight.mapped.trees == recording.believed_at(last, 1).trees
    frame = np.full((128, 128, 3), 90, np.uint8)
    (drawn, names), (plain, others) = (
        annotate(frame, s, 1024) for s in (sight, dataclasses.replace(sight, mapped=None))
    )
    assert names - others == {"crown on the UAV's map"}
    changed = np.any(drawn != plain, axis=2)
    near = np.zeros_like(changed)
    for tree in sight.mapped.trees:
        rim = (tree.x, tree.y) + tree.canopy_radius * TURN
        for height in (tree.canopy_base, tree.canopy_top):
            pixels = 8 * sight.camera.project(sight.pose, np.column_stack([rim, np.full(len(rim), height)]))[0]
            for u, v in pixels[np.all((pixels > 0) & (pixels < 1024), axis=1)].astype(int):
                near[max(v - 60, 0) : v + 60, max(u - 60, 0) : u + 60] = True
    assert changed.sum() > 500 and not (changed & ~near).any()


def test_rerun_and_the_bag_have_the_map_of_each_uav_whenever_it_changes(flown, tmp_path):
    pytest.importorskip("rerun")
    pytest.importorskip("rosbags")
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory
    from rerun.chunk import RrdReader

    from sim.views import rerun_viewer

    _, recording = flown[0]
    rerun_viewer.write(Flight(recording), tmp_path / "a.rrd", progress=lambda k: None)
    entities = tables(RrdReader(tmp_path / "a.rrd").stream())
    export(recording, "rosbag", tmp_path / "out")
    layout = json.loads((tmp_path / "out" / "foxglove.json").read_text())
    assert layout["configById"]["3D!scene"]["topics"]["/uav0/forest"] == {"visible": True}
    markers = {uav: [] for uav in range(3)}
    with (tmp_path / "out" / "bag" / "bag.mcap").open("rb") as file:
        topics = [f"/uav{uav}/forest" for uav in markers]
        for _, channel, _, decoded in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages(
            topics
        ):
            markers[topics.index(channel.topic)].append(decoded.markers)
    for uav, sent in markers.items():
        scans = np.flatnonzero(recording.new_maps[:, uav])
        logged = [row["centers"] for row in entities[f"/world/maps/{uav}/crowns"]]
        assert len(sent) == len(logged) == len(scans) > 3
        for k, content, places in zip(scans, sent, logged, strict=True):
            believed = recording.believed_at(k, uav)
            expected = np.reshape([(t.x, t.y, (t.canopy_base + t.canopy_top) / 2) for t in believed.trees], (-1, 3))
            crowns = [m.pose.position for m in content if m.ns == "mapped"]
            np.testing.assert_allclose(np.reshape([(p.x, p.y, p.z) for p in crowns], (-1, 3)), expected)
            np.testing.assert_allclose(np.reshape(places or [], (-1, 3)), expected, rtol=1e-5)
            ground = sum(m.scale.x * m.scale.y for m in content if m.ns == "unseen")
            assert ground == pytest.approx(np.prod(believed.unknown.cell) * np.count_nonzero(believed.unknown.values))


def test_trees_that_a_uav_has_from_others_are_told_when_it_meets_them(flown):
    _, recording = flown[0]
    expected = {}
    for uav in range(3):
        camera = recording.setting.uavs[uav].true_camera
        for tree, (x, y) in enumerate(STEMS):
            rims = [np.column_stack([(x, y) + 4.0 * TURN, np.full(100, z)]) for z in recording.trees[tree, 3:5]]
            known = None
            for k, time in enumerate(recording.times):
                near = any(np.hypot(t.x - x, t.y - y) < 4.0 for t in recording.believed_at(k, uav).trees)
                known = (time if known is None else known) if near else None
                pixels, depths = camera.project(recording.camera_at(k, uav), np.vstack(rims))
                if np.any(np.all((pixels > 0) & (pixels < camera.size), axis=1) & (depths > 0)):
                    expected[uav, tree] = (k, None if known is None else round(float(time - known), 6))
                    break
    met = find_trees_met(recording)
    found = {(m.uav, m.tree): (m.scan, None if np.isnan(m.ahead) else round(m.ahead, 6)) for m in met}
    assert found.keys() == expected.keys()
    assert sum(found[pair] == expected[pair] for pair in found) >= len(found) - 1  # rims of 16 and of 100 points
    told = [event for event in Flight(recording).events if event.kind == "tree met"]
    ahead = [m for m in met if not np.isnan(m.ahead)]
    assert sorted((e.first, *e.uavs) for e in told) == sorted((m.scan, m.uav) for m in ahead)
    assert METRICS["map.known_ahead"](SimpleNamespace(recording=recording)) == pytest.approx(len(ahead) / len(met))
    assert len(ahead) > 0
    alone = dataclasses.replace(recording, map_bytes=None)
    assert find_trees_met(alone) == [] and METRICS["map.known_ahead"](SimpleNamespace(recording=alone)) is None
    assert METRICS["network.maps.bytes_total"](SimpleNamespace(recording=alone)) is None
    assert METRICS["network.maps.bytes_total"](SimpleNamespace(recording=recording)) == recording.map_bytes.sum()


ODD = {
    "hover": ("hover", []),
    "one UAV": ("greedy", ["fleet.size=1"]),
    "lens": ("greedy", ["uavs.*.camera=thermal-640", "uavs.*.camera.scale=0.25"]),
    "body-fixed in wind": ("greedy", ["wind.velocity=[6, 0]", "uavs.*.mount=body", "uavs.*.tilt_deg=15"]),
    "2.5 Hz": ("greedy", ["uavs.*.rate=2.5"]),
    "crowns of 1 m": ("greedy", ["trees.canopy_radius=1"]),
    "no trees": ("greedy", ["trees.density=0"]),
    "a grove wall to wall": ("greedy", ["trees.density=400", "trees.overlap=true"]),
    "porous": ("greedy", ["trees.leaf_area_density=1"]),
}


@pytest.mark.parametrize("case", ODD)
def test_odd_flights_map_what_they_can_and_say_what_they_cannot(case):
    planner, settings = ODD[case]
    mission, snapshots = fly("mapping.forest=mapped", *settings, planner=planner, seed=1, duration=8)
    recording = recording_of(mission, snapshots, seed=1)
    score, told = compare_maps(recording), tell_unmapped(recording)
    assert score.mapped - len(score.distances) <= max(1, 0.1 * score.mapped) and recording.all_faults == ()
    if case == "hover":
        assert told == "UAVs 0, 1 and 2: no ground or tree mapped; a camera that hardly moves has no parallax."
        assert score.mapped == score.seen == 0
    else:
        assert told == ""
        assert case in ("no trees", "a grove wall to wall") or score.found >= 0.5 * score.seen > 0


def test_a_table_tells_how_good_each_map_was(flown):
    _, recording = flown[0]
    table = Flight(recording).columns("maps")
    assert table["time_s"].tolist() == sorted(table["time_s"]) and table["trees_mapped"][:3].tolist() == [0, 0, 0]
    for uav in range(3):
        rows = table["uav"] == uav
        assert rows.sum() == len(np.unique(recording.maps[:, uav]))
        believed = recording.believed_at(recording.scan_count - 1, uav)
        assert table["trees_mapped"][rows][-1] == len(believed.trees)
        gaps = sorted(min(np.hypot(tree.x - x, tree.y - y) for x, y in STEMS) for tree in believed.trees)
        gaps = gaps[: table["trees_true"][rows][-1]]  # without those that are none
        assert len(gaps) >= len(believed.trees) - 1
        assert table["error_m"][rows][-1] == pytest.approx(np.sqrt(np.mean(np.square(gaps))))


@pytest.mark.parametrize(
    ("overrides", "line"),
    [
        (["mapping.forest=mapped", "sensing.mode=ideal"], 'mapping.forest: "mapped" needs images'),
        (["mapping.forest=none", "believed.tree_shift=1"], 'allowed with mapping.forest "known" only'),
        (["mapping.forest=maped"], "mapping.forest"),
        (["mapping.share=false"], 'mapping.share: false is allowed with mapping.forest "mapped" only'),
    ],
)
def test_maps_that_cannot_be_made_are_refused_in_one_line(overrides, line):
    with pytest.raises(InputError) as error:
        load_scenario("forest", overrides)
    assert line in str(error.value) and "\n" not in str(error.value)
