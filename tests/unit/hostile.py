# SPDX-License-Identifier: GPL-3.0-or-later
"""The parsers of what hosts, pods, the graph and imported files say, and hostile values for them.

Every value is one that was good, with one or some of its parts made to do harm,
    or nothing but harm. A seed tells which.
"""

from __future__ import annotations

import copy
import io
import json
import random
import re
import tarfile
import xmlrpc.client
import zlib
from collections.abc import Callable, Mapping
from pathlib import PurePosixPath
from typing import Any, NamedTuple

import yaml
from ansible_collections.rosops.fleet.plugins.module_utils._common.documents import json_of
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import (
    FleetError,
    RosError,
    SpecError,
    printable,
)
from ansible_collections.rosops.fleet.plugins.module_utils._exporter import updates
from ansible_collections.rosops.fleet.plugins.module_utils._host import certificates, facts, k3s
from ansible_collections.rosops.fleet.plugins.module_utils._pod import sidecar
from ansible_collections.rosops.fleet.plugins.module_utils._robot import door, memory
from ansible_collections.rosops.fleet.plugins.module_utils._ros import replies, rpc, tcpros
from ansible_collections.rosops.fleet.plugins.module_utils._ros.bus_stats import stats
from ansible_collections.rosops.fleet.plugins.module_utils._ros.graph_json import graph_from
from ansible_collections.rosops.fleet.plugins.module_utils._ros.messages import Definition
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import record_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import closed, events_of, went_back
from ansible_collections.rosops.fleet.plugins.plugin_utils._images import archive, node
from ansible_collections.rosops.fleet.plugins.plugin_utils._k3s import rotation
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.kubeconfig import local_kubeconfig, url_at
from ansible_collections.rosops.fleet.plugins.plugin_utils._model import formats, machines
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.claims import sources
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import secrets_in, without
from ansible_collections.rosops.fleet.plugins.plugin_utils._preflight.findings import comparable, fleet_findings
from ansible_collections.rosops.fleet.plugins.plugin_utils._rehearsal import recording
from ansible_collections.rosops.fleet.plugins.plugin_utils._report import kept, look, results
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.ros_graph import Reading
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.rows import Status
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.text import status_text, summary_text
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate import launch_file
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import tar_of
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._report import a_fleet

NOW = "2026-11-24T16:12:30Z"
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
HARM = (
    "", " ", "\n", "../../root", "/etc/passwd", "a/../b", "robot-../..", "a\0b", "\x1b[31mred", "\x9b1m",
        "\u202edesrever",
    "{{ lookup('pipe', 'id') }}", "$(id)", "`id`", "; id", "a; id", "--help", "-rf", "%s%n", "é", "²", "\ud800", "null",
    "nan", "Infinity", "-1", "1e999", "9" * 5000, "a" * 5000, "[" * 1200, "<!DOCTYPE x>", "&a;", "*a", "&a [*a]",
    "!!python/object/apply:os.system [id]", "http://[::1", "http://a:99999/", "1.2.3.4:5", "x@y:z", "a=b",
        "robot-robot2",
    "v1.2", "sha256:0", "\r\n\r\n", "<script>alert(1)</script>", "'\"><", "\\", "__class__", "2026-11-24T16:12:30Z",
)  # fmt: skip
SCALARS = (None, True, False, 0, -1, 7, 2**63, 10**18, 10**400, 0.5, -1.5, 1e308, float("inf"), float("nan"))
Made = Callable[[random.Random, Any], Any]


class Parser(NamedTuple):
    """`read` a value, one of `good` or what a `spoil` made of it: a result that passes `right`, or one of `errors`."""

    read: Callable[[Any], Any]
    good: tuple[Any, ...]
    errors: tuple[type[BaseException], ...] = ()
    right: Callable[[Any], bool] = lambda _found: True
    spoil: Made | None = None


# ---- harm


def harm(dice: random.Random, depth: int = 0) -> Any:
    """A value of JSON, without one that another would be needed for."""
    kind = dice.random()
    if kind < 0.45:
        return dice.choice(HARM)
    if kind < 0.8 or depth > 2:
        return dice.choice(SCALARS)
    if kind < 0.9:
        return [harm(dice, depth + 1) for _one in range(dice.randrange(4))]
    return {
        dice.choice((*HARM, "name", "kind", "metadata")): harm(dice, depth + 1) for _one in range(dice.randrange(4))
    }


def spoilt(dice: random.Random, value: Any) -> Any:
    """A tree with some of its parts made to do harm."""
    if dice.random() < 0.04:
        return harm(dice)
    if isinstance(value, Mapping):
        kept = {key: spoilt(dice, item) for key, item in value.items() if dice.random() > 0.02}
        return {**kept, **({dice.choice(HARM): harm(dice)} if dice.random() < 0.03 else {})}
    if isinstance(value, (list, tuple)):
        return [spoilt(dice, item) for item in value] * (2 if dice.random() < 0.02 else 1)
    return value


def text(dice: random.Random, value: str) -> str:
    """A text that was cut, doubled, or has harm in it; or harm alone."""
    for _turn in range(dice.randrange(1, 4)):
        start, size = dice.randrange(len(value) + 1), dice.randrange(1 + min(len(value), 40))
        new = dice.choice((dice.choice(HARM), value[start : start + size], chr(dice.randrange(0x300)), ""))
        value = value[:start] + new + value[start + dice.choice((0, size)) :]
    return dice.choice(HARM) if dice.random() < 0.05 else value


def octets(dice: random.Random, value: bytes) -> bytes:
    return bytes_of(text(dice, value.decode("latin-1")), "latin-1") if dice.random() < 0.9 else dice.randbytes(40)


def utf8(dice: random.Random, value: str) -> str:
    """As it is read out of a file."""
    return bytes_of(text(dice, value)).decode()


def items(dice: random.Random, value: Mapping[str, Any]) -> Any:
    """A mapping, whatever is in it."""
    return {key: spoilt(dice, item) for key, item in value.items()}


def bytes_of(value: str, encoding: str = "utf-8") -> bytes:
    return value.encode(encoding, "replace")


def json_text(dice: random.Random, value: Any) -> str:
    """JSON of a spoilt tree, or spoilt itself."""
    made = json.dumps(spoilt(dice, value))
    return text(dice, made) if dice.random() < 0.2 else made


def within(key: str, *more: str) -> Made:
    """An object of which one text is JSON of somebody."""

    def spoil(dice: random.Random, value: Any) -> Any:
        made = place = copy.deepcopy(value)
        for step in more:
            place = place[step]
        place[key] = json_text(dice, json.loads(place[key])) if dice.random() < 0.95 else harm(dice)
        return made

    return spoil


# ---- what is read, and what may come of it


def quiet(said: str) -> bool:
    return not CONTROL.search(said)


def shown(status: Status) -> str:
    """On the screen."""
    return summary_text(status, NOW, "fleet") + status_text(status)


def cluster(answer: Any) -> str:
    found = look.believed(look.Answer(answer), "robot1", a_fleet.NOW)
    usage: dict[str, int] = {}
    status = look.held.cluster_rows([found.objects], usage, a_fleet.NOW)
    assert {row.host for row in status.outcomes} <= {"robot1"}
    assert {row.robot for row in status.apps} <= {"robot1", "(shared)"}
    return shown(status)


def graph(told: Any) -> str:
    reading = Reading.from_dict(told, {})
    return shown(look.status_of(Status(), {"robot1": reading}))


def peers(told: Any) -> list[Any]:
    return [*fleet_findings("robot1", {"robot1": FACTS, "robot2": told})] if comparable(told) else []


def request(said: bytes) -> str:
    class Line:
        def __init__(self) -> None:
            self.left = io.BytesIO(said)
            self.recv = self.left.read

    return sidecar.requested(Line())


def packed(said: bytes) -> list[archive.Image]:
    with tarfile.open(fileobj=io.BytesIO(ARCHIVE)) as file:
        found = archive.Archive(file, "x.tar")
        found.read = lambda name: said if name == "manifest.json" else CONFIG
        return found.images()


def kubeconfig_is_bare(said: str) -> bool:
    found = yaml.safe_load(said)
    user, of = found["users"][0]["user"], found["clusters"][0]["cluster"]
    texts = all(isinstance(value, str) for value in (*user.values(), *of.values()))
    own = {"client-certificate-data", "client-key-data", "token"}
    return texts and user.keys() <= own and of.keys() <= {"server", "certificate-authority-data"}


def inside(found: list[Any]) -> bool:
    """Directories of the control node, each of the robot whose host has it."""
    targets = [PurePosixPath(one.target) for one in found]
    return all(place.parts[0] == "robot1" and ".." not in place.parts and len(place.parts) == 2 for place in targets)


CONFIG = json.dumps({"architecture": "amd64"}).encode()
ARCHIVE = tar_of({"manifest.json": b"", "c.json": CONFIG})
FACTS = {"hostname": "robot1", "machine_id": "ab12", "routes": [{"family": 4, "interface": "eth0", "mtu": 1500}]}
K3S_YAML = yaml.safe_dump({
    "clusters": [{"cluster": {"server": "https://127.0.0.1:6443", "certificate-authority-data": "QQ=="}}],
    "users": [{"user": {"client-certificate-data": "QQ==", "client-key-data": "QQ==", "exec": {"command": "id"}}}],
})  # fmt: skip
XML = xmlrpc.client.dumps(([1, "", [["/t", ["/n", 7, 1.5, {"a": True}]]]],), methodresponse=True).encode()
STATUS = b"\0" * 12 + b"\0\0\0\0" + b"\1\0\0\0" + b"\0" * 8 + b"\1\0\0\0g" + b"\1" + b"\0\0\0\0"
RUN = {"host": "robot1", "playbook": "update.yml", "started": NOW, "outcome": "updated", "reason": "", "changed": 1}
EVENT = {
    "id": "a", "app": "sensor", "handoff": "drain", "outcome": "running", "reason": "", "from": "1", "to": "2",
    "started": 1.0, "finished": None, "phases": {"wait": 1.0}, "busy_wait": 0.5, "step": "sensor",
}  # fmt: skip
CONTRACT = {"revision": "1", "run": "1", "apps": ["a"], "proven": False, "soak": 1, "ends": 2, "ready_timeout": 9}
HISTORY = [{"revision": "0", "deployment": {"metadata": {"name": "a"}}}]
RECORD = {"data": {"contract.json": json.dumps(CONTRACT), "history.json": json.dumps(HISTORY)}}
UPDATES = {
    "metadata": {"name": "robot-updates", "namespace": "robot-robot1", "labels": {"rosops.fleet/robot": "robot1"}},
    "data": {"updates.json": json.dumps({"updates": [EVENT]})},
}
KEPT = {"metadata": {"name": kept.REF.name, "namespace": kept.REF.namespace}, "data": {"robot1": json.dumps(RUN)}}
BACK = {"metadata": {"annotations": {"rosops.fleet/went-back": json.dumps({"from": "1", "to": "0", "at": NOW})}}}
REST = {
    "space": "/",
    "windows": {"spans": [], "zone": "UTC", "turns": []},
    "when": [],
    "apps": {"a": {"when": [], "idle": []}},
}
IMAGES = {"images": [{"id": "sha256:1", "repoTags": ["a:1"], "repoDigests": ["a@sha256:1"]}]}
OBJECTS = {**a_fleet.OBJECTS, "ConfigMap": [KEPT, UPDATES]}
RECORDED = {
    "kind": recording.KIND, "version": recording.VERSION, "graph": {"services": {}, "actions": {}, **a_fleet.GRAPH},
    "apps": [{"name": "a", "placement": "local", "addresses": ["10.0.0.1"]}],
}  # fmt: skip
ACTION = {"/w": {"type": "a/B", "servers": ["/n"], "clients": [], "up": True, "goals": {"ACTIVE": 1}}}
KEPT_MEMORY = {
    "master": ["u", 1],
    "nodes": {"/n": {"uri": "http://a:1/", "pid": 1, "publications": {}, "subscriptions": {}, "services": {}}},
    "removed": {},
}
CLAIM = "pvc-3f_robot-robot1_logs-pvc"
DEFINITION = (
    "std_msgs/Header header\nfloat64[] x\nP p\n"
    + "=" * 80
    + "\nMSG: std_msgs/Header\nuint32 seq\n"
    + "=" * 80
    + "\nMSG: d/P\nstring s\n"
)
PEM = "-----BEGIN CERTIFICATE-----\nFw0yNjExMjYwODAwMDBaFw0yNzExMjYwODAwMDBa\n-----END CERTIFICATE-----\n"
FORMS_PLAIN = {
    name: form for name, form in formats.FORMS.items() if name not in ("unicode", "time-zone", "launch-file")
}

PARSERS: dict[str, Parser] = {
    "printable": Parser(printable, HARM, (), quiet, text),
    "json_of": Parser(json_of, (EVENT,), (ValueError,), spoil=json_text),
    "replies.loads": Parser(lambda said: str(replies.loads(said)), (XML,), (RosError, xmlrpc.client.Fault),
        spoil=octets),
    "replies.unwrap": Parser(replies.unwrap, ([1, "", 7],), (RosError,)),
    "replies.master_state": Parser(lambda said: replies.master_state(said, said).graph, ([[["/t", ["/n"]]], [],
        []],), (RosError,)),
    "replies.connections": Parser(replies.connections, ([[1, "/n", "o", "TCPROS", "/t", True]],)),
    "bus_stats.stats": Parser(stats, ([[["/t", 5, [[1, 2, 3, True]]]], [], []],), (RosError,)),
    "tcpros.decode_header": Parser(tcpros.decode_header, (tcpros.encode_header({"a": "b", "topic": "/t"})[4:],),
        (RosError,), spoil=octets),
    "tcpros.decode_status": Parser(tcpros.decode_status, (STATUS,), (RosError,), spoil=octets),
    "tcpros.goal_id": Parser(tcpros.goal_id, (STATUS,), (RosError,), spoil=octets),
    "messages.Definition": Parser(lambda said: Definition("d/T", said).decode(b"\0" * 40), (DEFINITION,),
        (RosError,), spoil=text),
    "messages.decode": Parser(Definition("d/T", DEFINITION).decode, (b"\0" * 40,), (RosError,), spoil=octets),
    "rpc.address_of": Parser(lambda said: rpc.address_of(said, "http"), ("http://robot1:11311/",), (RosError,),
        lambda found: 0 < found[1] < 65536, text),
    "graph_from": Parser(graph_from, ({**a_fleet.GRAPH, "actions": ACTION},), (ArithmeticError, AttributeError,
        KeyError, TypeError, ValueError)),
    "Reading.from_dict": Parser(graph, ({**a_fleet.GRAPH, "launched": [{"node": "/n", "host": "h",
        "crash": "x"}]},), (ArithmeticError, AttributeError, KeyError, TypeError, ValueError), quiet),
    "record_of": Parser(record_of, (RECORD,), spoil=within("contract.json", "data")),
    "events_of": Parser(lambda item: [closed(one, None) for one in events_of(item)], (UPDATES,),
        spoil=within("updates.json", "data")),
    "went_back": Parser(went_back, (BACK,), spoil=within("rosops.fleet/went-back", "metadata", "annotations")),
    "updates.parse": Parser(lambda said: updates.families(updates.parse(said)), ({"updates": [EVENT]},),
        spoil=json_text),
    "kept.last_runs": Parser(lambda item: kept.last_runs([item]), (KEPT,), spoil=within("robot1", "data")),
    "kept.last_steps": Parser(lambda item: kept.last_steps([item]), (UPDATES,), spoil=within("updates.json", "data")),
    "look.believed": Parser(cluster, (OBJECTS,), right=quiet),
    "look.usage_of": Parser(lambda line: look.usage_of({"robot1": {"stdout": line}}, ["robot1"]),
        (f"12\t/k3s/storage/{CLAIM}",), (),
        lambda found: found.keys() <= {key for key in found if key.startswith("robot-robot1/")}, text),
    "claims.sources": Parser(lambda name: sources({"robot1": [name]}, ["robot-robot1", "robot-robot2"],
        {"robot1": "robot-robot1"}), (CLAIM,), (), inside, text),
    "results.declared_in": Parser(results.declared_in, ({"outcome": "updated", "reason": "",
        "steps": [{"name": "a"}]},)),
    "results.message_of": Parser(results.message_of, ({"failed": True, "msg": "a", "results": [{"failed": True,
        "msg": "b"}]},), spoil=items),
    "rest_of": Parser(lambda item: door.rest_of(item, ""), ({"data": {door.REST_KEY: json.dumps(REST)}},),
        (SpecError,), spoil=within(door.REST_KEY, "data")),
    "memory.from_dict": Parser(lambda said: memory.from_dict(said, 0.0), (KEPT_MEMORY,)),
    "parameters_of": Parser(memory.parameters_of, (memory.parameters_text({"a": {"b": 1}}),), (RosError,
        xmlrpc.client.Fault), spoil=utf8),
    "sidecar.requested": Parser(request, (b"GET /stop HTTP/1.1\r\n\r\n",), (),
        lambda path: len(path) < sidecar.LONGEST, octets),
    "local_kubeconfig": Parser(lambda said: local_kubeconfig(said, "https://a:6443", "edge"), (K3S_YAML,),
        (SpecError,), kubeconfig_is_bare, text),
    "url_at": Parser(lambda said: url_at(said, "a"), (K3S_YAML,), (SpecError,),
        lambda url: re.fullmatch(r"https?://a:\d{1,5}", url) is not None, text),
    "node_images": Parser(node.node_images, (IMAGES,), (SpecError,), spoil=json_text),
    "node.present": Parser(node.present, (f"\n{node._BREAK}\n".join(("x86_64", json.dumps(IMAGES),
        "REF LABELS\na:1 x=y", "sha256:1", '{"containers": []}')),), (SpecError,), spoil=text),
    "Archive.images": Parser(packed, (b'[{"Config": "c.json", "RepoTags": ["a:1"], "Layers": []}]',), (SpecError,
        ValueError, KeyError, TypeError, AttributeError), spoil=octets),
    "recording.parts": Parser(lambda said: recording.parts(said, "x.json"), (RECORDED,), (SpecError,)),
    "launch_file.read": Parser(lambda said: launch_file.read("x.launch", said, {}),
        ('<launch><arg name="a"/><node pkg="p" type="t" name="n" args="$(arg a)"/></launch>',), (FleetError,),
        spoil=utf8),
    "formats.listed": Parser(formats.listed, ("[a, b]", "a, b"), (SpecError,), spoil=text),
    "formats.FORMS": Parser(lambda said: [name for name,
        form in FORMS_PLAIN.items() if form.test(said) and re.search(r"[\0-\x20\x7f]", said)], ("ros:noetic",
        "/dev/video0", "http://a:1", "robot-1", "10.0.0.0/8", "1Gi"), (), lambda wrong: wrong == [], text),
    "rotation.lives": Parser(lambda said: rotation.told(rotation.lives(said)), ({"agent/client-kubelet.crt":
        ["2027-03-01T08:00:00", "2027-11-26T08:00:00"]},), (SpecError,), quiet),
    "certificates.end_of": Parser(certificates.end_of, (PEM,), (),
        lambda end: re.fullmatch(r"(\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d)?", end) is not None, text),
    "machines.version": Parser(machines.version, ("v1.34.2-rc1+k3s1",), spoil=text),
    "machines.too_old": Parser(machines.too_old, ("(3, 7)",), spoil=text),
    "k3s.listed_sum": Parser(lambda said: k3s.listed_sum(said, "k3s", "x"), (f"{'a' * 64}  k3s\n",), (FleetError,),
        lambda digest: re.fullmatch("[0-9a-f]{64}", digest) is not None, text),
    "facts.filesystem_type": Parser(lambda said: facts.filesystem_type(said, "/var/lib"),
        ("/dev/sda1 / ext4 rw 0 0",), spoil=text),
    "preflight.comparable": Parser(peers, (FACTS,)),
    "secrets_in": Parser(lambda item: without(item, dict.fromkeys(secrets_in(item), "***")), ({"kind": "Secret",
        "data": {"a": "b"}, "x": json.dumps(EVENT)},)),
}  # fmt: skip


def value(name: str, seed: int) -> Any:
    """One for this parser; the same one for the same seed."""
    dice = random.Random(zlib.crc32(name.encode()) << 32 | seed)  # noqa: S311 - no secret
    parser = PARSERS[name]
    return (parser.spoil or spoilt)(dice, dice.choice(parser.good))
