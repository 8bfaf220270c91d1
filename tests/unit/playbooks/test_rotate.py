# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbook rotate where there is no k3s: nothing is brought, and of a token agents are not asked at all."""

from __future__ import annotations

import json

import pytest
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control


@pytest.fixture
def rotates(control: Control) -> Control:
    control.plays("rotate")
    return control


def outcomes(control: Control) -> dict[str, tuple[str, str]]:
    told = json.loads((control.folder / "report.json").read_text())["hosts"]
    return {one["host"]: (one["outcome"], one["reason"]) for one in told}


@pytest.mark.parametrize(("said", "words"), [
    ((), "No k3s serves here whose certificates could be rotated"),
    (("-e", "rotate=all"), "value of rotate must be one of: , certificates, token, got: all"),
])  # fmt: skip
def test_without_a_k3s_or_with_another_word_nothing_is_done(
    rotates: Control, said: tuple[str, ...], words: str
) -> None:
    done = rotates.run("--limit", "edge1,robot1", *said)
    assert done.returncode in (2, 4)
    outcome, reason = outcomes(rotates)["robot1"]
    assert (outcome, words in reason) == ("failed", True)


def test_agents_have_no_part_in_another_token(rotates: Control) -> None:
    rotates.run("--limit", "edge1,robot1,robot3", "-e", "rotate=token")
    words = {host: outcome for host, (outcome, _reason) in outcomes(rotates).items()}
    assert words == {"edge1": "deferred-offline", "robot1": "unchanged", "robot3": "unchanged"}
