"""The rules by which tracks begin, end and are joined: each has a test that fails without it."""

import ast
from pathlib import Path

import pytest

TESTS = Path(__file__).parents[1]
# Which tracks of two UAVs or of two parts of a fleet are of one person, and which id it has.
JOINING = [
    (
        "join two tracks only if one person is likelier than two",
        "test_tracks_are_of_one_person_if_that_is_likelier_than_two_people",
    ),
    ("the latest sighting decides where the person is", "test_the_last_detection_decides_on_a_person_lost_by_all"),
    (
        "an unseen person may have turned; a common id counts; two tracks last detected by one UAV are never joined",
        "test_where_two_partitions_meet_each_person_has_one_track",
    ),
    ("one assignment of all tracks of a UAV", "test_pairs_match_together_where_velocities_agree"),
    ("tracks begun in this scan come last", "test_a_person_found_again_in_the_scan_of_healing_has_one_track"),
    ("the latest version of a track is compared", "test_a_track_is_joined_by_its_latest_version_in_a_partition"),
    ("the smallest id stays", "test_lone_and_complete_fleets_agree_at_once_on_the_smaller_id"),
    (
        "the partition with the smaller UAV keeps a contested id",
        "test_two_people_of_one_id_become_two_when_the_halves_meet",
    ),
    (
        "a new id is the same on all UAVs of a partition",
        "test_a_fresh_id_does_not_depend_on_which_partitions_a_uav_hears",
    ),
    ("a new id is one that no track has", "test_a_new_id_of_a_contested_track_is_not_one_that_another_track_has"),
    ("a track with a new id is no new track", "test_a_relabelled_track_does_not_take_a_hidden_persons_track"),
    (
        "a track out of sight ends if its id was seen later, within reach",
        "test_a_lost_track_is_deleted_if_its_id_is_seen_elsewhere",
    ),
    (
        "a track that was seen last does not end",
        "test_a_person_in_view_is_kept_though_a_third_partition_lost_the_track",
    ),
    (
        "a track does not end if one of its sightings is out of reach",
        "test_a_lost_track_ends_only_within_reach_of_all_its_sightings",
    ),
    ("a track does not end if it has another id as well", "test_all_pairs_of_two_partitions_are_weighed_together"),
    (
        "a deleted track stays deleted, unless detected later elsewhere",
        "test_a_deleted_track_comes_back_only_if_it_was_detected_later_elsewhere",
    ),
    ("of two deletions the later counts", "test_of_two_deletions_of_a_track_the_later_one_counts"),
    (
        "the smallest UAV heard within a second leads a partition",
        "test_a_partition_has_the_name_of_its_smallest_uav_heard_within_a_second",
    ),
]
# Which tracks of one UAV begin, end and go on.
MANAGEMENT = [
    ("a measurement that a confirmed track explains starts none", "test_a_person_with_a_track_gets_no_second_one"),
    (
        "a tentative track ends after a second without a measurement",
        "test_a_tentative_track_ends_after_a_second_without_a_measurement",
    ),
    ("a tentative track ends after misses in plain view", "test_a_tentative_track_ends_after_two_misses_in_plain_view"),
    ("only a person who should have been seen is missed", "test_only_scans_that_should_have_shown_the_person_count"),
    ("one of two competing tracks has the hit", "test_a_measurement_is_a_hit_of_one_track"),
    (
        "tracks of one person are near and add up to less than 1.5",
        "test_pairs_that_share_a_person_are_near_and_add_up_to_one",
    ),
    ("both were detected within a second", "test_two_people_under_one_canopy_stay_two"),
    (
        "one takes the sum, and the older id if it is new",
        "test_the_likelier_of_two_tracks_takes_the_older_id_only_if_it_is_new",
    ),
    ("a track is new for a second", "test_a_track_takes_an_older_id_up_to_a_second_after_its_first_scan"),
    ("a track that ends is not joined to another", "test_a_track_that_ends_takes_no_other_track_of_its_person_along"),
    ("a new track takes a lost one's id within reach", "test_tracks_in_reach_are_reacquired_unless_vague"),
    ("a lost track was sighted before, but not just now", "test_people_never_sighted_or_just_now_are_not_lost"),
]


@pytest.fixture(scope="module")
def tests():
    """Names of all tests of the tracker and of missions."""
    paths = [path for package in ("tracking", "sim") for path in (TESTS / package).rglob("test_*.py")]
    nodes = [node for path in paths for node in ast.parse(path.read_text(encoding="utf-8")).body]
    return [node.name for node in nodes if isinstance(node, ast.FunctionDef)]


@pytest.mark.parametrize(("rule", "name"), [*JOINING, *MANAGEMENT])
def test_a_rule_has_one_test(rule, name, tests):
    assert tests.count(name) == 1
