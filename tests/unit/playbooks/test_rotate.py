# SPDX-License-Identifier: GPL-3.0-or-later
"""The playbook rotate where there is no k3s: nothing is brought, and of a token agents are not asked at all."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.tests.unit.playbooks.control_node import Control
from ansible_collections.rosops.fleet.tests.unit.playbooks.robot_runs import Run


@pytest.mark.parametrize(("said", "words"), [
    ({}, "No k3s serves here whose certificates could be rotated"),
    ({"rotate": "all"}, "value of rotate must be one of: , certificates, token, got: all"),
])  # fmt: skip
def test_without_a_k3s_or_with_another_word_nothing_is_done(control: Control, said: dict[str, str], words: str) -> None:
    run = Run(control, "edge1,robot1", playbook="rotate", **said)
    assert run.status in (2, 4)
    outcome, reason = run.outcome("robot1")
    assert (outcome, words in reason) == ("failed", True)


def test_agents_have_no_part_in_another_token(control: Control) -> None:
    run = Run(control, "edge1,robot1,robot3", playbook="rotate", rotate="token")
    words = {host: run.outcome(host)[0] for host in run.hosts}
    assert words == {"edge1": "deferred-offline", "robot1": "unchanged", "robot3": "unchanged"}
