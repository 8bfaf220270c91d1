# SPDX-License-Identifier: GPL-3.0-or-later
"""The decisions within one step of an update: what must hold, what forbids it, what to apply. Pure."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from ...module_utils._ros import contract as ros_contract
from ...module_utils._ros.contract import NOTHING, Contract
from ...module_utils._ros.graph import Graph, NodeKey, host_of
from ...module_utils._ros.names import is_keeper, is_tool
from ...module_utils._step.objects import address_of, app_of, crashes
from ...module_utils._step.record import Record
from ...module_utils._step.rest import actions_to_rest, own_nodes
from .._images.archive import normal_ref
from .._model import names
from .._objects.placement import is_placed
from .nodes import Launched, Succession, allowed, obstacle, succession
from .plan import Step
from .world import Calm, Live, Object

AGAIN_AND_AGAIN, SHORT_LIFE = 3, 10.0  # restarts of a container, and seconds
EVER = "1970-01-01T00:00:00+00:00"
LISTS = ("nodes", "topics", "services", "actions", "absent", "edges")
NO_GRAPH = Graph()
HELD_TO_PROVEN = "the next version is held to what was proven of this one"


@dataclass(frozen=True)
class Gate:
    """What is known before a step."""

    contracts: Mapping[str, Contract]  # app -> its part of the graph, under the names of the new revision
    problems: Sequence[str]  # that forbid the step
    warnings: Sequence[str]
    calm: Calm  # what it waits for; an action's `server` stands where the step replaces it
    allowed: Sequence[str] = ()  # what the step would let change, in words
    nodes: Collection[str] = ()  # of which the rates have to be known
    succession: Succession = field(default_factory=Succession)  # what is called otherwise afterwards
    untold: Mapping[str, str] = field(default_factory=dict)  # nodes of which a rate cannot be told -> why, in words


def step_gate(step: Step, graph: Graph, live: Live, images: Mapping[str, Collection[str]] | None = None) -> Gate:
    """`images` is edge host -> full names of its images."""
    own = own_nodes(step.old_nodes, graph, live.pods, {app: launch.old for app, launch in step.launched.items()})
    nodes = {node for found in own.values() for node in found}
    recorded = [node for app, found in own.items() if app not in step.unproven for node in found]
    records = live.records
    for app, found in own.items():
        graph = ros_contract.as_before(graph, found, _sent_before(step, app, records))
    proven = _proven(step, records)
    # an app that is down at this moment shows nothing to hold the next version to; what was proven of it does
    silent = {
        app: [node for node in one.contract.all_nodes if not graph.node(node).reachable] for app, one in proven.items()
    }
    down = {app: nodes for app, nodes in silent.items() if nodes}
    kept = {app: records.get(app, Record()).contract for app in step.unproven}
    kept |= {app: proven[app].contract.owed(step.intended) for app in down}
    follows = _succession(step, graph, own, kept)
    resting = actions_to_rest(graph, nodes, step.rest)
    return Gate(
        _contracts(step, graph, own, kept, follows),
        [*_problems(step, graph, own), *_images_missing(step, images or {})],
        [
            *(f"{', '.join(missing)} of {app} does not answer: {HELD_TO_PROVEN}" for app, missing in down.items()),
            *_nameless(graph, live.pods),
        ],
        Calm([*resting, *_silent(proven, live.pods, graph)], step.when, step.windows),
        [*allowed(graph, sorted(nodes), step.intended), *_outage(step, own)],
        ros_contract.rated(graph, recorded, step.intended),
        follows,
        ros_contract.untold(graph, recorded, step.intended),
    )


def _proven(step: Step, records: Mapping[str, Record]) -> dict[str, Record]:
    """App -> what was proven of the version that is to be replaced, or found good by its run."""
    found = {app: records[app] for app in step.apps if app in records and app not in step.unproven}
    return {
        app: record
        for app, record in found.items()
        if (record.proven or record.soak) and record.revision == step.before.get(app, {}).get("revision")
    }


def _sent_before(step: Step, app: str, records: Mapping[str, Record]) -> Contract:
    """What the version that is to be replaced owes, or was recorded of it for a next one that was taken back."""
    record, revision = records.get(app, Record()), step.before.get(app, {}).get("revision")
    known = {record.revision, *(entry.get("revision") for entry in record.history[:1])}
    return record.contract if revision in known else NOTHING


def _silent(proven: Mapping[str, Record], pods: Sequence[Object], graph: Graph) -> list[dict[str, str]]:
    """Actions that its apps were proven to serve and nobody serves now: unknown, and unknown waits.

    A pod that crashes again and again serves none, and nobody waits for one that is not there.
    """
    own = {app: [pod for pod in pods if app_of(pod) == app] for app in proven}
    may_come = [app for app, there in own.items() if there and not any(map(_ends_at_once, there))]
    known = {action for app in may_come for part in proven[app].contract.parts for action in part.actions}
    served = {
        name for name, action in graph.actions.items() if any(not graph.at(one).refused for one in action.servers)
    }
    return [{"name": name} for name in sorted(known - served)]


def _ends_at_once(pod: Object) -> bool:
    """A container of it ended again and again, the last time within some seconds of its start: it took no goal."""
    found = [one for one in (pod.get("status") or {}).get("containerStatuses") or [] if crashes(pod)]
    lives = [one["lastState"]["terminated"] for one in found if (one.get("lastState") or {}).get("terminated")]
    often = any(int(one.get("restartCount") or 0) >= AGAIN_AND_AGAIN for one in found)
    # no time at all where it never ran
    times = [[datetime.fromisoformat(life.get(key) or EVER) for key in ("startedAt", "finishedAt")] for life in lives]
    return often and any((end - start).total_seconds() < SHORT_LIFE for start, end in times)


def _succession(step: Step, graph: Graph, own: Mapping[str, Sequence[str]], kept: Mapping[str, Contract]) -> Succession:
    """Of all its apps. Of what nobody has proven the contract names the nodes, and not the graph."""
    found = Succession(step.renames)
    for app, launch in step.launched.items():
        if app in kept:
            new = _since(kept[app], launch).nodes.values()
            found |= Succession({node.removesuffix(launch.new) + launch.old: node for node in new})
        else:
            found |= succession(launch, own.get(app, ()), [*graph.topics, *graph.services])
    return found


def _contracts(
    step: Step, graph: Graph, own: Mapping[str, Sequence[str]], kept: Mapping[str, Contract], follows: Succession
) -> dict[str, Contract]:
    """App -> its part of the graph, under the names that the new revision will have.

    Where a step was cut off, or its way back was, the old nodes are gone or going, so what was recorded when it began
    counts. The master's part is everything that is registered with it. What the pod's own probe has no word on stands
    in `others`: nodes beside that of the app's name, and those that begin when the old ones have ended.
    """
    if step.kind == "master" and not step.unproven:
        return {app: ros_contract.record(graph, graph.names) for app in step.apps}
    renames = {kept[app].node: new for app, new in step.new_nodes.items() if app in kept and kept[app].node and new}
    for app, launch in step.launched.items():
        if app in kept:
            renames |= _since(kept[app], launch).renames
    return {
        app: kept[app].renamed(renames) if app in kept else _recorded(step, graph, app, own.get(app, []), follows)
        for app in step.apps
    }


def _since(contract: Contract, launch: Launched) -> Succession:
    """From the names in a contract, which are those of the revision that it was made for."""
    revision = f"_{contract.revision}"
    suffixed = any(node.endswith(revision) for node in contract.all_nodes)
    return _names_in(contract, replace(launch, old=revision if suffixed else ""))


def _names_in(contract: Contract, launch: Launched) -> Succession:
    there = [name for part in contract.parts for name in (*part.topics, *part.services, *part.subscriptions)]
    return succession(launch, contract.all_nodes, there)


def _recorded(step: Step, graph: Graph, app: str, nodes: Sequence[str], follows: Succession) -> Contract:
    first, launch = step.old_nodes.get(app), step.launched.get(app)
    if launch:
        judged = [node for node in nodes if not (launch.new and launch.is_held(node))]
    else:
        judged = [node for node in nodes if node == first and graph.named(node)] or list(nodes)
    others = [node for node in nodes if node not in judged]
    meant = step.intended
    if first in meant.on_demand or (launch and launch.on_demand):  # then all that its launch file starts is
        meant = replace(meant, on_demand=(*meant.on_demand, *nodes))
    contract = ros_contract.record(graph, judged, follows.renames, intended=meant)
    beside = ros_contract.record(graph, others, follows.renames, intended=meant)
    return replace(contract, others=beside) if others else contract


def _outage(step: Step, own: Mapping[str, Sequence[str]]) -> list[str]:
    """Which nodes of launch files are away for a moment, in words."""
    return [
        f"{node} is away from its end until its next version has begun: it is in launch.replace of {app}"
        for app, launch in step.launched.items()
        for node in own.get(app, ())
        if launch.new and launch.is_held(node)
    ]


def _problems(step: Step, graph: Graph, own: Mapping[str, Sequence[str]]) -> list[str]:
    """What forbids the step, seen on the graph before anything is touched."""
    problems = []
    for app, launch in step.launched.items():
        judged = launch.new and not launch.on_demand and app not in step.unproven
        for node in own.get(app, ()) if judged else ():
            why = "" if launch.is_held(node) or launch.may_overlap(node) else obstacle(graph, node)
            if why:
                problems.append(
                    f"{node} {why}: list {launch.plain(node)} in launch.replace of {app}, or in launch.overlap if two "
                    "of it do no harm"
                )
    for app, node in step.new_nodes.items():
        there = graph.node(node)
        if there.reachable and node != step.old_nodes.get(app) and app not in step.unproven:
            problems.append(
                f"another node is up under the name {node} that the new revision of {app} will have ({there.uri}); "
                "stop it, or change node_name"
            )
    return problems


def _nameless(graph: Graph, pods: Iterable[Object]) -> list[str]:
    """Nodes of apps that have a name as tools have it: what they subscribe to may be lost."""
    apps = {address_of(pod): app_of(pod) for pod in filter(address_of, pods)}
    return [
        f"{name} of {apps[host]} has an anonymous name, as a tool that somebody has open: nobody waits for it as a "
        "subscriber. Give it a name (__name:=)"
        for name in graph.names
        if (host := host_of(graph.node(name).uri)) in apps and is_tool(name) and not is_keeper(name)
    ]


def new_actions(step: Step, graph: Graph, pods: Iterable[Object]) -> list[dict[str, str]]:
    """What has to be idle before the step's new version goes again."""
    own = own_nodes(step.new_nodes, graph, new_pods(step, pods))
    return actions_to_rest(graph, {node for found in own.values() for node in found})


def is_dead(step: Step, pods: Iterable[Object]) -> bool:
    """Whether no container of the new version runs."""
    return not any("running" in (container.get("state") or {}) for container in new_containers(step, pods))


def new_containers(step: Step, pods: Iterable[Object]) -> list[Object]:
    statuses = ((pod.get("status") or {}).get("containerStatuses") or () for pod in new_pods(step, pods))
    return [container for found in statuses for container in found]


def new_pods(step: Step, pods: Iterable[Object]) -> list[Object]:
    revisions = {app: after["revision"] for app, after in step.after.items()}
    labels = names.LABEL_APP, names.LABEL_REVISION
    return [pod for pod in pods if tuple(pod["metadata"]["labels"].get(label) for label in labels) in revisions.items()]


def at_work(graph: Graph, rest: Iterable[Object]) -> bool:
    """Whether any of these actions was busy, or told nothing, when the graph was recorded."""
    found = [graph.actions.get(one["name"]) for one in rest]
    return any(action is None or action.busy or not action.up for action in found)


def with_rates(graph: Graph, rated: Graph) -> Graph:
    """The graph with the rates that were measured of some nodes at another time, wherever those nodes are now."""

    def now(found: Mapping[NodeKey, float]) -> dict[NodeKey, float]:
        return {graph.node(key.name).key: hz for key, hz in found.items()}

    topics = {}
    for name, topic in graph.topics.items():
        found = rated.topic(name)
        rates = {**topic.rates, **now(found.rates)}
        unsteady = {**now(found.unsteady), **topic.unsteady}
        topics[name] = replace(
            topic,
            rates=rates,
            unsteady={key: hz for key, hz in unsteady.items() if key not in rates},
            latched=tuple(sorted({*topic.latched, *(graph.node(key.name).key for key in found.latched)})),
        )
    return replace(graph, topics=topics)


def images_of(step: Step, placement: str) -> list[str]:
    """Of its pods that are placed so: on the robot's own node (`local`), or on any of the edge hosts (`remote`)."""
    pods = [item["spec"]["template"]["spec"] for item in step.workloads]
    placed = [pod for pod in pods if is_placed(pod, placement)]
    found = [one["image"] for pod in placed for one in [*(pod.get("initContainers") or []), *pod["containers"]]]
    return list(dict.fromkeys(found))


def _images_missing(step: Step, present: Mapping[str, Collection[str]]) -> list[str]:
    """Images of remote pods that an edge host lacks. A remote pod may be placed on any of them."""
    lacking = {
        image: [host for host, images in present.items() if normal_ref(image) not in images]
        for image in images_of(step, "remote")
    }
    return [f"the image {image} is not on {', '.join(hosts)}" for image, hosts in lacking.items() if hosts]


# --- what has to hold afterwards ------------------------------------------------------------------------------------


def proof(step: Step, gate: Gate, tolerance: float) -> Object:
    """Options of ros_ready: the contracts are restored, and the new revisions' own readiness holds."""
    old, new = {*step.old_nodes.values(), *gate.succession.nodes}, {*step.new_nodes.values()}
    gone = sorted(old - new - {*gate.succession.nodes.values()} - {""})
    more = [step.conditions, {"absent": gone if step.handoff == "overlap" else ()}]
    return _united(gate.contracts.values(), tolerance, more)


def proves_nothing(conditions: Object) -> bool:
    """Whether all of it holds of any version that leaves: nothing was recorded, and nothing is promised."""
    return not any(conditions.get(key) for key in LISTS if key != "absent")


def proof_of_old(step: Step, gate: Gate) -> Object:
    """The same after a way back: the contracts hold under the old names, whatever the new revision promised.

    Rates are left out: there is no third version to go to from an old one that is slower than it was.
    """
    old = {new: before for before, new in {**step.intended.renamed, **step.renames}.items()}
    for app, launch in step.launched.items():
        contract = gate.contracts.get(app, NOTHING)
        old |= _names_in(contract, replace(launch, old=launch.new, new=launch.old)).renames
    return ros_contract.unstreamed(_united(one.renamed(old) for one in gate.contracts.values()))


def _united(contracts: Iterable[Contract], tolerance: float | None = None, more: Sequence[Object] = ()) -> Object:
    found: dict[str, list[Any]] = {key: [] for key in LISTS}
    for part in [*more, *(ros_contract.conditions(part, tolerance) for one in contracts for part in one.parts)]:
        for key in LISTS:
            found[key] += [item for item in part.get(key) or [] if item not in found[key]]
    return found
