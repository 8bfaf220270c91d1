# SPDX-License-Identifier: GPL-3.0-or-later
"""The private module: what a job answers, and what check mode leaves out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s_change import Change, K3sChange
from ansible_collections.rosops.fleet.plugins.modules import _host

NEXT: dict[str, Any] = {"role": "agent", "state": "next", "write": ["/usr/local/bin/k3s"], "remove": []}


@pytest.fixture(name="done")
def _done(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    done: list[Any] = []

    def switch(_change: K3sChange, *files: Any) -> Change:
        done.append(files)
        return Change("v1", unproven=True)

    monkeypatch.setattr(K3sChange, "record", lambda _change: Change())
    monkeypatch.setattr(K3sChange, "switch", switch)
    monkeypatch.setattr(K3sChange, "version", lambda _change, _staged: "v2")
    monkeypatch.setattr(K3sChange, "invocation", lambda _change: "abc")
    return done


@pytest.mark.parametrize("check", [False, True])
def test_k3s_is_exchanged_but_in_check_mode(done: list[Any], check: bool) -> None:
    found = _host.k3s_change(SimpleNamespace(check_mode=check, run_command=None), NEXT)
    assert (found["changed"], found["staged"], found["start"]) == (True, "v2", "abc")
    assert (done, found["unproven"]) == (([], False) if check else ([(["/usr/local/bin/k3s"], [])], True))


def test_what_is_staged_is_no_change(done: list[Any]) -> None:
    found = _host.k3s_change(SimpleNamespace(check_mode=False, run_command=None), {"role": "agent", "state": "staged"})
    assert (found["changed"], done) == (False, [])


def test_facts_have_both_readings_of_the_clock() -> None:
    found = _host.facts(None, {"ports": [], "reach": [], "timeout": 1})
    assert found["facts"]["clock"]["began"] <= found["facts"]["clock"]["ended"]
    assert {"network", "memory_mb", "k3s"} <= set(found["facts"])
