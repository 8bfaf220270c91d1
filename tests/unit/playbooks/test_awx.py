# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbooks as AWX runs them: surveys, cancels, slices, two jobs at once, from an empty home."""

from __future__ import annotations

import base64
import itertools
import json
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.common import made
from ansible_collections.rosops.fleet.plugins.plugin_utils._objects.rights import cluster_objects, controller_access
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import SUDO, Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import APP, path_of, runs
from ansible_collections.rosops.fleet.tests.unit.playbooks.test_outcomes import until
from ansible_collections.rosops.fleet.tests.unit.plugins.action.actions import SPACES, allows
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server
from awx_job import IDLE, Ended, Job, Template

LEASE = "/apis/coordination.k8s.io/v1/namespaces/robot-robot1/leases/robot-update"
PATH = re.compile(
    r"/api(s/(?P<group>[^/]+))?/v1(/namespaces/(?P<space>[^/]+)(?=/))?/(?P<resource>[a-z]+)(/(?P<name>[^/]+)(?P<part>/[a-z]+)?)?"
)
VERBS = {"PATCH": ("patch", "create"), "PUT": ("update",), "POST": ("create",), "DELETE": ("delete",)}
Launch = Callable[..., Job]


@pytest.fixture
def launch(server: Server, control: Control, tmp_path: Path) -> Iterator[Launch]:
    """Starts jobs of a fleet of one edge host and two robots; whatever still runs in the end is killed.

    None may be as silent as AWX's idle time-out, at the verbosity that a template has: 0.
    """
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    told = yaml.safe_load((control.folder / "hosts.yml").read_text())["all"]
    variables = {**told["vars"], "ros_apps": [APP], "ros_app_rollout_timeout": 1}
    groups = {"edge": ["edge2"], "robots": ["robot1", "robot2"]}
    hosts = {**told["children"]["edge"]["hosts"], **told["children"]["robots"]["hosts"]}
    known = {name: {**variables, **hosts[name]} for names in groups.values() for name in names}
    inventory: dict[str, Any] = {
        "_meta": {"hostvars": known},
        "all": {"children": list(groups)},
        **{name: {"hosts": names} for name, names in groups.items()},
    }
    numbers, started = itertools.count(1), list[Job]()

    def start(playbook: str, variables: dict[str, Any] | None = None, limit: str = "robots", **more: Any) -> Job:
        more["limit"] = limit  # the edge's images are another test's
        job = Job(tmp_path / f"awx_{next(numbers)}", Template(playbook, inventory, variables or {}, **more))
        started.append(job)
        return job

    yield start
    for job in started:
        ended = job.ended or job.cancel()
        print(f"longest silence of {job.template.playbook}: {ended.silence:.1f} s")
        assert ended.silence < IDLE
        assert "errantly" not in ended.output  # ansible-core's word for what a worker writes beside its lines


def words(ended: Ended) -> dict[str, str]:
    print(ended.output)
    return ended.outcomes


def test_whatever_a_survey_answers_is_taken_and_the_canary_is_always_the_same(server: Server, launch: Launch) -> None:
    """Texts, numbers and nothing. It cannot be done here, so that the second wave is not begun."""
    for name in ("robot1", "robot2"):
        runs(server, name)
    said = {"update_waves": "1, 100%", "update_failure_budget": "0", "update_busy_timeout": 5.5}
    ended = launch("update", {**said, "update_apps": "[talker]", "update_to": "", "update_remove_apps": ""}).finish()
    assert words(ended) == {"robot1": "failed", "robot2": "unchanged"}
    assert "report: fleet_outcomes, an artifact of this job" in ended.output
    assert "not begun" in ended.artifacts["fleet_outcomes"]["robot2"]["reason"]
    assert (ended.status, ended.code) == ("failed", 2)


@pytest.mark.parametrize("playbook", ["site", "update", "rollback", "status"])
def test_what_awx_keeps_of_a_job_has_no_secret_at_the_most_verbosity(
    server: Server, launch: Launch, playbook: str
) -> None:
    """Its output, its artifacts, and of each event what callbacks were told of a task."""
    hush = [f"Hush{number}in" for number in range(4)]
    app = {
        **APP,
        "env": {"MQTT_PASSWORD": hush[0]},
        "params": {"cloud/token": hush[1]},
        "files": [{"path": "/etc/broker.conf", "content": f"password={hush[2]}\n"}],
    }
    login = {"name": "pull", "registry": "r.example", "username": "robot", "password": hush[3]}
    runs(server, "robot1")
    own = {"ros_apps": [app], "robot_namespace_pull_secrets": [login]}
    ended = launch(playbook, own=own, limit="robot1", tags="namespace,master,apps", verbosity=4).finish()
    assert len(ended.events) > 5, ended.output
    kept = {"output": ended.output, "artifacts": json.dumps(ended.artifacts)}
    for number, event in enumerate(ended.events):
        kept[f"{number}: {event['event']}: {event.get('event_data', {}).get('task')}"] = json.dumps(event)
    forms = [form for one in hush for form in (one, base64.b64encode(one.encode()).decode().rstrip("=")[:-1])]
    assert {where for where, text in kept.items() if any(form in text for form in forms)} == set()


def test_an_update_of_many_short_waits_says_where_it_stands(server: Server, launch: Launch) -> None:
    """None of them is so long that it speaks for itself: an API that is slow until that is said."""

    def slow(_path: str) -> int:
        time.sleep(0 if "now: robot1: " in job.output else 1.1)
        return 0

    runs(server, "robot1")
    job = launch("update", limit="robot1")
    server.refuse = slow
    ended = job.finish()
    assert words(ended) == {"robot1": "failed"}
    assert re.search(r"the robot's steps: goes on for \d+ s now: robot1: ", ended.output)


def test_what_cannot_be_meant_is_refused_with_words(server: Server, launch: Launch) -> None:
    answers = {"update_waves": "all", "update_busy_timeout": "", "awx_workflow_job_name": "update"}
    ended = launch("update", answers).finish()
    assert (ended.status, ended.code) == ("failed", 2)
    for word in (
        "update_waves: has 'all'; allowed: numbers above 0 and percentages",
        "update_busy_timeout: is empty (null); allowed: a number, 0 or more",
        "named as its job template, update, which AWX does where it slices one",
    ):
        assert word in ended.output
    assert server.requests.empty()


def holder(server: Server) -> str:
    """Who changes robot1."""
    return str((server.find(LEASE) or {}).get("spec", {}).get("holderIdentity", ""))


def test_two_jobs_do_not_change_one_robot_and_one_that_was_cancelled_blocks_nobody_for_longer_than_its_lease(
    server: Server, launch: Launch
) -> None:
    """By SIGKILL of all of it: nobody lets the robot go. Meanwhile another job waits, and says for what."""
    said = {"ros_app_rollout_timeout": 300}
    first = launch("site", said, tags="namespace,master,apps", limit="robot1", name="fleet site")
    until(lambda: bool(server.find(path_of("Deployment", "robot-robot1", "talker"))))
    second = launch("update", {"update_on_busy": "defer"}, limit="robot1").finish()
    assert first.running
    assert words(second) == {"robot1": "deferred-busy"}
    reason = second.artifacts["fleet_outcomes"]["robot1"]["reason"]
    assert re.search(r"AWX job 1 \(fleet site\), .* let that run end", reason)
    assert first.cancel().artifacts == {}
    assert holder(server)
    third = launch("update", limit="robot1").finish()
    assert "waits whether the run of" in third.output
    assert set(words(third)) == {"robot1"}
    assert not holder(server)


def test_become_does_not_reach_the_control_node(control: Control, launch: Launch) -> None:
    """Every job here has --become. A `sudo` of the control node would say so; the robots' is another one."""
    control.write(
        "sudo", SUDO.replace("shift\nexec", f'shift\necho "$SSH_HOST" >> {control.folder}/became\nexec'), 0o755
    )
    ended = launch("status", {"status_html": str(control.folder / "page.html")}).finish()
    assert "sudo" not in ended.output
    assert (control.folder / "page.html").stat().st_uid == Path(control.folder).stat().st_uid


Asked = tuple[str, str, str, str, str]  # verb, group, resource, namespace, name


def asked(server: Server, there: set[str]) -> set[Asked]:
    """All that was asked of the API, as its authorizer sees it: a namespace is in itself, a list of one name is of it.

    What is `there`, by its path, is applied and not made.
    """
    found = []
    while not server.requests.empty():
        path, query, _headers = server.requests.get()
        named = query.get("fieldSelector", "").partition("metadata.name=")[2]
        found.append((path, ("watch",) if "watch" in query else (), named))
    for method, path in (line.split() for line in server.writes):
        found.append((path, ("patch",) if path in there else VERBS[method], ""))
    places = [(PATH.fullmatch(path), verbs, named) for path, verbs, named in found]
    return {
        (
            verb,
            place["group"] or "",
            place["resource"] + (place["part"] or ""),
            place["space"] or (place["name"] if place["resource"] == "namespaces" else "") or "",
            place["name"] or named,
        )
        for place, verbs, named in places
        if place
        for verb in verbs or (("get",) if place["name"] else ("list",))
    }


def test_a_token_is_enough_for_the_cluster_and_nothing_is_left(
    server: Server, control: Control, launch: Launch
) -> None:
    """No kubeconfig, no server that could be asked over SSH."""
    for name in ("robot1", "robot2"):
        runs(server, name, "x.example/talker:1")
    there = set[str]()
    for item in [*cluster_objects(), *controller_access(SPACES), *(made("v1", "Namespace", name) for name in SPACES)]:
        place = Ref(item["kind"], item["metadata"]["name"], item["metadata"].get("namespace", "")).path
        there.add(place)
        server.put(place, item)  # as `awx_access` leaves them
    (control.folder / "k3s.yaml").unlink()
    credential = {"K8S_AUTH_HOST": server.url, "K8S_AUTH_API_KEY": "very-secret", "K8S_AUTH_VERIFY_SSL": "False"}
    ended = launch("update", credential=credential).finish()
    assert words(ended) == {"robot1": "updated", "robot2": "updated"}  # what no pod notices
    assert "192.0.2.2" not in control.asked
    seen = asked(server, there)
    wanted = {("list", "apps", "deployments", ""), ("update", "coordination.k8s.io", "leases", "robot-update")}
    assert {(verb, group, kind, "robot-robot1", name) for verb, group, kind, name in wanted} <= seen
    assert [one for one in seen if not allows(*one)] == []
    assert "very-secret" not in ended.output
    assert "very-secret" not in json.dumps(ended.artifacts)


def test_the_account_s_token_is_kept_until_it_nears_its_end(server: Server, launch: Launch, tmp_path: Path) -> None:
    for name in ("robot1", "robot2"):
        runs(server, name)
    server.put("/api/v1/namespaces/kube-node-lease", {"metadata": {}})
    server.put("/api/v1/namespaces/kube-system/configmaps/kube-root-ca.crt", {"data": {"ca.crt": "authority"}})
    said = {"awx_access_dir": str(tmp_path / "access"), "awx_access_days": 30}
    made = launch("awx_access", said, limit="all").finish()
    print(made.output)
    place = tmp_path / "access" / "edge.yaml"
    ends = time.strftime("%Y-%m-%d", time.gmtime(time.time() + 30 * 86400))
    assert f"{place}: its token ends on {ends}" in made.output
    before = place.read_text()
    assert "changed=0" not in next(line for line in made.output.splitlines() if line.startswith("edge2 "))
    again = launch("awx_access", said, limit="all").finish()
    assert "changed=0" in next(line for line in again.output.splitlines() if line.startswith("edge2 "))
    assert place.read_text() == before
