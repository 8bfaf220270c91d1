# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""fleet_config through its main(): the table of bad inputs, and what becomes of secrets."""

from __future__ import annotations

import json
from typing import Any

import pytest
from ansible.module_utils.testing import patch_module_args
from ansible_collections.rosops.fleet.plugins.modules import fleet_config
from ansible_collections.rosops.fleet.tests.unit.bad_input import table

CASES: list[dict[str, Any]] = table.load_cases()
# What the module is given has come through JSON, which has no dates, no numbers as keys and no NaN.
JSON_LESS = ("date-for-a-text", "number-for-a-key", "not-a-number")
GOOD: dict[str, Any] = {
    "groups": table.GROUPS,
    "hosts": {
        "edge1": {"k3s_token": "hush-token", "k3s_registries": {"configs": {"r": {"auth": {"password": "hush-r"}}}}},
        "robot1": {
            "ros_apps": [{**table.GOOD_APP, "image": "example.org/talker", "env": {"API_TOKEN": "hush-env"}}],
            "robot_namespace_pull_secrets": [
                {"name": "login", "registry": "example.org", "username": "me", "password": "hush-password"}
            ],
        },
    },
}


def run(capsys: pytest.CaptureFixture[str], *, check: bool = False, **params: Any) -> Any:
    """main()'s result as Ansible gets it: the JSON on standard output."""
    with patch_module_args({**params, "_ansible_check_mode": check}), pytest.raises(SystemExit):
        fleet_config.main()
    text = capsys.readouterr().out
    assert "Traceback" not in text
    return json.loads(text)


@pytest.mark.parametrize(
    "case", [case for case in CASES if case["id"] not in JSON_LESS], ids=lambda case: str(case["id"])
)
def test_bad_input(case: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, fleet=table.fleet_of(case))
    assert result["failed"] is True
    assert result["valid"] is False
    assert result["changed"] is False
    assert table.missing_words(case, result["msg"]) == []
    assert len(result["errors"]) == len(result["msg"].splitlines()) - 1
    assert case["path"] in [error["path"] for error in result["errors"]]
    assert "hush" not in json.dumps(result)


@pytest.mark.parametrize("check", [False, True])
def test_good_fleet(check: bool, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, check=check, fleet=GOOD)
    assert result["valid"] is True
    assert result["changed"] is False
    assert result["errors"] == []
    assert result["robots"]["robot1"]["apps"][0]["handoff"] == "replace"
    assert "may mean another image" in result["notes"][0]
    assert "hush" not in json.dumps(result)


@pytest.mark.parametrize("fleet", ["text", 5, [1], None])
def test_a_fleet_that_is_no_mapping(fleet: Any, capsys: pytest.CaptureFixture[str]) -> None:
    result = run(capsys, fleet=fleet)
    assert result["failed"] is True
    assert "fleet" in result["msg"]


def test_without_jsonschema_it_says_so(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(fleet_config, "JSONSCHEMA_ERROR", "no such library")
    result = run(capsys, fleet=GOOD)
    assert result["failed"] is True
    assert result["msg"].startswith("Failed to import the required Python library (jsonschema)")
