# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The application of a job, a part of a Deployment, as items of `ros_apps`: one for each container."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.finding import Problem
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.merge import deep_merge
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import (
    APP_CONTAINER,
    LABEL_PLACEMENT,
    MASTER_PORT,
    claim_name,
    default_mount_path,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.secrets import is_secret
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import CHANGED, LEFT, OPEN, SAME, TAKEN, Part
from ansible_collections.rosops.fleet.plugins.plugin_utils._validate.app import name_is_lost

OURS = ("ROS_MASTER_URI", "ROS_IP", "ROS_HOSTNAME")
UNTOLD = "is text of the Rigelfile; move it into Ansible Vault (ansible-vault encrypt_string)"
PROBED = (
    "the collection's own probe: the app is ready at the first second at which readiness.command and the graph agree"
)

App = dict[str, Any]


class Volume(NamedTuple):
    """A claim of the job: as the Rigelfile calls it, as it is called here, and where apps find it."""

    given: str
    name: str
    mount_path: str


class Wishes(NamedTuple):
    """What the job says of its application beside the manifest."""

    name: str
    image: str
    image_runs: str  # what the image runs by itself, of the job `dockerfile`; empty where nobody says it
    placement: str
    readiness: Mapping[str, Any]
    overlap: bool
    volumes: tuple[Volume, ...]


def label(text: str, longest: int = 40) -> str:
    """The text as a name for Kubernetes; empty where nothing is left of it."""
    return re.sub(r"^[^a-z]+|[^a-z0-9]+$", "", re.sub(r"[^a-z0-9]+", "-", text.lower())[:longest])


def applications(manifest: Part, wishes: Wishes) -> list[App]:
    """The apps of the job. The container `ros-app` is the job's own; without any there is one all the same."""
    metadata, spec = manifest.part("metadata"), manifest.part("spec")
    metadata.leave("name", f"the app's name, here {wishes.name}, names the Deployment", CHANGED)
    metadata.leave("namespace", "each robot has its own, robot-<robot>", CHANGED)
    replicas = spec.take("replicas", int)
    if replicas not in (None, 1):
        spec.say(
            "replicas",
            LEFT,
            "a ROS node cannot run twice under its name; write one app for each, with its own node_name",
        )
    spec.leave("strategy", "handoff says how a new version takes over; see rolling_update", CHANGED)
    spec.leave("selector", "the collection's own labels find the pods", CHANGED)
    template = spec.part("template")
    pod = template.part("spec")
    placement = _placement(pod, wishes.placement)
    containers = list(pod.parts("containers")) or [
        Part({"name": APP_CONTAINER}, f"{pod.path}.containers[0]", pod.notes)
    ]
    volumes = {one.text("name"): one for one in pod.parts("volumes")}
    named = [(container.text("name") or APP_CONTAINER, container) for container in containers]
    if wishes.name in {label(name) for name, _value in named if name != APP_CONTAINER} and len(named) > 1:
        wishes = wishes._replace(name=f"{wishes.name}-app")
    made: list[App] = []
    for name, container in named:
        first = name == APP_CONTAINER or len(named) == 1
        app = _application(container, wishes if first else _beside(wishes, name), placement, volumes, first)
        made.append(app)
        container.say(
            "", TAKEN, f"the app {app['name']}" + ("" if first else ", on its own: each node is handed over by itself")
        )
    rest = _rest(metadata, spec, template, pod, volumes)
    manifest.end("a Deployment has no such key")
    if rest:
        made[0]["overrides"] = deep_merge(rest, made[0].get("overrides", {}))
    return made


def _beside(wishes: Wishes, name: str) -> Wishes:
    return wishes._replace(name=label(name), image="", image_runs="", readiness={}, volumes=wishes.volumes)


def _placement(pod: Part, said: str) -> str:
    selector = pod.part("nodeSelector")
    chosen = selector.text(LABEL_PLACEMENT)
    if chosen:
        selector.say(LABEL_PLACEMENT, TAKEN, f"placement: {chosen}")
    if selector.value:
        pod.value["nodeSelector"] = selector.value
    return chosen or said


def _application(container: Part, wishes: Wishes, placement: str, volumes: Mapping[str, Part], first: bool) -> App:
    app: App = {"name": wishes.name}
    image = container.text("image") or wishes.image
    app["image"] = image
    if not image:
        missing = Problem(container.at("image"), "is missing", "the image that the application runs in")
        container.notes.problems.append(missing)
    app.update(_words(container, wishes))
    env = _env(container)
    if env:
        app["env"] = env
    ports = _ports(container, placement)
    if ports:
        app["ports"] = ports
    app["placement"] = placement
    if wishes.overlap:
        app["handoff"] = "overlap"
    app.update(_mounts(container, wishes.volumes, volumes, first))
    readiness = _readiness(container, wishes)
    lost = "launch" not in app and name_is_lost([*app.get("command", []), *app.get("args", [])])
    if lost or not {"command", "args", "launch"} & {*app}:
        readiness["nodes"] = False
        why = lost or "nobody knows what the image runs"
        container.say(
            "",
            OPEN,
            f"readiness.nodes is false, as {why}; say what the app offers under readiness.topics, services or actions",
        )
    if readiness:
        app["readiness"] = readiness
    resources = container.take("resources", dict)
    if resources:
        kept = {key: value for key, value in resources.items() if key in ("requests", "limits")}
        container.say("resources", TAKEN, "resources of the app")
        app["resources"] = kept
    for probe in ("livenessProbe", "startupProbe"):
        container.leave(probe, "the collection's own: liveness_timeout begins a node anew that hangs", CHANGED)
    if container.value:
        for key in container.value:
            container.say(key, TAKEN, "overrides of the app")
        app["overrides"] = {
            "spec": {"template": {"spec": {"containers": [{"name": APP_CONTAINER, **container.value}]}}}
        }
    return app


def _words(container: Part, wishes: Wishes) -> App:
    """command and args, or the launch file that they start."""
    command, args = container.words("command"), container.words("args")
    if not command and not args and wishes.image_runs:
        args = shlex.split(wishes.image_runs)
        container.say(
            "args", TAKEN, "args are what the job dockerfile has the image run; the ROS node's name is added to them"
        )
    words = [*command, *args]
    programs = [word.rpartition("/")[2] for word in words]
    at = programs.index("roslaunch") if "roslaunch" in programs else -1
    if at >= 0 and len(words) > at + 1 and not any(word.startswith("-") for word in words[at + 1 :]):
        container.say("args", TAKEN, "launch, so that each node of the launch file is known")
        return {**({"command": words[:at]} if at else {}), "launch": _launch(words[at + 1 :])}
    found = {key: value for key, value in (("command", command), ("args", args)) if value}
    for key in found:
        if container.at(key) not in {note.path for note in container.notes.all}:
            container.say(key, TAKEN, f"{key} of the app")
    return found


def _launch(words: list[str]) -> App:
    given = dict(word.split(":=", 1) for word in words if ":=" in word)
    names = [word for word in words if ":=" not in word]
    files: App = {"file": names[0]} if len(names) == 1 else {"package": names[0], "file": names[1]}
    return {**files, **({"args": given} if given else {})}


def _env(container: Part) -> App:
    env: App = {}
    kept: list[Any] = []
    for item in container.parts("env"):
        name = item.text("name")
        if name in OURS:
            item.say("", SAME, f"{name} is set by the collection for every app")
        elif "value" in item:
            env[name] = item.text("value")
            item.say(
                "", OPEN if is_secret(name) else TAKEN, f"env.{name}" + (f"; it {UNTOLD}" if is_secret(name) else "")
            )
        else:
            source = item.value.get("valueFrom")
            key = source.get("secretKeyRef") if isinstance(source, Mapping) else None
            if isinstance(key, Mapping) and {"name", "key"} <= {*key}:
                env[name] = {"secret": key["name"], "key": key["key"]}
                item.say(
                    "", OPEN, f"env.{name}; the Secret {key['name']} has to be in the robot's namespace, robot-<robot>"
                )
            else:
                kept.append({"name": name, **item.value})
    if kept:
        container.value["env"] = kept
    return env


def _ports(container: Part, placement: str) -> list[App]:
    ports: list[App] = []
    for item in container.parts("ports"):
        port, name = item.take("containerPort", int), item.text("name")
        if port == MASTER_PORT:
            item.say(
                "", SAME, f"{port} is the ROS master's, which has a Service of its own; the app does not listen there"
            )
            continue
        one: App = {"name": label(name, 15) or f"port-{port}", "port": port}
        protocol, host_port = item.text("protocol"), item.take("hostPort", int)
        if protocol and protocol != "TCP":
            one["protocol"] = protocol
        if host_port and placement == "local":
            one["host_port"] = host_port
        elif host_port:
            item.say("hostPort", LEFT, "the app runs at the edge, where others may have the port; use node_port")
        item.say("", TAKEN, f"ports of the app; others reach it as {one['name']} of its Service")
        item.end("ports of an app have no such key")
        ports.append(one)
    return ports


def _mounts(container: Part, volumes: tuple[Volume, ...], pod_volumes: Mapping[str, Part], first: bool) -> App:
    """Mounts of claims and of the host's directories. The job's own container has every claim of the job."""
    paths: dict[str, str] = {}
    host_paths: list[App] = []
    kept: list[Any] = []
    for mount in container.parts("volumeMounts"):
        name, path = mount.text("name"), mount.text("mountPath")
        source = pod_volumes.get(name)
        claim = _claim(source)
        found = next(
            (one for one in volumes if claim_name(one.given) == claim or (one.given == name and not claim)), None
        )
        if found:
            paths[found.name] = path
            mount.say("", TAKEN, f"volumes of the app: {found.name}")
        elif source is not None and isinstance(source.value.get("hostPath"), Mapping):
            directory = source.value["hostPath"].get("path", "")
            host_paths.append(
                {"path": directory, "mount_path": path, "read_only": bool(mount.value.get("readOnly", False))}
            )
            mount.say("", TAKEN, f"host_paths of the app: {directory}")
        else:
            kept.append({"name": name, "mountPath": path, **mount.value})
    if kept:
        container.value["volumeMounts"] = kept
    mounts: list[App] = []
    for volume in volumes:
        if volume.name not in paths and not first:
            continue
        where = paths.get(volume.name, volume.mount_path)
        own = where and where != (volume.mount_path or default_mount_path(volume.name))
        mounts.append({"name": volume.name, **({"mount_path": where} if own else {})})
    return {key: value for key, value in (("volumes", mounts), ("host_paths", host_paths)) if value}


def _claim(source: Part | None) -> str:
    claim = source.value.get("persistentVolumeClaim") if source else None
    return str(claim.get("claimName", "")) if isinstance(claim, Mapping) else ""


def _readiness(container: Part, wishes: Wishes) -> App:
    readiness = dict(wishes.readiness)
    probe = container.part("readinessProbe")
    action = probe.part("exec")
    command = action.words("command")
    if command:
        readiness["command"] = command if len(command) > 1 else command[0]
        action.say("command", TAKEN, "readiness.command")
    for part in (action, probe):  # the dissertation's listing has the times within exec
        for key in ("initialDelaySeconds", "periodSeconds", "timeoutSeconds", "failureThreshold", "successThreshold"):
            part.leave(key, f"{PROBED}; readiness.timeout is how long that may take", CHANGED)
        part.end(
            "readiness asks by a command only; say it as readiness.command, or let readiness.topics or services say it"
        )
    return readiness


def _rest(metadata: Part, spec: Part, template: Part, pod: Part, volumes: Mapping[str, Part]) -> App:
    """What has no key of its own: the overrides of the Deployment."""
    known = {name for name, one in volumes.items() if _claim(one).endswith("-pvc") or "hostPath" in one.value}
    for name in known:
        volumes[name].say("", TAKEN, "the app's volumes or host_paths")
    others = [{"name": name, **one.value} for name, one in volumes.items() if name not in known]
    inner: App = {**pod.value, **({"volumes": others} if others else {})}
    for part in (metadata, spec, template, pod):
        for key in part.value:
            part.say(key, TAKEN, "overrides of the app")
    for one in others:
        pod.say("volumes", TAKEN, f"overrides of the app: {one['name']}")
    outer = {**template.value, **({"spec": inner} if inner else {})}
    whole = {**spec.value, **({"template": outer} if outer else {})}
    return {
        **({"metadata": metadata.value} if metadata.value else {}),
        **({"spec": whole} if whole else {}),
    }
