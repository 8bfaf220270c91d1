# SPDX-License-Identifier: GPL-3.0-or-later
"""An action on loopback without ROS: a master, clients that behave as rospy's, and servers that can be replaced."""

from __future__ import annotations

import contextlib
import socket
import struct
import threading
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import RosError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Publication, Slave
from ansible_collections.rosops.fleet.plugins.module_utils._ros.rpc import tell_publishers
from ansible_collections.rosops.fleet.plugins.module_utils._ros.streams import TopicStream
from ansible_collections.rosops.fleet.plugins.module_utils._ros.tcpros import STATUS_TYPE, cancel_id, goal_id
from ansible_collections.rosops.fleet.tests.unit.plugins.fake_ros import Peers

ACTION, KEEPER = "/work", "/ros_keeper"
GOAL = {"type": "demo/WorkActionGoal", "md5sum": "0123456789abcdef0123456789abcdef", "message_definition": "# a goal\n"}
CANCEL = {"type": "actionlib_msgs/GoalID", "md5sum": "302881f31927c1df708a2dbab0e80ee8", "message_definition": "# id\n"}
STATUS = {"type": STATUS_TYPE, "md5sum": "8b2b82f13216d0a8ea88bd3af735e619", "message_definition": "# states\n"}
ACTIVE, RECALLING = 1, 7


def text(word: str) -> bytes:
    return struct.pack("<I", len(word)) + word.encode()


HEADER = struct.pack("<III", 1, 0, 0) + text("")


class FakeMaster:
    """Registrations; over XML-RPC only the keeper registers. It tells subscribers of publishers, as a master does."""

    def __init__(self, peers: Peers) -> None:
        self.lock = threading.RLock()
        self.nodes: dict[str, str] = {}
        self.publishers: dict[str, list[str]] = {}
        self.subscribers: dict[str, list[str]] = {}
        self.away = False
        self.silent = False  # what it has to tell subscribers does not reach them
        replies = {
            "getSystemState": self._state,
            "getTopicTypes": [1, "", []],
            "lookupNode": self._look_up,
            "registerPublisher": lambda topic, _type, uri: self._came(topic, uri),
            "unregisterPublisher": lambda topic, _uri: self._left(topic),
        }
        self.uri = peers.api("master", replies, multicall=True)

    def register(self, node: Slave, publishes: list[str], subscribes: list[str]) -> None:
        with self.lock:
            self.nodes[node.name] = node.uri
            for names, part in ((publishes, self.publishers), (subscribes, self.subscribers)):
                for name in names:
                    part.setdefault(f"{ACTION}/{name}", []).append(node.name)

    def forget(self, name: str) -> None:
        with self.lock:
            self.nodes.pop(name, None)
            for part in (self.publishers, self.subscribers):
                for nodes in part.values():
                    if name in nodes:
                        nodes.remove(name)

    def addresses(self, topic: str) -> list[str]:
        with self.lock:
            return [self.nodes[name] for name in self.publishers.get(topic, ())]

    def introduce(self, topic: str) -> None:
        for name in self.subscribers.get(topic, ()) if not self.silent else ():
            tell_publishers(self.nodes[name], topic, self.addresses(topic), 2.0)

    def _state(self) -> list[Any]:
        if self.away:
            return [0, "away", 0]
        with self.lock:
            return [1, "", [[[name, list(nodes)] for name, nodes in part.items() if nodes]
                            for part in (self.publishers, self.subscribers)] + [[]]]  # fmt: skip

    def _look_up(self, name: str) -> list[Any]:
        return [1, "", self.nodes[name]] if name in self.nodes else [-1, f"unknown node [{name}]", ""]

    def _came(self, topic: str, uri: str) -> list[Any]:
        with self.lock:
            self.nodes[KEEPER] = uri
            known = self.publishers.setdefault(topic, [])
            known += [KEEPER] if KEEPER not in known else []  # once, however often it says so
        self.introduce(topic)
        return [1, "", self.subscribers.get(topic, [])]

    def _left(self, topic: str) -> list[Any]:
        with self.lock:
            self.publishers[topic].remove(KEEPER)
        return [1, "", 1]


class OneOfEachName(Publication):
    """rospy's: a second connection under a name ends the first."""

    def serve(self, sock: socket.socket, caller: str) -> None:
        with self.lock:
            for other in [known for known, name in self.links.items() if name == caller]:
                self._drop(other)
        super().serve(sock, caller)


class FakeClient(Slave):
    def __init__(self, master: FakeMaster, name: str = "/boss") -> None:
        super().__init__(name, "127.0.0.1", 0, master.uri)
        self.publications = {
            f"{ACTION}/goal": OneOfEachName(f"{ACTION}/goal", GOAL),
            f"{ACTION}/cancel": Publication(f"{ACTION}/cancel", CANCEL),
        }
        self.start()
        master.register(self, ["goal", "cancel"], [])

    def send(self, goal: str) -> list[str]:
        """Who got it."""
        return self.publish(f"{ACTION}/goal", HEADER + struct.pack("<II", 5, 0) + text(goal) + b"what to do")

    def cancel(self, goal: str) -> list[str]:
        return self.publish(f"{ACTION}/cancel", struct.pack("<II", 0, 0) + text(goal))


class FakeServer(Slave):
    """Lists every goal that it gets as active, at once and again whenever somebody subscribes.

    As rospy does, it calls itself connected to a publisher from the moment on that it begins to connect.
    """

    def __init__(self, master: FakeMaster, name: str = "/worker") -> None:
        super().__init__(name, "127.0.0.1", 0, master.uri)
        self.got: list[str] = []  # ids in their order; a cancel with a dash in front
        self.listed: dict[str, int] = {}
        self.streams: dict[tuple[str, str], TopicStream] = {}
        self.begun: set[tuple[str, str]] = set()
        self.way = threading.Event()  # cleared: the network lets no new connection through
        self.way.set()
        self.ended = threading.Event()
        self.advertise(f"{ACTION}/status", STATUS)
        self.register({"publisherUpdate": self._update, "getBusInfo": self._edges})
        self.start()
        threading.Thread(target=self._tell, daemon=True).start()
        master.register(self, ["status"], ["goal", "cancel"])
        for part in ("goal", "cancel"):
            self._update("/master", f"{ACTION}/{part}", master.addresses(f"{ACTION}/{part}"))

    def end(self, master: FakeMaster) -> None:
        self.ended.set()
        master.forget(self.name)
        for stream in self.streams.values():
            stream.close()
        self.stop()

    def _tell(self) -> None:
        """The status, as often as a server with a high status_frequency."""
        while not self.ended.wait(0.01):
            goals = list(self.listed.items())
            rows = b"".join(struct.pack("<II", 5, 0) + text(goal) + bytes([state]) + text("") for goal, state in goals)
            self.publish(f"{ACTION}/status", HEADER + struct.pack("<I", len(goals)) + rows)

    def _update(self, _caller: str, topic: str, uris: list[str]) -> list[Any]:
        for key, stream in list(self.streams.items()):
            if key[0] == topic and (key[1] not in uris or not stream.open):
                stream.close()
                del self.streams[key]
        for key in [(topic, uri) for uri in uris]:
            if key not in self.streams and key not in self.begun:
                self.begun.add(key)
                threading.Thread(target=self._connect, args=key, daemon=True).start()
        return [1, "", 0]

    def _connect(self, topic: str, uri: str) -> None:
        self.way.wait(20)
        stream = TopicStream(self.name, topic, uri, self._goal if topic.endswith("goal") else self._cancel)
        with contextlib.suppress(OSError, RosError):  # a publisher that has just left says so
            stream.connect(2.0)
            self.streams[topic, uri] = stream
        self.begun.discard((topic, uri))

    def _goal(self, body: bytes) -> None:
        goal = goal_id(body)[0]
        if self.listed.get(goal) != ACTIVE:
            self.got.append(goal)
            self.listed[goal] = ACTIVE

    def _cancel(self, body: bytes) -> None:
        goal = cancel_id(body)[0]
        self.got.append(f"-{goal}")
        self.listed.setdefault(goal, RECALLING)

    def _edges(self, caller: str) -> list[Any]:
        rows = self._bus_info(caller)[2]
        open_ones = {key for key, one in self.streams.items() if one.open}
        rows += [[99, uri, "i", "TCPROS", topic, True, ""] for topic, uri in sorted(open_ones | self.begun)]
        return [1, "", rows]
