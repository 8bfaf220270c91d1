# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is shown of a write."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.applied import applied, diff_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._kube.cache import Ref

REF = Ref("Secret", "pull", "robot-robot1", "v1")


def secret(value: str, **metadata: Any) -> dict[str, Any]:
    return {"kind": "Secret", "metadata": {"name": "pull", **metadata}, "data": {"a": value, "same": "c2FtZQ=="}}


def test_a_secret_is_never_shown_but_its_change_is() -> None:
    note = {"annotations": {"kubectl.kubernetes.io/last-applied-configuration": "b2xk", "kept": "yes"}}
    written = applied(REF, secret("b2xk", **note), secret("bmV3"))
    (diff,) = diff_of([written])
    assert written.changed
    assert diff["before"]["data"] == {"a": "(hidden: the old value)", "same": "(hidden)"}
    assert diff["after"]["data"] == {"a": "(hidden: the new value)", "same": "(hidden)"}
    assert diff["before"]["metadata"]["annotations"] == {"kept": "yes"}
    assert "b2xk" not in str(written)
    assert "bmV3" not in str(written)


@pytest.mark.parametrize(("before", "after"), [(None, secret("bmV3")), (secret("bmV3"), None)])
def test_a_secret_that_comes_or_goes_is_not_shown_either(before: Any, after: Any) -> None:
    written = applied(REF, before, after)
    assert written.changed
    assert "bmV3" not in str(diff_of([written]))


def test_bookkeeping_is_no_change() -> None:
    kept = {"resourceVersion": "1", "generation": 1, "managedFields": []}
    before = {"metadata": {"name": "a", **kept}, "status": {"a": 1}}
    after = {"metadata": {"name": "a", "resourceVersion": "2", "generation": 2}, "status": {}}
    assert not applied(Ref("Pod", "a", "n"), before, after).changed


def test_the_diff_has_what_changed_only() -> None:
    ref = Ref("ConfigMap", "a", "n")
    old, new = ({"metadata": {"name": "a"}, "data": {"k": value}} for value in "ab")
    written = [applied(ref, old, old), applied(ref, old, new), applied(ref, None, new), applied(ref, old, None)]
    assert [(one["before"], one["after"]) for one in diff_of(written)] == [(old, new), ("", new), (old, "")]
    assert diff_of(written)[0]["before_header"] == "ConfigMap n/a"


def deployment(env: dict[str, str]) -> dict[str, Any]:
    variables = [{"name": name, "value": value} for name, value in env.items()]
    return {"kind": "Deployment", "metadata": {"name": "a"}, "spec": {"containers": [{"env": variables}]}}


def test_an_apps_password_is_not_shown_nor_where_the_way_back_keeps_it() -> None:
    old, new = (
        deployment({"DB_PASSWORD": "first-hush", "LEVEL": "1"}),
        deployment({"DB_PASSWORD": "then-hush", "LEVEL": "2"}),
    )
    kept = {"kind": "ConfigMap", "metadata": {"name": "a-update"}, "data": {"history.json": json.dumps([old])}}
    app, history = diff_of([applied(REF, old, new), applied(REF, kept, None)])
    assert app["before"] == deployment({"DB_PASSWORD": "(hidden: the old value)", "LEVEL": "1"})
    assert app["after"] == deployment({"DB_PASSWORD": "(hidden: the new value)", "LEVEL": "2"})
    assert "hush" not in str([app, history])
