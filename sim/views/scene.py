"""The scene of a mission at one scan: who is drawn, where, in which role, under which name, colour and trouble.

Film, map, page, annotated frames, markers of ROS and Rerun are renderers of scenes: they turn marks into pixels or
messages, and decide nothing about a mission. Places are in metres.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from sim.facts.metrics.holding import ELLIPSE, HOLDS, Holding, list_reports
from sim.facts.planned_path import make_vehicle, predict_path
from sim.facts.sightings import STATES, find_states
from sim.mission.recording import Recording, find_last_frames
from sim.mission.snapshot import Snapshot
from sim.scenario.scenario import Scenario
from sim.views.palette import (
    ALARM,
    CANOPY,
    FAINT,
    INK,
    LOST,
    PANEL,
    TRUNK,
    UNHELD_COLOURS,
    Colour,
    mix,
    track_colour,
    uav_colour,
    uav_dashes,
)
from sim.world.contacts import Contact, describe_body
from tracking.geometry.camera import Camera, Pose, meet_plane
from tracking.geometry.line_of_sight import Raster
from tracking.geometry.visibility import Forest, Solid, at_target_height
from tracking.numerics.arrays import Array, Indices
from tracking.track import Scan, Track

MARGIN = 4.0  # m shown beyond the area
TRAIL = 3.0  # s, length of trails
ALERT = 1.0  # s, time for which a contact is marked
_FEW_PEOPLE, _FEW_UAVS = 12, 6  # more are a crowd
_TURN = np.linspace(0, 2 * np.pi, 48, endpoint=False).tolist()
_CIRCLE = np.array([(np.cos(a), np.sin(a)) for a in _TURN])


class TreeMark(NamedTuple):
    """A part of a tree: a crown, of which maps show the shade and the edge, or a trunk, of which they show a dot."""

    tree: int
    is_crown: bool
    colour: Colour
    solid: Solid


class DetectionMark(NamedTuple):
    """A detection of one camera."""

    place: Array  # (2,) m
    covariance: Array  # (2, 2) m²
    pixel: Array | None  # (2,) in the image; None in ideal sensing


class TrackMark(NamedTuple):
    """A track of one UAV."""

    number: int
    name: str  # with a question mark if the track is not reported
    colour: Colour
    reported: bool
    mean: Array  # (2,) m
    covariance: Array  # (2, 2) m²


class UavMark(NamedTuple):
    """A UAV with what belongs to it; one that has broken down has neither views nor intent."""

    number: int
    name: str
    colour: Colour
    dashes: tuple[int, ...]  # of its lines
    trouble: Colour | None  # if it has broken down
    pose: Pose  # of the body
    camera: Pose
    believed: Pose  # of the camera, as the UAV believes
    view: Array | None  # (N, 2) m, outline of the field of view on the ground; None if it has no bounds nearby
    believed_view: Array | None  # as the UAV believes; the same as `view` if poses are exact
    intent: Array | None  # (H + 1, 2) m, where the plan leads: from the UAV on, at the ends of the steps that are left
    touched: str  # the body that the UAV has just touched, in words; "" for none
    detections: tuple[DetectionMark, ...]
    tracks: tuple[TrackMark, ...]

    @property
    def works(self) -> bool:
        """False if the UAV has broken down."""
        return self.trouble is None

    @property
    def place(self) -> Array:
        """Position (2,) m of the body."""
        return self.pose.position[:2]


class PersonLook(NamedTuple):
    """The look of a person's mark: a disc in a ring if no UAV holds them; hollow if no frame shows whom it should."""

    colour: Colour
    hollow: bool
    trouble: Colour | None  # of the ring


class PersonMark(NamedTuple):
    """A person who is present."""

    number: int
    name: str
    named: Colour | None  # of the name beside the mark; None for no name
    place: Array  # (2,) m
    heading: float  # rad
    hold: str  # one of `HOLDS`
    view: str  # the best in any camera's last frame, one of `STATES`
    look: PersonLook

    @property
    def title(self) -> str:
        """The name, with the state of a person whom no UAV holds."""
        return f"{self.name} {self.hold}" if self.look.trouble else self.name


class Trail(NamedTuple):
    """Where a person or a track was in the last seconds."""

    colour: Colour
    of_track: bool
    number: int  # of the person or the track
    places: Array  # (N, 2) m


class Scene(NamedTuple):
    """All that is drawn of one scan."""

    time: float  # s
    error: float  # m, mean OSPA of the working UAVs, or NaN
    poses_err: bool  # True if UAVs do not know the poses of their cameras
    crowd: bool  # True if people and tracks have names only where there is room
    uavs: tuple[UavMark, ...]
    people: tuple[PersonMark, ...]
    trails: tuple[Trail, ...]  # of people and of the tracks on the map
    detections: tuple[DetectionMark, ...]  # on the map: those of all UAVs if people are unknown
    owner: int | None  # the first UAV that works, whose tracks are on the map
    mapped: Forest | None = None  # what the owner believes of the forest, if UAVs map trees themselves

    @property
    def tracks(self) -> tuple[TrackMark, ...]:
        """The tracks on the map."""
        return () if self.owner is None else self.uavs[self.owner].tracks


class _Past(NamedTuple):
    """What is drawn of an earlier scan."""

    people: Array  # (M, 2) m
    means: dict[int, Array]  # (2,) m, of the tracks on the map, by their numbers
    contacts: tuple[Contact, ...]


class SceneMaker:
    """Makes the scenes of successive snapshots, in flight or of a recording."""

    def __init__(self, scenario: Scenario, numbers: dict[int, int] | None = None, *, labelled: bool = True) -> None:
        """Begin at any scan; numbers: those of tracks by id, by default in the order of their appearance.

        labelled: False if people are unknown.
        """
        self._scenario = scenario
        self._labelled = labelled
        self._views = [scenario.true_camera(i) for i in range(len(scenario.uavs))]
        self._numbers = {} if numbers is None else dict(numbers)
        self._holding: Holding | None = None
        self._past: deque[_Past] = deque(maxlen=round(TRAIL * scenario.rates.sensing))
        self._alert = round(ALERT * scenario.rates.sensing)
        self._states: dict[int, Indices] = {}  # of people in each camera's last frame, indices into `STATES`
        self._before: Array | None = None  # (n, 2) m, places of the UAVs at the previous scan

    def add(self, snapshot: Snapshot, holds: Indices | None = None) -> Scene:
        """The scene of the next snapshot.

        holds (M,): states of people, as indices into `HOLDS`. Without them, they follow from all snapshots so far.
        """
        if holds is None:
            sizes = len(snapshot.people), len(snapshot.poses)
            self._holding = self._holding or Holding(*sizes, self._scenario.loss_distance)
            holds = self._holding.step(snapshot.people, list_reports(snapshot.tracks), len(snapshot.working)).states
        working = snapshot.working
        places = np.array([pose.position[:2] for pose in snapshot.poses])
        before, self._before = places if self._before is None else self._before, places
        tracks = [mark_tracks(held, self._numbers) for held in snapshot.tracks]
        shown = tracks[working[0]] if working else ()
        means = {track.number: track.mean for track in shown}
        self._past.append(_Past(snapshot.people, means, snapshot.contacts))
        uavs = tuple(self._mark_uavs(snapshot, working, tracks, before))
        maps = bool(working) and self._scenario.mapping.forest == "mapped"
        return Scene(
            time=snapshot.time,
            error=snapshot.error,
            poses_err=snapshot.believed is not None,
            crowd=len(snapshot.people) > _FEW_PEOPLE or len(snapshot.poses) > _FEW_UAVS,
            uavs=uavs,
            people=tuple(self._mark_people(snapshot, working, holds)),
            trails=self._list_trails(shown),
            detections=() if self._labelled else tuple(mark for uav in uavs for mark in uav.detections),
            owner=working[0] if working else None,
            mapped=snapshot.scans[working[0]].forest if maps else None,
        )

    def _mark_uavs(
        self, snapshot: Snapshot, working: Sequence[int], tracks: Sequence[tuple[TrackMark, ...]], before: Array
    ) -> Iterator[UavMark]:
        touched = {c.uav: c for old in list(self._past)[-self._alert :] for c in old.contacts}
        for i, pose in enumerate(snapshot.poses):
            works = i in working
            uav = self._scenario.uavs[i]
            camera = snapshot.cameras[i]
            believed = camera if snapshot.believed is None else snapshot.believed[i]
            view = find_footprint(self._scenario, uav.true_camera, camera) if works else None
            exact = not works or (snapshot.believed is None and uav.believed_camera == uav.true_camera)
            yield UavMark(
                number=i,
                name=f"UAV {i}" if works else f"UAV {i}: broken down",
                colour=uav_colour(i) if works else FAINT,
                dashes=uav_dashes(i),
                trouble=None if works else ALARM,
                pose=pose,
                camera=camera,
                believed=believed,
                view=view,
                believed_view=view if exact else find_footprint(self._scenario, uav.believed_camera, believed),
                intent=self._find_intent(snapshot, i, before[i]) if works else None,
                touched=describe_body(touched[i].kind, touched[i].other) if i in touched else "",
                detections=mark_detections(snapshot.scans[i], snapshot.pixels[i]),
                tracks=tracks[i],
            )

    def _mark_people(self, snapshot: Snapshot, working: Sequence[int], holds: Indices) -> Iterator[PersonMark]:
        present = ~np.isnan(snapshot.people[:, 0])
        points = at_target_height(np.nan_to_num(snapshot.people))
        for i in (i for i in working if snapshot.frames_taken[i]):
            inside = self._views[i].sees(snapshot.cameras[i], points) & present
            self._states[i] = find_states(inside, snapshot.visible[i] > 0, snapshot.matched[i])
        none = np.full(len(present), STATES.index("out of view"))
        best = np.max([none, *(self._states[i] for i in working if i in self._states)], axis=0)
        for m in np.flatnonzero(present).tolist():
            view, hold = STATES[best[m]], HOLDS[holds[m]]
            named = {"lost": LOST, "not found yet": INK}.get(hold)
            where = snapshot.people[m], float(snapshot.headings[m])
            yield PersonMark(m, f"person {m}", named, *where, hold, view, find_person_look(view, hold))

    def _list_trails(self, shown: Sequence[TrackMark]) -> tuple[Trail, ...]:
        people = np.array([old.people for old in self._past]).transpose(1, 0, 2)
        grey = mix(INK, PANEL, 0.45)
        trails = [Trail(grey, False, m, places[~np.isnan(places[:, 0])]) for m, places in enumerate(people)]
        for track in shown:
            means = [old.means[track.number] for old in self._past if track.number in old.means]
            trails.append(Trail(mix(track.colour, PANEL, 0.7), True, track.number, np.array(means)))
        return tuple(trails)

    def _find_intent(self, snapshot: Snapshot, uav: int, before: Array) -> Array | None:
        if snapshot.flown is None:
            return None
        pose = snapshot.poses[uav]
        vehicle = make_vehicle(self._scenario, uav, pose, pose.position[:2], before)
        path = predict_path(self._scenario, vehicle, snapshot.flown, snapshot.time)
        step = self._scenario.rates.plan_scans
        return np.vstack([path[:1], path[(len(path) - 1) % step or step :: step]])


def make_scenes(recording: Recording, holds: Indices) -> Iterator[Scene]:
    """The scenes of all scans of a recording; holds (K, M): states of people, as indices into `HOLDS`."""
    maker = SceneMaker(recording.setting, recording.track_numbers, labelled=recording.labelled)
    for k, row in enumerate(holds):
        yield maker.add(recording.snapshot(k), row)


def make_scene(recording: Recording, k: int, holds: Indices) -> Scene:
    """The scene of scan k of a recording; holds (M,): states of people, as indices into `HOLDS`."""
    setting = recording.setting
    maker = SceneMaker(setting, recording.track_numbers, labelled=recording.labelled)
    # Trails, contacts and the cameras' last frames depend on the past from this scan on.
    last = find_last_frames(recording.frames_taken)[k, recording.working[k]]
    first = min([max(k - round(TRAIL * setting.rates.sensing), 0), *last.tolist()])
    for earlier in range(first, k):
        maker.add(recording.snapshot(earlier), holds)
    return maker.add(recording.snapshot(k), holds)


def mark_trees(forest: Forest) -> tuple[TreeMark, ...]:
    """The marks of all parts of trees, in the order in which maps draw them."""
    solids = zip(forest.tree_of_solids.tolist(), forest.solids, strict=True)
    marks = [TreeMark(tree, s.part != "trunk", TRUNK if s.part == "trunk" else CANOPY, s) for tree, s in solids]
    return tuple(sorted(marks, key=lambda mark: not mark.is_crown))


def outline_mistaken_crowns(forest: Forest, believed: Forest | None) -> list[Array]:
    """Outlines (64, 2) m from above of the crowns of a believed map that are not so in the true forest."""
    true, turn = set(forest.trees), np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    mistaken = [tree for tree in (believed.trees if believed else ()) if tree not in true]
    return [np.array([tree.x, tree.y]) + tree.canopy_radius * circle for tree in mistaken]


def list_unseen_ground(believed: Forest) -> Array:
    """Strips of ground (N, 4) m that a UAV has not seen yet: west, south, east and north, whole rows of its raster."""
    if not isinstance(believed.unknown, Raster):
        return np.zeros((0, 4))
    (west, south), (width, height) = believed.unknown.low, believed.unknown.cell
    unseen = np.pad(believed.unknown.values > 0.0, ((0, 0), (1, 1))).astype(np.int8)
    rows, first = np.nonzero(np.diff(unseen) == 1)
    last = np.nonzero(np.diff(unseen) == -1)[1]
    return np.column_stack(
        [west + width * first, south + height * rows, west + width * last, south + height * (rows + 1)]
    )


def mark_tracks(held: Sequence[Track], numbers: dict[int, int]) -> tuple[TrackMark, ...]:
    """The marks of tracks; numbers: those of all tracks so far by id, to which new ones are added."""
    return tuple([mark_track(track, numbers.setdefault(track.id, len(numbers))) for track in held])


def mark_track(track: Track, number: int) -> TrackMark:
    """The mark of a track with this number."""
    belief, reported = track.belief, track.reported
    name = str(number) if reported else f"{number}?"
    return TrackMark(number, name, track_colour(number), reported, belief.mean[:2], belief.covariance[:2, :2])


def mark_detections(scan: Scan, pixels: Array) -> tuple[DetectionMark, ...]:
    """The marks of the detections of a scan at pixels (N, 2), which are none in ideal sensing."""
    found = zip(scan.measurements, scan.covariances, strict=True)
    return tuple(DetectionMark(z, R, pixels[n] if n < len(pixels) else None) for n, (z, R) in enumerate(found))


def find_person_look(view: str, hold: str) -> PersonLook:
    """The look of a person; view: one of `STATES`; hold: one of `HOLDS`."""
    return PersonLook(FAINT if view == "out of view" else INK, view == "hidden", UNHELD_COLOURS.get(hold))


# The looks of people in legends, by what they mean.
PEOPLE_LOOKS = {
    "person": find_person_look("seen", "held"),
    "hidden": find_person_look("hidden", "held"),
    "out of view": find_person_look("out of view", "held"),
    **{hold: find_person_look("seen", hold) for hold in UNHELD_COLOURS},
}


def measure_map(scenario: Scenario) -> tuple[float, float]:
    """Width and height of the map [m] with its margin."""
    return scenario.area.width + 2 * MARGIN, scenario.area.height + 2 * MARGIN


def outline_ellipse(mean: Array, covariance: Array) -> Array:
    """Points (..., 48, 2) m on the 95 % ellipses of planar Gaussians.

    mean (..., 2) m, covariance (..., 2, 2) m².
    """
    half, axes = find_half_axes(covariance)
    return np.asarray(mean[..., None, :] + (_CIRCLE * half[..., None, :]) @ np.swapaxes(axes, -1, -2))


def find_half_axes(covariance: Array) -> tuple[Array, Array]:
    """Half axes (..., 2) m of 95 % ellipses, ascending, and their directions, the columns of (..., 2, 2)."""
    variances, axes = np.linalg.eigh(covariance)
    return ELLIPSE * np.sqrt(np.maximum(variances, 0.0)), axes


def find_footprint(scenario: Scenario, camera: Camera, pose: Pose) -> Array | None:
    """Outline (N, 2) m of a camera's field of view on the ground; None if it has no bounds nearby."""
    if scenario.sensing.field_of_view == "unlimited":
        return None
    rays = camera.rays(pose, camera.outline)
    return meet_plane(pose, rays) if _point_down(rays) else None


def looks_down(camera: Camera, pose: Pose, pixels: Array | None = None) -> bool:
    """True if the rays through pixels (N, 2), by default the image's outline, meet the ground nearby."""
    return _point_down(camera.rays(pose, camera.outline if pixels is None else pixels))


def _point_down(rays: Array) -> bool:
    return bool(np.all(rays[:, 2] < -0.1))
