"""What is no person becomes none: classes and scores of COCO, MOTChallenge, VisDrone, detectors and CSV files."""

import json
import re

import pytest

from sim.exchange.scanned_flight import read_flight
from tracking.errors import InputError

INFO = "[Sequence]\nframeRate=5\nseqLength=3\nimWidth=128\nimHeight=128\n"
GROUPS = [
    {"id": 1, "name": "rider", "supercategory": "Person"},
    {"id": 2, "name": "walker", "supercategory": "Person"},
    {"id": 3, "name": "van", "supercategory": "vehicle"},
    {"id": 4, "supercategory": "vehicle"},
]
NAMES = [{"id": 1, "name": "car"}, {"id": 4, "name": "Person"}]


def mot(*ends, boxes=(30, 50, 70, 90)):
    """Files of a sequence: in each of three frames a box for each end of a row, after the box; lines end as given."""
    rows = (f"{k},-1,{x},60,8,8,{end}\n" for k in (1, 2, 3) for x, end in zip(boxes, ends, strict=False))
    return {"seqinfo.ini": INFO, "det/det.txt": "".join(rows)}


def coco(*results, categories=()):
    """Files of COCO: in each of three images a box for each category and score, of 8 x 8 pixels or as given."""
    rows = [
        {"image_id": k, "bbox": [30 + 20 * n, 60, 8, 8], **result} for k in range(3) for n, result in enumerate(results)
    ]
    images = [{"id": k, "time_s": k / 5, "width": 128, "height": 128} for k in range(3)]
    data = json.dumps({"images": images, "categories": [*categories]})
    return {"images.json": data, "results.json": "\ufeff" + json.dumps(rows)}


def table(header, *ends):
    rows = (f"{k / 5},{34 + 20 * n},64,{end}" for k in range(3) for n, end in enumerate(ends))
    return {"detections.csv": "\n".join([f"time_s,u_px,v_px,{header}", *rows])}


def of(*numbers):
    return [{"category_id": n} for n in numbers]


TWICE = [{"bbox": [50, 60, 8, 8], "category_id": 1, "score": score} for score in (0.9, 0.8, 0.9)]
SIZES = [{"bbox": [50, 60, *size], "category_id": 1} for size in ((8, 8), (-8, 8), (8, 0))]
# Files, options, columns of the boxes that count, and what is said.
CASES = {
    "MOTChallenge": (
        mot("1,1,1", "1,3,1", "1,7,0.5", "1,12,1"),
        {},
        [34],
        "3 of class reflection, 3 of class static p",
    ),
    "MOT, 8 columns": (mot("1,3", "1,1"), {}, [54], "used: 3 of class pedestrian; left out: 3 of class car"),
    "MOT, a car": (mot("1,1,1", "1,3,1"), {"classes": "car"}, [54], "used: 3 of class car; left out: 3 of class pedes"),
    "MOT, numbers": (mot("1,1,1", "1,7,1", "1,12,1"), {"classes": "1, 7"}, [34, 54], "3 of class static person; left"),
    "MOT, no class": (mot("1,-1,-1,-1", "-1,-1,-1,-1"), {}, [34, 54], None),
    "MOT, a place": (mot("1,3.5,1.25,0", "1,4.5,2.0,0"), {}, [34, 54], None),
    "MOT, zeros": (mot("1,0,0,0", "1,0,0,0"), {}, [34, 54], None),
    "MOT, no score": (mot("-1", "-1", "-1"), {}, [34, 54, 74], None),
    "MOT, scores": (mot("0.9", "0", "-1", "-0.4"), {}, [34, 74, 94], "left out: 3 with a score of 0"),
    "MOT, all zero": (mot("0", "0"), {}, [34, 54], None),
    "MOT, least": (mot("0.9", "0.3", "-1"), {"least_score": 0.5}, [34, 74], "left out: 3 with a score below 0.5"),
    "a detector": (mot("1,0,-1", "1,2,-1", "1,1,-1"), {}, [34], "3 of class 1, 3 of class 2"),
    "a detector, 10 columns": (mot("1,0,-1,-1", "1,1,-1,-1"), {}, [34], "3 of class 1"),
    "VisDrone": (
        mot("1,1,0,0", "1,4,1,2", "1,2,0,1", "1,0,0,0"),
        {},
        [34, 74],
        "3 of class car, 3 of class ignored reg",
    ),
    "VisDrone's results": (mot("0.9,1,-1,-1", "0.9,4,-1,-1", "0.2,2,-1,-1"), {}, [34, 74], "scores are 0.2 to 0.9"),
    "VisDrone, cars": (
        mot("1,1,0,0", "1,4,1,2", "1,5,1,2"),
        {"classes": "car,van"},
        [54, 74],
        "3 of class car, 3 of cla",
    ),
    "COCO": (coco(*of(1, 3, 1)), {}, [34, 74], "used: 6 of class 1; left out: 3 of class 3"),
    "COCO from 0": (coco(*of(0, 2, 1)), {}, [34], "left out: 3 of class 1, 3 of class 2"),
    "COCO's names": (coco(*of(1, 4), categories=NAMES), {}, [54], "used: 3 of class Person; left out: 3 of class car"),
    "COCO by number": (coco(*of(1, 4), categories=NAMES), {"classes": "1"}, [34], "used: 3 of class car"),
    "COCO, a group": (
        coco(*of(1, 2, 3), categories=GROUPS),
        {"classes": "person"},
        [34, 54],
        "used: 3 of class rider, 3 of class walker; left out: 3 of class van",
    ),
    "COCO, a group and a class": (
        coco(*of(1, 2, 3, 4), categories=GROUPS),
        {"classes": "vehicle, walker"},
        [54, 74, 94],
        "used: 3 of class 4, 3 of class van, 3 of class walker; left out: 3 of class rider",
    ),
    "COCO, a category without a name": (
        coco(*of(4, 5), categories=[*NAMES, {"id": 5}]),
        {},
        [34],
        "used: 3 of class Person; left out: 3 of class 5",
    ),
    "COCO, no class": (coco({}, {"score": 0.4}), {"least_score": 0.4}, [34, 54], None),
    "COCO, sizes": (coco(*SIZES), {}, [54], "left out: 6 without a size"),
    "COCO, twice": (coco(*TWICE), {}, [54], "left out: 6 twice in one frame"),
    "a table": (
        table("class,score", "person,0.9", "Car,0.9", ",0.9", "people,0"),
        {},
        [34, 74],
        "3 of class Car, 3 with",
    ),
    "names beside numbers": (
        table("class_id,class_name", "0,car", "7,person"),
        {},
        [54],
        "used: 3 of class person; left out: 3 of class car",
    ),
    "a table's numbers": (
        table("category_id,confidence", "1,0.9", "2,0.9", "1,0.1"),
        {"least_score": 0.5},
        [34],
        "below 0.5",
    ),
}


@pytest.fixture
def flight(tmp_path):
    """Writes files of a flight with a camera that looks straight down; returns their folder."""

    def write(files):
        given = {"poses.csv": "time_s,x_m,y_m,z_m\n0,0,0,20\n", "cameras.csv": "fov_deg,pixels\n60,128\n", **files}
        for name, text in given.items():
            (tmp_path / name).parent.mkdir(exist_ok=True)
            (tmp_path / name).write_text(text, encoding="utf-8")
        return tmp_path

    return write


@pytest.mark.parametrize("case", CASES)
def test_only_people_are_tracked_and_a_remark_names_the_others(flight, case):
    files, options, columns, remark = CASES[case]
    log = read_flight(flight(files), **options)
    shift = "det/det.txt" in files  # there, the first pixel is 1
    for k in range(3):
        assert log.observed[k, 0].pixels[:, 0].tolist() == [column - shift for column in columns]
    told = [text for text in log.remarks if text.startswith("detections: used") or "scores" in text]
    assert any(remark in text for text in told) if remark else not any("left out" in text for text in told)


SPANS = {  # files, options, and the scores of which a remark tells
    "zeros": (mot("0.9", "0", "0.3"), "0.3 to 0.9"),
    "zeros and one score": (mot("0.9", "0", "0.9"), None),
    "no sizes": (coco(*({**one, "score": score} for one, score in zip(SIZES, (0.5, 0.1, 0.9), strict=True))), None),
    "twice": (coco(*TWICE), None),
    "other classes": (coco({"category_id": 1, "score": 0.5}, {"category_id": 3, "score": 0.1}), None),
    "all zero": (mot("0", "0"), None),
    "not all have one": (mot("0.5", "-1", "0.25"), "0.25 to 0.5"),
}


@pytest.mark.parametrize("case", SPANS)
def test_the_scores_of_a_remark_are_those_of_people_who_count(flight, case):
    files, span = SPANS[case]
    told = [text for text in read_flight(flight(files)).remarks if "scores" in text]
    wanted = f"detections: scores are {span}; --least-score leaves out the lower ones"
    assert told == ([wanted] if span else [])


def test_labels_are_of_the_same_classes_as_detections(flight):
    rows = [f"{k},{n},{30 + 20 * n},60,8,8,{end}\n" for k in (1, 2, 3) for n, end in enumerate(("1,1,0,0", "1,4,0,0"))]
    files = mot("1,1,0,0", "1,4,0,0") | {"gt/gt.txt": "".join(rows)}
    for classes, column in (("", 0), ("people,pedestrian", 0), ("car", 1)):
        log = read_flight(flight(files), classes=classes)
        (place,) = {tuple(p) for positions in log.people.positions for p in positions.round(9).tolist()}
        assert place == tuple(log.observed[0, 0].scan.measurements[0].round(9).tolist()), column
        assert any(text.startswith("truth: used: 3 of class") for text in log.remarks)


@pytest.mark.parametrize(
    ("files", "options", "complaint"),
    [
        (mot("1,3,1", "1,4,1"), {}, "left out: 3 of class bicycle, 3 of class car; so nobody is left; --classes"),
        (coco(*of(7)), {}, "used: none; left out: 3 of class 7; so nobody is left"),
        (coco({"score": 0.2}), {"least_score": 0.5}, "3 with a score below 0.5; so nobody is left"),
        (mot("1,1,1"), {"classes": "pedestian"}, "--classes: 'pedestian' is unknown; allowed are bicycle, car, "),
        (mot("1,1,1"), {"classes": "pedestian"}, "did you mean pedestrian?"),
        (coco(*of(1), categories=GROUPS), {"classes": "vehicles"}, "did you mean vehicle?"),
        (mot("1"), {"classes": "person"}, "--classes: the detections of this flight have no classes"),
        (mot("-1"), {"least_score": 0.5}, "--least-score: the detections of this flight have no scores"),
        (mot("1,-1,-1,-1") | {"det/det.txt": "1,-1,-1,-1,-1,-1,1,-1,-1,-1\n"}, {}, "and there is no place x, y on the"),
    ],
)
def test_a_selection_that_leaves_nobody_is_refused_in_one_line(flight, files, options, complaint):
    with pytest.raises(InputError, match=re.escape(complaint)) as told:
        read_flight(flight(files), **options)
    assert "\n" not in str(told.value)


def test_the_command_takes_classes_and_a_least_score(flight, call):
    folder = flight(mot("0.9,1,1", "0.4,3,1", "0.2,1,1"))
    code, _, err = call("track", str(folder), "--classes", "car,pedestrian", "--least-score", "0.4", "--no-video")
    assert code == 0
    assert "used: 3 of class car, 3 of class pedestrian; left out: 3 with a score below 0.4\n" in err
    code, out, err = call("track", str(folder), "--least-score", "half")
    assert (code, out) == (2, "")
    assert err == "understory: --least-score: 'half' is not allowed; expected a number such as 0.5\n"
