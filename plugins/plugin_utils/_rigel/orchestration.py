# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a job of the orchestration plugin says, as variables of this collection."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from ansible_collections.rosops.fleet.plugins.plugin_utils._model.names import (
    MASTER_CONTAINER,
    claim_name,
    default_mount_path,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.application import (
    PROBED,
    App,
    Volume,
    Wishes,
    applications,
    label,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.part import (
    CHANGED,
    OPEN,
    SAME,
    TAKEN,
    Notes,
    Part,
)
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.rigelfile import Job
from ansible_collections.rosops.fleet.plugins.plugin_utils._rigel.watching import dashboards, watched

DEFAULT_CLASSES = ("standard", "hostpath")  # what minikube, kind and Docker Desktop call their own
OWN_MASTER = (["/ros_entrypoint.sh", "roscore"], ["roscore"])
NO_MASTER = "http://192.0.2.5:11311"  # of no network (RFC 5737)
ADDRESS = "external: the address of the ROS master that is there goes into ros_master_uri"


class Deployed(NamedTuple):
    """What a job deploys."""

    apps: list[App]
    volumes: list[dict[str, Any]]
    master: dict[str, Any]
    observability: dict[str, Any]
    dashboards: list[str]  # as the Rigelfile calls them


def deployed(job: Job, distro: str, image_runs: str, notes: Notes) -> Deployed:
    """The job, key by key."""
    given = Part(job.given, f"{job.path}.with", notes)
    part = given.part("orchestration")
    if "readiness" in given and "readiness" not in part:  # so in the dissertation's listing 5
        part.value["readiness"] = given.value.pop("readiness")
        given.say("readiness", TAKEN, "read as orchestration.readiness")
    given.end("the orchestration plugin has no such key")
    extra = part.part("additional_k8s_params")
    manifest = extra.part("application")
    volumes, claims = _volumes(part.part("persistent_storage"))
    image = part.text("application_image")
    found = Deployed(
        apps=applications(
            manifest,
            Wishes(
                name=_name(job, part, image, manifest),
                image=image,
                image_runs=image_runs,
                placement=_placement(part.part("distributed")),
                readiness=_readiness(part.part("readiness")),
                overlap=_overlap(part.part("rolling_update")),
                volumes=volumes,
            ),
        ),
        volumes=claims,
        master=_master(part, extra.part("ros_master"), distro, job),
        observability=watched(part),
        dashboards=dashboards(extra),
    )
    _others(part)
    extra.end("it is an object of its own; apply it with kubernetes.core.k8s in a playbook after rosops.fleet.site")
    part.end("the orchestration plugin has no such key")
    return found


def _others(part: Part) -> None:
    """Keys of later versions of the plugin."""
    part.leave("namespace", "each robot has its own, robot-<robot>", CHANGED)
    part.leave("observability_only", "ansible-playbook rosops.fleet.site --tags observability", CHANGED)
    results = part.part("results")
    source = results.text("source_path")
    if source:
        results.say(
            "source_path",
            CHANGED,
            f"{source}: ansible-playbook rosops.fleet.collect fetches what lies on a claim; have the app write there",
        )
    results.leave("container", "results are read from the claim, not out of a container", CHANGED)
    results.end("results have no such key")


def _name(job: Job, part: Part, image: str, manifest: Part) -> str:
    """The app's: as its Deployment is called, else by its job, and the job deploy_k8s by its image."""
    said = part.text("deployment_name")
    if said:
        part.say("deployment_name", TAKEN, f"the app {label(said)}")
        return label(said)
    of_job = label(job.name.replace("deploy_", "").replace("_k8s", "").replace("deploy", "").replace("k8s", ""))
    of_container = (str(one.get("image") or "") for one in containers_of(manifest.value))
    reference = image or next(filter(None, of_container), "")
    return of_job or label(reference.rpartition("/")[2].partition("@")[0].partition(":")[0]) or "ros-app"


def _placement(part: Part) -> str:
    enabled, remote, local = (part.take(key, bool) for key in ("enabled", "default_to_remote", "force_local_flag"))
    placement = "remote" if enabled and remote is not False and not local else "local"
    for key, value in (("enabled", enabled), ("default_to_remote", remote), ("force_local_flag", local)):
        if value is not None:
            part.say(key, TAKEN, f"placement: {placement} of the app")
    part.end("it says nothing about where an app runs")
    return placement


def _readiness(part: Part) -> App:
    command = part.text("command")
    found: App = {"command": command} if command else {}
    if command:
        part.say("command", TAKEN, "readiness.command of the app")
    seconds = part.take("timeout_seconds", int)
    if seconds:
        found["timeout"] = seconds
        part.say("timeout_seconds", TAKEN, "readiness.timeout of the app")
    for key in ("initial_delay_seconds", "period_seconds"):
        part.leave(key, PROBED, CHANGED)
    part.end("readiness has no such key")
    return found


def _overlap(part: Part) -> bool:
    """Whether the new version shall be there before the old one goes."""
    strategy, surge, away = part.text("strategy"), part.take("max_surge", int), part.take("max_unavailable", int)
    rolls = bool(strategy or surge is not None) and strategy.lower() != "recreate" and surge != 0
    if strategy:
        part.say("strategy", TAKEN, "handoff: overlap" if rolls else "handoff: replace, the default")
    if surge is not None:
        part.say(
            "max_surge",
            TAKEN if surge < 2 else CHANGED,
            "handoff: overlap is one more pod, none is replace; robots at a time are update_waves",
        )
    if away is not None:
        part.say(
            "max_unavailable",
            SAME if not away else CHANGED,
            "handoff: overlap takes no pod away before the new one is proven",
        )
    if rolls:
        part.say(
            "",
            OPEN,
            "say the app's pattern instead: pubsub, service, or action (whose goals are waited for: handoff drain)",
        )
    part.end("handoff says how a new version takes over")
    return rolls


def _volumes(storage: Part) -> tuple[tuple[Volume, ...], list[dict[str, Any]]]:
    volumes: list[Volume] = []
    claims: list[dict[str, Any]] = []
    for item in storage.parts("volumes"):
        given = item.text("name")
        name, size = label(given), item.text("size")
        mount = item.text("mountPath") or item.text("mount_path")
        if name != given:
            item.say("name", CHANGED, f"{name}, as Kubernetes takes no other letters; the claim is {claim_name(name)}")
            mount = mount or default_mount_path(given)
        else:
            item.say(
                "name",
                TAKEN,
                f"persistent_storage: the claim {claim_name(name)} for each robot, named in the app's volumes",
            )
        claim = {"name": name, **({"size": size} if size else {})}
        storage_class = item.text("storage_class")
        if storage_class in DEFAULT_CLASSES:
            item.say(
                "storage_class",
                CHANGED,
                f"left out: {storage_class} is a test cluster's; k3s has local-path, its default",
            )
        elif storage_class:
            claim["storage_class"] = storage_class
            item.say(
                "storage_class", OPEN, f"taken; your k3s needs a class {storage_class}, it brings local-path alone"
            )
        if size:
            item.say("size", TAKEN, "persistent_storage")
        if mount:
            claim["mountPath"] = mount
            item.say("mountPath", TAKEN, f"persistent_storage: {mount}")
        item.leave(
            "host_path",
            "claims lie below /var/lib/rancher/k3s/storage; a directory of the host's is host_paths of the app",
        )
        item.end("a volume has no such key")
        volumes.append(Volume(given, name, mount))
        claims.append(claim)
    storage.end("persistent storage has no such key")
    return tuple(volumes), claims


def _master(part: Part, manifest: Part, distro: str, job: Job) -> dict[str, Any]:
    wanted = part.take("deploy_ros_master", bool)
    image = part.text("ros_master_image")
    if image:
        part.say("ros_master_image", TAKEN, "ros_master_image")
    if wanted is False:
        uri = _address(job) or NO_MASTER
        part.say("deploy_ros_master", OPEN if uri == NO_MASTER else TAKEN, f"ros_master_mode: {ADDRESS} ({uri})")
        return {"ros_master_mode": "external", "ros_master_uri": uri}
    if wanted is not None:
        part.say("deploy_ros_master", TAKEN, "ros_master_mode: robot, one for each; shared is one for the fleet")
    spec = manifest.part("spec")
    template = spec.part("template")
    pod = template.part("spec")
    kept: list[Any] = []
    for container in pod.parts("containers"):
        name = container.text("name")
        if name not in (MASTER_CONTAINER, ""):
            container.say("", TAKEN, "ros_master_overrides")
            kept.append({"name": name, **container.value})
            continue
        own = container.text("image")
        if own:
            container.say("image", TAKEN, "ros_master_image")
        image = own or image
        words = [container.words(key) for key in ("command", "args")]
        if [*words[0], *words[1]] in OWN_MASTER:
            container.say("", SAME, "command and args: the collection runs roscore, with settings of its own")
        else:
            container.value.update({key: value for key, value in zip(("command", "args"), words, strict=True) if value})
        if container.value:
            for key in container.value:
                container.say(key, TAKEN, "ros_master_overrides")
            kept.append({"name": MASTER_CONTAINER, **container.value})
    inner = {**pod.value, **({"containers": kept} if kept else {})}
    for rest in (pod, template, spec, manifest):
        for key in rest.value:
            rest.say(key, TAKEN, "ros_master_overrides")
    outer = {**template.value, **({"spec": inner} if inner else {})}
    whole = {**spec.value, **({"template": outer} if outer else {})}
    overrides = {**manifest.value, **({"spec": whole} if whole else {})}
    image = image or (f"ros:{distro}-ros-core" if distro else "")
    return {
        "ros_master_mode": "robot",
        **({"ros_master_image": image} if image else {}),
        **({"ros_master_overrides": overrides} if overrides else {}),
    }


def _address(job: Job) -> str:
    """The master's address that the job gives its application, if it does."""
    extra = inside(job.given, "orchestration", "additional_k8s_params", "application")
    env = [item for one in containers_of(extra) for item in entries(one.get("env"))]
    return next((str(item.get("value") or "") for item in env if item.get("name") == "ROS_MASTER_URI"), "")


def containers_of(manifest: Any) -> list[Mapping[str, Any]]:
    """The containers of a part of a Deployment, whatever else may be wrong with it."""
    return entries(inside(manifest, "spec", "template", "spec", "containers"))


def entries(value: Any) -> list[Mapping[str, Any]]:
    """The mappings among a list's items."""
    return [item for item in value if isinstance(item, Mapping)] if isinstance(value, list) else []


def inside(value: Any, *keys: str) -> Any:
    """What stands below keys; None where something is in the way."""
    for key in keys:
        value = value.get(key) if isinstance(value, Mapping) else None
    return value
