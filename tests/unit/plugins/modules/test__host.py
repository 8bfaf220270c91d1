# SPDX-License-Identifier: GPL-3.0-or-later
"""The private module: what a job answers, and what check mode leaves out."""

from __future__ import annotations

from collections.abc import Callable
from http.client import IncompleteRead
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock, call

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, PASS, WAIT, Seen
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import K3sHost
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s_change import Change, K3sChange
from ansible_collections.rosops.fleet.plugins.modules import _host

NEXT: dict[str, Any] = {
    "role": "agent", "state": "next", "write": ["/usr/local/bin/k3s"], "remove": [], "renew": False,
}  # fmt: skip


@pytest.fixture(name="done")
def _done(monkeypatch: pytest.MonkeyPatch) -> Mock:
    """The exchange of k3s."""
    switch = Mock(return_value=Change("v1", unproven=True))
    monkeypatch.setattr(K3sChange, "record", lambda _change: Change())
    monkeypatch.setattr(K3sChange, "switch", switch)
    monkeypatch.setattr(K3sChange, "version", lambda _change, _staged: "v2")
    monkeypatch.setattr(K3sChange, "invocation", lambda _change: "abc")
    return switch


@pytest.mark.parametrize("check", [False, True])
def test_k3s_is_exchanged_but_in_check_mode(done: Mock, check: bool) -> None:
    found = _host.k3s_change(SimpleNamespace(check_mode=check, run_command=None), NEXT)
    # what lies there in check mode may have been left by a run for another version
    assert (found["changed"], found["staged"], found["start"]) == (True, "" if check else "v2", "abc")
    assert done.mock_calls == ([] if check else [call(["/usr/local/bin/k3s"], [], False)])
    assert found["unproven"] is not check


def test_what_is_staged_is_no_change(done: Mock) -> None:
    found = _host.k3s_change(SimpleNamespace(check_mode=False, run_command=None), {"role": "agent", "state": "staged"})
    assert (found["changed"], done.mock_calls) == (False, [])


def test_facts_have_both_readings_of_the_clock() -> None:
    found = _host.facts(None, {"ports": [], "reach": [], "timeout": 1})
    assert found["facts"]["clock"]["began"] <= found["facts"]["clock"]["ended"]
    assert {"network", "memory_mb", "k3s"} <= set(found["facts"])


@pytest.mark.parametrize(
    ("verdict", "how"), [(PASS, ""), (WAIT, "not ready after 0 s"), (FAIL, "will not become ready")]
)
def test_a_wait_for_k3s_ends_with_what_was_seen(
    main: Callable[..., dict[str, Any]], monkeypatch: pytest.MonkeyPatch, verdict: str, how: str
) -> None:
    monkeypatch.setattr(K3sHost, "show", lambda *_args: {"NRestarts": "7"})
    monkeypatch.setattr(K3sHost, "look", lambda _host, *asked: Seen(verdict, asked))
    monkeypatch.setattr(K3sHost, "journal", lambda *_args: "level=fatal")
    found = main(_host, job="k3s_ready", arguments={"role": "agent", "timeout": 0})
    assert (found["verdict"], found["observed"], "failed" in found) == (verdict, "('agent', '', 7)", verdict != PASS)
    assert verdict == PASS or found["msg"].startswith(f"k3s-agent {how}: ('agent', '', 7)\nThe end of its journal (")
    assert verdict == PASS or found["msg"].endswith("k3s-agent):\nlevel=fatal")


NO_ROUTE = OSError("no route to http://me:s3cret@proxy:3128")


def download(
    monkeypatch: pytest.MonkeyPatch, place: Path, check: bool, error: Exception = NO_ROUTE, **more: Any
) -> Any:
    monkeypatch.setattr(_host, "open_url", Mock(side_effect=error))
    monkeypatch.setattr(_host.os, "environ", {})
    asked = {"url": "https://x/k3s", "dest": str(place), "sha256": "", "sums": "https://x/sums", "environment": {}}
    return _host.k3s_download(SimpleNamespace(check_mode=check), {**asked, **more})


def test_a_download_in_check_mode_asks_nobody(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    place = tmp_path / "k3s"
    place.write_text("")
    nothing = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
    assert not download(monkeypatch, place, True, sha256=nothing)["changed"]
    assert download(monkeypatch, place, True)["changed"]  # nobody knows


@pytest.mark.parametrize(("error", "told"), [
    (NO_ROUTE, r"no route to http://me:\*+@proxy"), (ValueError("unknown url type: 'x'"), "unknown url type"),
    (IncompleteRead(b"", 9), "IncompleteRead"),
])  # fmt: skip
def test_a_download_that_fails_is_told_without_a_password(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, error: Exception, told: str
) -> None:
    with pytest.raises(FleetError, match=f"^https://x/k3s could not be downloaded: {told}"):
        download(monkeypatch, tmp_path / "k3s", False, error)
    assert not [*tmp_path.iterdir()]


def test_no_log_gets_a_secret(main: Callable[..., dict[str, Any]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(_host.JOBS, "facts", lambda _module, arguments: {"told": arguments["token"]})
    assert "s3cret" not in str(main(_host, job="facts", arguments={}, secrets={"token": "s3cret"}))


@pytest.mark.parametrize("job", _host.ROS_JOBS)
def test_what_is_wrong_with_a_job_on_the_ros_graph_is_told(main: Callable[..., dict[str, Any]], job: str) -> None:
    nowhere = dict.fromkeys(("master_uri", "keeper_uri"), "ros-master:11311")
    asked = {"actions": [], "seconds": 0, "timeout": 0, "interval": 1, "nodes": [], "graph": {}, "end_file": "/"}
    assert "is not http://host:port" in main(_host, job=job, arguments={**nowhere, **asked})["msg"]


@pytest.mark.parametrize("error", [FleetError("a process does not end"), OSError("a file is busy")])
def test_a_removal_that_was_cut_off_says_how_to_go_on(
    main: Callable[..., dict[str, Any]], monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    monkeypatch.setattr(_host.Remover, "everything", Mock(side_effect=error))
    found = main(_host, job="k3s_remove", arguments={"volumes": False, "identity": False})
    assert found["msg"] == f"k3s is not wholly removed: {error}. Running this again goes on where it ended."
