# SPDX-License-Identifier: GPL-3.0-or-later
"""What results of tasks say: their message, the outcome of a host, the verdict of our own wait. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...module_utils._common.documents import Data
from .._model.outcomes import OUTCOMES
from .._update.outcome import RobotOutcome

Result = Mapping[str, Any]  # of a task, as Ansible has it

FACTS = ("fleet_outcome", "fleet_k3s_outcome")  # the latter is site's own, of its stage k3s
ACTIONS = ("_robot_update", "_update_soak", "_guarded", "_k3s_change", "_revoke")  # whose result has an outcome
HIDDEN = "hidden by no_log"
CORE_PREFIX = "Task failed: "  # ansible-core 2.19 puts it before every message of a plugin
MESSAGE_KEPT = 4000  # a result is not a log


def message_of(result: Result) -> str:
    """What a failed result says: its message, or those of its failed items, or what the command wrote."""
    if "censored" in result:
        return HIDDEN
    listed = result.get("results")
    items = [item for item in listed if isinstance(item, Mapping)] if isinstance(listed, list) else []
    failed = [item for item in items if item.get("failed") or item.get("unreachable")]
    if failed:
        said = dict.fromkeys(message_of(item) for item in failed)
        return "; ".join(said)[:MESSAGE_KEPT]
    text = str(result.get("msg") or "").strip().removeprefix(CORE_PREFIX)
    if text in ("", "non-zero return code", "MODULE FAILURE"):
        more = str(result.get("stderr") or result.get("module_stderr") or result.get("stdout") or "").strip()
        text = f"{text}: {more}".strip(": ")
    return (text or "failed without a message")[:MESSAGE_KEPT]


def ready_of(action: str, result: Result) -> Data | None:
    """ros_ready's verdict, how many conditions it judged, and those that do not hold."""
    if action not in ("ros_ready", "_robot_update") or "verdict" not in result:
        return None
    checks = result.get("checks") or ()
    unmet = ["{kind} {name}: {reason}".format_map(one) for one in checks if one["verdict"] != "pass"]
    return {"verdict": result["verdict"], "elapsed": result.get("elapsed"), "checks": len(checks), "unmet": unmet}


def outcome_of(action: str, result: Result) -> RobotOutcome | None:
    """An outcome that an action of ours says, or that a play decided itself, with `set_fact: fleet_outcome`."""
    if action in ACTIONS:
        return declared_in(result.get("outcome"))
    facts = result.get("ansible_facts")
    told = [declared_in(facts.get(name)) for name in FACTS] if isinstance(facts, Mapping) else []
    return next(filter(None, told), None)


def declared_in(value: object) -> RobotOutcome | None:
    """What a word or `{outcome, reason, steps}` says; None where it is no outcome. Steps of another shape are none."""
    said = value if isinstance(value, Mapping) else {"outcome": str(value or "")}
    try:
        found = RobotOutcome.from_dict(said)
    except (AttributeError, TypeError, ValueError):
        found = RobotOutcome.from_dict({**said, "steps": ()})
    return found if found.outcome in OUTCOMES else None
