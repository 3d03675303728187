"""Labelled images: COCO's files of what the cameras of two missions saw, one of them for the test.

Leaves `labels`, prints what an image's labels tell, and draws its boxes into `boxes.png`.
"""

import json
from pathlib import Path

import cv2

import understory

settings = {"duration": 4, "sensing.mode": "ideal", "appearance.randomise": True, "appearance.noise": 12}
flights = [understory.run("dense", "greedy", seed=seed, settings=settings) for seed in (0, 1)]
understory.export(flights, "coco", "labels", every=2.0, splits={1: "test"})
labels = json.loads(Path("labels/annotations/instances_train.json").read_text())
print(len(labels["images"]), "images to train with,", len(labels["annotations"]), "people on them")
shown = [one["image_id"] for one in labels["annotations"]]
entry = max(labels["images"], key=lambda image: shown.count(image["id"]))
picture = cv2.resize(cv2.imread(f"labels/images/train/{entry['file_name']}"), None, fx=4, fy=4)
for one in labels["annotations"]:
    if one["image_id"] == entry["id"]:
        x, y = one["place_m"]
        print(f"person {one['person']} at ({x:.1f}, {y:.1f}) m: {100 * one['visible_share']:.0f} % shown")
        x, y, width, height = (round(4 * value) for value in one["bbox"])
        cv2.rectangle(picture, (x, y), (x + width, y + height), (255, 255, 255))
cv2.imwrite("boxes.png", picture)
