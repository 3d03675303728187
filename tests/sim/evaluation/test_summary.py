"""The summary counts what a hand-made recording holds."""

import dataclasses
import json

import numpy as np
import pytest
from helpers.summaries import SECONDS, hand_made, shown, summary

from sim.sensing.fault import Fault
from sim.sensing.stopwatch import STAGES
from sim.terminal.results import show_run


def test_the_summary_matches_the_hand_count():
    result = summary(hand_made())
    assert result["ospa"] == {"mean_m": 1.5, "median_m": 0.75, "share_under_1m": 0.5}
    # Shown with a pixel or more: 6 pairs, 4 of them detected; 5 detections, 4 of them people.
    assert result["detection"] == {"recall": pytest.approx(4 / 6), "precision": pytest.approx(4 / 5)}
    assert (result["planner"], result["seed"], result["scenario"]) == ("hover", 7, {"duration": 40.0})
    assert (result["duration_s"], result["interrupted"], result["faults"]) == (0.2, False, [])
    assert result["seconds"] == SECONDS


def test_people_are_held_while_a_track_is_within_a_metre():
    # Person 0: held by both UAVs at scan 0, by none at 1. Person 1: a track at 2 m. Person 2: present at scan 1 only.
    assert summary(hand_made())["people_held"] == [0.5, 0.0, 0.5]
    gone = dataclasses.replace(hand_made(), people=np.full((2, 3, 2), np.nan))
    assert summary(gone)["people_held"] == [None, None, None]


def test_the_real_time_factor_leaves_video_and_start_up_aside():
    assert summary(hand_made())["real_time_factor"] == pytest.approx(0.2 / (14 - 4))
    started = summary(hand_made(), seconds={**SECONDS, "start_up": 5.0})
    assert started["real_time_factor"] == pytest.approx(0.2 / (14 - 4 - 5))
    assert started["seconds"]["start_up"] == 5.0
    assert summary(hand_made(), wall_s=4.0)["real_time_factor"] is None


def test_ideal_sensing_has_no_detection_to_count():
    ideal = dataclasses.replace(
        hand_made(),
        pixels=np.full((5, 2), np.nan),
        visible=np.zeros((2, 2, 3), dtype=int),
        matched=np.zeros((2, 2, 3), dtype=bool),
    )
    assert summary(ideal)["detection"] == {"recall": None, "precision": None}


def test_the_summary_is_strict_json():
    result = summary(hand_made(), faults=[Fault(1.0, 0, "NaN"), Fault(2.0, None, "error")])
    assert result["faults"][0] == {"time": 1.0, "uav": 0, "message": "NaN"}
    assert json.loads(json.dumps(result, allow_nan=False)) == result
    assert list(result["seconds"]) == list(STAGES)


def test_the_table_shows_every_number():
    text = shown(summary(hand_made(), wall_s=4.025))
    pieces = ("hover, seed 7", "1.50 m", "0.75 m", "50.0 %", "66.7 %", "80.0 %", "8.0", *STAGES, "3.00 s")
    for piece in (
        *pieces,
        "GOSPA mean",
        "people held",
        "30.0 %",
        "identity switches",
        "NEES of positions (consistent: 2)",
    ):
        assert piece in text
    assert "interrupted" not in text


def test_the_table_marks_interruption():
    result = summary(dataclasses.replace(hand_made(), interrupted=True))
    text = shown({**result, "detection": {"recall": None, "precision": None}})
    assert "interrupted" in text


def test_what_went_wrong_is_shown_above_the_table_each_once_with_its_place(tmp_path, capsys):
    faults = [Fault(float(t), 0, "[red]NaN", ("mine.py:3, in plan: return x[0]",)) for t in (1, 2)]
    show_run(summary(hand_made(), faults=[*faults, Fault(2.0, None, "gone")]), tmp_path)
    before, _, after = capsys.readouterr().out.partition("┏")
    assert before.splitlines()[:3] == [
        "fault at 1.0 s, 2 times until 2.0 s, UAV 0: [red]NaN",
        "  mine.py:3, in plan: return x[0]",
        "fault at 2.0 s, team: gone",
    ]
    assert "fault" not in after


def test_where_nothing_went_wrong_nothing_is_shown(tmp_path, capsys):
    show_run(summary(hand_made()), tmp_path)
    assert "fault" not in capsys.readouterr().out
