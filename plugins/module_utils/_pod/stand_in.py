# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An app's part of a recorded graph, played in its place: `stand_in.py PLAN`.

It stands alone, and runs on the rospy of an image. Each node of the plan is a process. It publishes messages of zeros
under the recorded type and md5sum at the recorded rate, numbered where the type has a place for that; it keeps account
of what it gets (`Account`), once a second as the parameter /rehearsal/<node>; its services shake hands and refuse
calls, as nobody recorded what they answer. It greets services of others, and counts who answers (`Greetings`). No
package of messages is needed: rospy takes a class that hands bytes on.
"""

from __future__ import annotations

import contextlib
import heapq
import http.client
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import xmlrpc.client
from pathlib import Path
from typing import Any, Mapping
from urllib.parse import urlsplit

ACCOUNTS = "/rehearsal"
AWAY = (OSError, http.client.HTTPException, xmlrpc.client.Error)  # what a master that is away raises
KEPT = 20  # gaps
SECONDS = 2.0  # for a service to answer
PAUSE = 0.1  # s between two greetings of a service
LONGEST = 65536  # bytes of a service's header
LOGS = "/tmp/ros-log"  # noqa: S108 - rospy wants a home directory, a container has none
QUEUE = 1000  # messages
PERIOD = 1.0  # s between accounts, and between looks at the other nodes


class Account:
    """What came on one topic: how many messages, which numbers are missing, the longest silences."""

    def __init__(self, place: Mapping[str, Any] | None) -> None:
        self.place = place
        self.messages = self.twice = self._passed = 0
        self.publishers: set[str] = set()
        self.last: dict[str, int] = {}  # publisher -> its last number
        self.ranges: list[list[int]] = []  # of numbers that all publishers share
        self.gaps: list[tuple[float, float]] = []  # (seconds, since 1970 when it ended)
        self.at = 0.0
        self._lock = threading.Lock()

    def take(self, publisher: str, body: bytes, now: float, wall: float) -> None:
        """A message came."""
        with self._lock:
            if self.messages:
                heapq.heappush(self.gaps, (now - self.at, wall))
                if len(self.gaps) > KEPT:
                    heapq.heappop(self.gaps)
            self.at = now
            self.messages += 1
            self.publishers.add(publisher)
            number = None if self.place is None else number_at(body, self.place)
            if number is not None and self.place is not None:
                if self.place["own"]:
                    self._own(publisher, number)
                else:
                    self._shared(number)

    def _own(self, publisher: str, number: int) -> None:
        """TCP brings each publisher's in their order: one that is not higher is of a publisher that began anew."""
        before = self.last.get(publisher, number)
        self._passed += max(0, number - before - 1)
        self.last[publisher] = number

    def _shared(self, number: int) -> None:
        at = len(self.ranges)
        while at and number < self.ranges[at - 1][0]:
            at -= 1
        if at and number <= self.ranges[at - 1][1]:
            self.twice += 1
        elif at and number == self.ranges[at - 1][1] + 1:
            self.ranges[at - 1][1] = number
            if at < len(self.ranges) and self.ranges[at][0] == number + 1:
                self.ranges[at - 1][1] = self.ranges.pop(at)[1]
        else:
            self.ranges.insert(at, [number, number])
            if at + 1 < len(self.ranges) and self.ranges[at + 1][0] == number + 1:
                self.ranges[at][1] = self.ranges.pop(at + 1)[1]

    def told(self) -> dict[str, Any]:
        """The account so far; `missing` is None where messages have no number."""
        with self._lock:
            holes = sum(two[0] - one[1] - 1 for one, two in zip(self.ranges, self.ranges[1:]))
            return {
                "messages": self.messages,
                "missing": None if self.place is None else self._passed + holes,
                "twice": self.twice,
                "publishers": sorted(self.publishers),
                "gaps": sorted((wall, round(seconds, 3)) for seconds, wall in self.gaps),
            }


class Greetings:
    """How often a service was greeted, and how often nobody answered."""

    def __init__(self) -> None:
        self.asked = self.refused = 0

    def take(self, answered: bool) -> None:
        self.asked += 1
        self.refused += not answered

    def told(self) -> dict[str, int]:
        return {"asked": self.asked, "refused": self.refused}


def greet(service: str, uri: str, caller: str) -> bool:
    """Whether a service shakes hands as with a client before a call; it is not called."""
    fields = {"callerid": caller, "service": service, "md5sum": "*", "probe": "1"}
    items = [f"{name}={value}".encode() for name, value in fields.items()]
    header = b"".join(struct.pack("<I", len(item)) + item for item in items)
    where = urlsplit(uri)
    try:
        with socket.create_connection((where.hostname or "", where.port or 0), SECONDS) as sock, sock.makefile(
            "rb"
        ) as said:
            sock.sendall(struct.pack("<I", len(header)) + header)
            reply = said.read(min(struct.unpack("<I", said.read(4))[0], LONGEST))
    except (OSError, struct.error):
        return False
    return b"callerid=" in reply and b"error=" not in reply


def number_at(body: bytes, place: Mapping[str, Any]) -> int | None:
    """The number in a message; None where it is too short for one."""
    at = 0
    try:
        for step in place["steps"]:
            at += step if step >= 0 else 4 - step * struct.unpack_from("<I", body, at)[0]
        return int(struct.unpack_from("<" + place["code"], body, at)[0])
    except struct.error:
        return None


def blank(size: int, place: Mapping[str, Any] | None, number: int) -> bytes:
    """A message of zeros with its number."""
    body = bytearray(size)
    if place is not None:
        code = "<" + place["code"]
        at = sum(step if step >= 0 else 4 for step in place["steps"])
        struct.pack_into(code, body, at, number % (1 << (8 * struct.calcsize(code) - 1)))
    return bytes(body)


class Node:
    """One node of the plan; `rospy` is the module."""

    def __init__(self, rospy: Any, plan: Mapping[str, Any]) -> None:
        self.rospy, self.plan = rospy, plan
        self.accounts = {topic["name"]: Account(topic["place"]) for topic in plan["subscribes"]}
        self.greetings = {service: Greetings() for service in plan["asks"]}

    def play(self) -> None:
        """Until it is told to end."""
        self.rospy.init_node(self.plan["name"].rpartition("/")[2])
        for topic in self.plan["subscribes"]:
            self._listen(topic)
        for service in self.plan["services"]:
            self._serve(service)
        for topic in self.plan["publishes"]:
            self._publish(topic)
        for service in self.greetings:
            threading.Thread(target=self._ask, args=(service,), daemon=True).start()
        while not self.rospy.is_shutdown():
            told = {name: account.told() for name, account in self.accounts.items()}
            told.update({name: greetings.told() for name, greetings in self.greetings.items()})
            with contextlib.suppress(*AWAY):  # a master that is away misses one account
                self.rospy.set_param(ACCOUNTS + self.plan["name"], json.dumps(told, sort_keys=True))
            time.sleep(PERIOD)

    def kind(self, topic: Mapping[str, Any]) -> Any:
        """A class of messages that are bytes."""
        names = {"_type": topic["type"] or "*", "_md5sum": topic["md5sum"] or "*"}
        return type("Bytes", (self.rospy.AnyMsg,), {**names, "_full_text": topic.get("definition", "")})

    def _listen(self, topic: Mapping[str, Any]) -> None:
        account = self.accounts[topic["name"]]

        def got(message: Any) -> None:
            publisher = message._connection_header["callerid"]
            account.take(publisher, message._buff, time.monotonic(), time.time())

        self.rospy.Subscriber(topic["name"], self.kind(topic), got)

    def _serve(self, service: Mapping[str, Any]) -> None:
        def refuse(_request: Any) -> None:
            raise self.rospy.ServiceException("a stand-in has no answer: only the graph was recorded")

        kind = self.kind(service)
        names = {"_type": kind._type, "_md5sum": kind._md5sum, "_request_class": kind, "_response_class": kind}
        self.rospy.Service(service["name"], type("Calls", (), names), refuse)

    def _ask(self, service: str) -> None:
        while not self.rospy.is_shutdown():
            answered = False
            with contextlib.suppress(*AWAY):
                code, _said, uri = self.rospy.get_master().lookupService(service)
                answered = code == 1 and greet(service, uri, self.plan["name"])
            self.greetings[service].take(answered)
            time.sleep(PAUSE)

    def _publish(self, topic: Mapping[str, Any]) -> None:
        kind = self.kind(topic)
        out = self.rospy.Publisher(topic["name"], kind, queue_size=QUEUE, latch=topic["latched"])

        def send(number: int) -> None:
            message = kind()
            message._buff = blank(topic["size"], topic["place"], number)
            out.publish(message)

        def beat() -> None:
            began, number = time.monotonic(), 0
            while not self.rospy.is_shutdown():
                send(number)
                number += 1
                time.sleep(max(0.0, began + number / topic["rate"] - time.monotonic()))

        if topic["rate"]:
            threading.Thread(target=beat, daemon=True).start()
        elif topic["latched"]:
            send(0)


def play(path: str, number: int) -> None:
    """One node, in this process."""
    import rospy  # noqa: PLC0415 - it reads the environment, which the parent makes for each node

    Node(rospy, json.loads(Path(path).read_text("utf-8"))["nodes"][number]).play()


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
