# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pod gets of the collection's own code: its ConfigMap, and the hooks, in the app's container or beside it.

The code is no part of a pod template: a newer collection restarts nothing. Beside an app whose image has no Python the
hooks are in a sidecar as Kubernetes means it, an init container that stays (KEP-753, from 1.29 on): the app's container
is started after it and ended before it, so that each start and each stop finds it there. Its image is the ROS master's.
"""

from __future__ import annotations

import functools
import json
import re
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from ...module_utils._pod import run
from ...module_utils._pod.exec import AFTER
from ...module_utils._pod.sidecar import PORT
from ...module_utils._step.objects import Object
from .._model import context, names
from .._model.app import App, Launch, Readiness
from .._model.context import Robot
from .common import FOR_EVER, ONE_HEAP, Files, config_map, mount, owner_labels
from .namespace import needs_fleet_namespace

IN_POD = ("app", "sidecar")  # where the code runs; a `gate` is looked at by the keeper, `none` by nobody
STARTED_TIMEOUT = 45  # s; `started` ends long before
COMMAND_TIMEOUT = 5  # s; Kubernetes' own 1 s is too short for a process that starts on a loaded robot
# Characters that only a shell gives a meaning: a readiness command with one of them is a script, else a path.
SHELL_CHARACTERS = frozenset(" \t\n;&|<>()$`\"'*?[]{}~#!\\")
BEGIN_TIMEOUT = 3600  # s, of a sidecar's start; then it is asked once more
# At rest a bare interpreter; a look at the graph, or a stop, is a second one for as long as it lasts.
SIDECARS = {"requests": {"cpu": "5m", "memory": "16Mi"}, "limits": {"memory": "96Mi"}}

# where the code appears in a container
CODE_MOUNT = mount(names.CODE_NAME, names.CODE_DIR, read_only=True)
MODULE_UTILS = Path(run.__file__).resolve().parents[1]
ROOMS = ("_common", "_ros", "_step", "_pod", "_exporter", "_robot")  # of module_utils, what has to run in pods
ENTRY, LAUNCH = "_pod.run", "_pod.launch"  # the latter runs by itself, on the image's own interpreter
SMALLEST = 9  # of zlib's levels
# Parsing all files costs every run a quarter of a second. Our own code has no other strings than these: a docstring by
# itself, a comment but for the licence, or a string that may look like these.
_TEXT = re.compile(
    r"""^([ \t]*)(\"{3}[\s\S]*?\"{3}) | [ \t]*(\#)(?!\ SPDX)[^\n]*
    | \"{3}[\s\S]*?\"{3} | '{3}[\s\S]*?'{3} | "(?:[^"\\\n]|\\.)*" | '(?:[^'\\\n]|\\.)*'""",
    re.MULTILINE | re.VERBOSE,
)


def code_command(word: str) -> list[str]:
    """A command of the in-pod code. Isolated: the image's Python variables and site packages do not matter to it."""
    return ["python3", "-I", "-S", f"{names.CODE_DIR}/run.py", word]


def begin_after(app: App, robot: Robot) -> list[str]:
    """Whose end the app's own command waits for: the old version's, where all versions share the node's name."""
    # with the host's network nobody can tell by its address whose a process is
    alone = app.handoff != "overlap" and app.readiness.nodes and not app.host_network
    return [AFTER, context.graph_node(app, robot)] if alone else []


# roslaunch's own interpreter, which may be one that nothing else of ours runs on
LAUNCHER = (
    "found=$(command -v roslaunch) || { "
    'echo "rosops.fleet: this image has no roslaunch, or /ros_entrypoint.sh is not in its command" >&2; exit 127; }; '
    f'exec $(sed -n "1s/^#!//p" "$found") -u {names.CODE_DIR}/_pod.launch.py "$@"'
)


def launch_args(launch: Launch, handoff: str) -> list[str]:
    """The arguments of an app that is a launch file, for `_pod/launch.py`."""
    overlap = ["--overlap", *(f"--replace={node}" for node in launch.replace)] if handoff == "overlap" else []
    package = [f"--package={launch.package}"] if launch.package else []
    return ["/bin/sh", "-c", literal(LAUNCHER), "roslaunch", *overlap, *package, *map(literal, launch.words)]


def literal(text: str) -> str:
    """As Kubernetes hands it on: $(NAME) is its own."""
    return text.replace("$", "$$")


def waits_for_the_old(deployment: Object) -> bool:
    """Whether its pod may start beside the one that it replaces; kept Deployments of earlier releases may not."""
    spec, ours = deployment["spec"]["template"]["spec"], [[*code_command(word), AFTER] for word in ("exec", "sidecar")]
    containers = [*(spec.get("initContainers") or []), *spec["containers"]]
    return any((one.get("command") or [])[: len(ours[0])] in ours for one in containers)


def code_volume(app: App | None = None) -> Object:
    """The code; for an app with its contract, which is there while a step of an update is under way."""
    maps: list[Object] = [{"name": names.CODE_NAME}]
    if app is not None:
        contract = {"key": "contract.json", "path": "contract.json"}
        maps.append({"name": names.update_name(app.name), "items": [contract], "optional": True})
    return {"name": names.CODE_NAME, "projected": {"sources": [{"configMap": item} for item in maps]}}


def probes(app: App) -> Object:
    """The fields of the app's container by which the kubelet asks whether it is ready, and tells it to stop.

    `started` looks every tenth of a second by itself and answers before its time-out, so that Kubernetes' one second
    does not count. Once it has passed the pod is ready and nothing of ours is started in it again: a robot at rest does
    not pay for being asked. What becomes of the node later is seen on the graph. The hooks beside an app are asked for
    the same moments. Without any of ours readiness.command is asked often until it has passed, then seldom.
    """
    asked = _own_question(app.readiness)
    found: Object = {}
    if asked:
        # once it has agreed it goes on for ever, so seldom
        seldom = {"periodSeconds": 10, "timeoutSeconds": COMMAND_TIMEOUT, "failureThreshold": 3}
        found["readinessProbe"] = {**asked, **seldom}
    if app.hooks == "sidecar":
        found["startupProbe"] = _startup(_asked("/started"), STARTED_TIMEOUT)
        found["lifecycle"] = {"preStop": _asked("/stop")}
    elif app.hooks == "app":
        found["startupProbe"] = _startup({"exec": {"command": code_command("started")}}, STARTED_TIMEOUT)
        found["lifecycle"] = {"preStop": {"exec": {"command": code_command("stop")}}}
    elif asked:
        found["startupProbe"] = _startup(asked, COMMAND_TIMEOUT)
    return found


def _own_question(readiness: Readiness) -> Object:
    """What the app says itself of being ready, as a probe has it; nothing where it is not asked."""
    if readiness.http:
        return {"httpGet": {"path": "/", **readiness.http}}
    return {"exec": {"command": probe_command(readiness.command)}} if readiness.command else {}


def sidecar(app: App, robot: Robot, environment: Sequence[Object]) -> Object:
    """The container; `environment` is what the hooks have to know. Once it has started, the app's own may begin."""
    return {
        "name": names.SIDECAR,
        "image": robot.master.image,
        "imagePullPolicy": "IfNotPresent",
        "restartPolicy": "Always",
        "command": [*code_command("sidecar"), *begin_after(app, robot)],
        "env": [*environment, ONE_HEAP],
        "resources": SIDECARS,
        "volumeMounts": [CODE_MOUNT],
        "startupProbe": _startup(_asked("/begin"), BEGIN_TIMEOUT),
    }


def probe_command(command: str | Sequence[str]) -> list[str]:
    """readiness.command as an exec command: a list and a path as they are, a script through a shell."""
    if isinstance(command, str):
        return ["/bin/sh", "-c", command] if SHELL_CHARACTERS & set(command) else [command]
    return [*command]


def _asked(path: str) -> Object:
    return {"httpGet": {"path": path, "port": PORT}}


def _startup(asked: Object, timeout: int) -> Object:
    return {**asked, "periodSeconds": 1, "timeoutSeconds": timeout, "failureThreshold": FOR_EVER}


# ---- the code itself


@functools.cache
def pod_files() -> Files:
    """File name -> content of what pods mount: what is started by its path as text, all other modules in one archive.

    Each byte is held in etcd for every robot, and in its pods. Another zlib may make other bytes of the same sources:
    then the ConfigMap changes, and nothing else.
    """
    paths = (path for room in ROOMS for path in MODULE_UTILS.joinpath(room).glob("*.py"))
    sources = {f"{path.parent.name}.{path.stem}": bare(path.read_text("utf-8")) for path in paths}
    plain: Files = {"run.py": sources.pop(ENTRY), f"{LAUNCH}.py": sources.pop(LAUNCH)}
    return {**plain, run.ARCHIVE: packed(sources)}


def packed(sources: Mapping[str, str]) -> bytes:
    """Module -> source, as the file that `run.py` reads."""
    made = zlib.compressobj(SMALLEST, zlib.DEFLATED, run.GZIP)
    return made.compress(json.dumps(sources, sort_keys=True).encode()) + made.flush()


def bare(text: str) -> str:
    """A source without docstrings and comments, a third of what it packs to; each line keeps its number."""

    def kept(found: re.Match[str]) -> str:
        indent, docstring, comment = found.groups()
        return f'{indent}""' + "\n" * docstring.count("\n") if docstring else "" if comment else found[0]

    return _TEXT.sub(kept, text)


def code_maps(robot: Robot, code: Files) -> list[Object]:
    """The ConfigMaps `rosops-code`, one per namespace. Where no pod has our code, one of a version before may."""
    owners = {robot.namespace: robot.name, **({names.FLEET_NAMESPACE: None} if needs_fleet_namespace(robot) else {})}
    return [config_map(names.CODE_NAME, place, owner_labels(owner), code) for place, owner in owners.items()]
