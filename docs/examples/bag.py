"""A bag of ROS 2, and back: a mission is written as a bag, and the tracker runs on the bag's detections.

Leaves the bag and a layout for Foxglove in `bagged`, and prints its topics and both flights.
"""

from pathlib import Path

from rosbags.highlevel import AnyReader

import understory

flight = understory.run("forest", "greedy", seed=2, settings={"duration": 4})
understory.export(flight, "rosbag", "bagged")
with AnyReader([Path("bagged/bag")]) as reader:
    for topic in sorted(reader.topics):
        print(f"{topic:<32}{reader.topics[topic].msgtype:<40}{reader.topics[topic].msgcount:>5} messages")
print("flown:", flight)
print("from the bag:", understory.track("bagged"))
