"""Output of detectors and sensor modes from outside passes as arrays of one kind, or is refused in one line."""

import numpy as np
import pytest

from sim.sensing.sensor_mode import SensorOutput
from sim.sensing.sensor_output_check import check_detections, check_output
from tracking.detection.detector import Detections

PEOPLE = np.array([[1.0, 2.0], [np.nan, np.nan], [3.0, 4.0]])


def test_check_detections_pass_as_floats_and_none_as_an_empty_list():
    found = check_detections(Detections([[1, 2]], [[3, 4]], [[[2, 1], [1, 2]]]))
    assert [a.dtype for a in (found.pixels, found.ground, found.covariances)] == [np.float64] * 3
    assert found.covariances.tolist() == [[[2.0, 1.0], [1.0, 2.0]]]
    found = check_detections(Detections([], [], []))
    assert [a.shape for a in (found.pixels, found.ground, found.covariances)] == [(0, 2), (0, 2), (0, 2, 2)]


def test_output_of_lists_and_truth_values_passes_as_arrays():
    given = SensorOutput([[1, 2]], [0], [True, False, False], [np.eye(2)], pixels=[[3, 4]])
    found = check_output(given, PEOPLE)
    assert [a.dtype for a in (found.ground, found.covariances, found.pixels)] == [np.float64] * 3
    assert found.visible.tolist() == [1, 0, 0]
    assert found.owners.tolist() == [0]
    empty = check_output(SensorOutput(np.zeros((0, 2)), [], np.zeros(0, dtype=np.uint8)), PEOPLE[:0])
    assert (empty.covariances, empty.pixels) == (None, None) and empty.visible.shape == (0,)


def test_absent_people_are_neither_shown_nor_detected():
    with pytest.raises(ValueError, match="visible include absent people"):
        check_output(SensorOutput(PEOPLE[:1], [0], np.ones(3, dtype=int)), PEOPLE)
    with pytest.raises(ValueError, match="owners include absent people"):
        check_output(SensorOutput(PEOPLE[:1], [1], np.array([1, 0, 0])), PEOPLE)
