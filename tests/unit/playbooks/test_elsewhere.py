# SPDX-License-Identifier: GPL-3.0-or-later
"""Access over SSH as a run gets it: ansible-playbook itself, a program in the place of ssh, an API on loopback."""

from __future__ import annotations

import re
import threading
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import Run
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._kube.kube_server import Server

EDGES = ("192.0.2.1", "192.0.2.2", "192.0.2.3")


def tokens(server: Server) -> set[Any]:
    return {headers.get("authorization") for _path, _query, headers in list(server.requests.queue)}


def test_the_robots_of_a_limit_fetch_it_once_from_a_living_server_outside_of_it(
    server: Server, control: Control
) -> None:
    robots = ("robot1", "robot2", "robot4")
    done = control.run("--limit", ",".join(robots), "-vvvvv", K8S_AUTH_API_KEY="left in a shell")
    assert done.returncode == 0
    assert [host for host in control.asked if host in EDGES] == ["192.0.2.1", "192.0.2.2"]
    assert tokens(server) == {"Bearer very-secret"}
    assert len([write for write in server.writes if "namespaces/robot-robot" in write]) >= len(robots)
    said = {line for line in done.stdout.splitlines() if line.startswith("cluster edge: ")}
    assert said == {f"cluster edge: {server.url} (from the cluster's own server)"}
    assert "very-secret" not in done.stdout + done.stderr
    assert control.left() == []
    assert not list((control.folder / "home").rglob("*kube*"))


def test_an_api_server_that_restarts_fails_no_robot(server: Server, control: Control) -> None:
    port, lists, back = server.server_address[1], server.lists, list[Server]()
    server.shutdown()
    server.server_close()

    log, over = control.folder / "log", threading.Event()

    def come_back() -> None:
        """Once it was said that the server is missed."""
        while not over.wait(0.1) and not (log.exists() and "cannot be reached" in log.read_text()):
            pass
        back.append(Server(port))
        back[0].lists = lists

    thread = threading.Thread(target=come_back)
    thread.start()
    try:
        done = control.run("--limit", "robot1,robot2", ANSIBLE_LOG_PATH=str(log))
    finally:
        over.set()
        thread.join()
        back[0].stop()
    assert done.returncode == 0
    assert f"] The Kubernetes API at {server.url} cannot be reached: connection refused." in done.stdout
    assert "It is tried again for 5" in done.stdout
    assert "unknown type" not in done.stdout + done.stderr


def test_another_control_node_sees_what_became_of_a_run(server: Server, control: Control, tmp_path: Path) -> None:
    server.put("/api/v1/namespaces/kube-system", {"metadata": {"name": "kube-system"}})
    done = Run(control, "robot1", playbook="rollback", environ={"ANSIBLE_SHOW_CUSTOM_STATS": "1"})
    assert done.status == 0
    word = re.search(r"RUN: fleet_outcomes: robot1: outcome: (\w+)", " ".join(done.output.split()))
    assert word, done.output
    (tmp_path / "other").mkdir()
    other = Control(tmp_path / "other", server)
    seen = Run(other, "robot1", "-v", playbook="status")
    assert seen.status == 0
    assert re.search(rf"LAST OUTCOMES\n.*\n  robot1 +{word[1]} +play.yml +20", seen.output)
    # the robot is looked at, for its graph and its images, and then its cluster's server, for access
    assert [host for host in other.asked if host != "192.0.2.11"] == ["192.0.2.1", "192.0.2.2"]
    assert (control.left(), other.left()) == ([], [])
