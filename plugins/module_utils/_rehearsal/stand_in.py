# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's part of a recorded graph, played in its place: `stand_in.py PLAN`.

It stands alone, and runs on the rospy of an image. Each node of the plan is a process. It publishes messages of zeros
at the recorded rate, whose headers rospy numbers; it takes what it is sent under the recorded md5sum; its services
shake hands and refuse calls, as nobody recorded what they answer. No package of messages is needed: genpy makes a type
of its recorded definition.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any, Callable, Mapping

LOGS = "/tmp/ros-log"  # noqa: S108 - rospy wants a home directory, a container has none
QUEUE = 1000  # messages
PERIOD = 1.0  # s between looks at the other nodes

Said = Mapping[str, Any]  # a part of the plan, or classes by the names of their types


class Node:
    """One node of the plan. `rospy` is the module, `generate` makes classes of a type's name and definition."""

    def __init__(self, rospy: Any, generate: Callable[[str, str], Said], plan: Said) -> None:
        self.rospy, self.generate, self.plan = rospy, generate, plan

    def play(self) -> None:
        """Until it is told to end."""
        self.rospy.init_node(self.plan["name"].rpartition("/")[2])
        for topic in self.plan["subscribes"]:
            self.rospy.Subscriber(topic["name"], self._bytes(topic))
        for service in self.plan["services"]:
            self._serve(service)
        for topic in self.plan["publishes"]:
            self._publish(topic)
        self.rospy.spin()

    def _bytes(self, one: Said) -> Any:
        """A class of messages that nobody reads."""
        names = {"_type": one["type"] or "*", "_md5sum": one["md5sum"] or "*"}
        return type("Bytes", (self.rospy.AnyMsg,), names)

    def _serve(self, service: Said) -> None:
        def refuse(_request: Any) -> None:
            raise self.rospy.ServiceException("a stand-in has no answer: only the graph was recorded")

        kind = self._bytes(service)
        names = {"_type": kind._type, "_md5sum": kind._md5sum, "_request_class": kind, "_response_class": kind}
        self.rospy.Service(service["name"], type("Calls", (), names), refuse)

    def _publish(self, topic: Said) -> None:
        kind = self.generate(topic["type"], topic["definition"])[topic["type"]]
        out = self.rospy.Publisher(topic["name"], kind, queue_size=QUEUE, latch=topic["latched"])

        def beat() -> None:
            began, number = time.monotonic(), 0
            while not self.rospy.is_shutdown():
                out.publish(kind())
                number += 1
                time.sleep(max(0.0, began + number / topic["rate"] - time.monotonic()))

        if topic["rate"]:
            threading.Thread(target=beat, daemon=True).start()
        elif topic["latched"]:
            out.publish(kind())


def play(path: str, number: int) -> None:
    """One node, in this process."""
    import rospy  # noqa: PLC0415 - it reads the environment, which the parent makes for each node
    from genpy.dynamic import generate_dynamic  # noqa: PLC0415 - of the image's ROS, as rospy is

    Node(rospy, generate_dynamic, json.loads(Path(path).read_text("utf-8"))["nodes"][number]).play()


def play_all(path: str) -> int:
    """Every node in a process of its own; all of them end with the first."""
    nodes = json.loads(Path(path).read_text("utf-8"))["nodes"]
    told = threading.Event()
    for word in (signal.SIGTERM, signal.SIGINT):
        signal.signal(word, lambda _word, _frame: told.set())
    processes = []
    for number, node in enumerate(nodes):
        space = {"ROS_LOG_DIR": LOGS, **os.environ, "ROS_NAMESPACE": node["name"].rpartition("/")[0] or "/"}
        words = [sys.executable, __file__, path, str(number)]
        # there is no AnsibleModule in a pod, whose run_command would be called
        # pylint: disable-next=ansible-bad-function
        processes.append(subprocess.Popen(words, env=space))  # noqa: S603 - ourselves
    while not told.is_set() and all(process.poll() is None for process in processes):
        told.wait(PERIOD)
    for process in processes:
        process.terminate()
    for process in processes:
        process.wait()
    return 0 if told.is_set() else 1


if __name__ == "__main__":
    if len(sys.argv) > 2:
        play(sys.argv[1], int(sys.argv[2]))
    else:
        raise SystemExit(play_all(sys.argv[1]))
