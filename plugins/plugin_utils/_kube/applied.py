# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What a write did to an object: before and after as the API server tells them, in a form that may be shown. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...module_utils._common.documents import Result
from ...module_utils._step.objects import Object
from .._model.secrets import secrets_in, without
from .cache import Ref

# What the API server keeps for itself, and what the cluster answers, are no part of what was asked for.
BOOKKEEPING = ("managedFields", "resourceVersion", "generation", "uid", "creationTimestamp", "selfLink")
LAST_APPLIED = "kubectl.kubernetes.io/last-applied-configuration"  # a copy of a Secret, in the clear
HIDDEN, HIDDEN_OLD, HIDDEN_NEW = "(hidden)", "(hidden: the old value)", "(hidden: the new value)"


@dataclass(frozen=True)
class Applied:
    """One object that was written. `before` is None if it was not there, `after` is None if it is gone.

    Both are without bookkeeping and status, and with a Secret's values hidden; `changed` was judged before these were.
    """

    ref: Ref
    before: Object | None
    after: Object | None
    changed: bool


def applied(ref: Ref, before: Object | None, after: Object | None) -> Applied:
    """Compare what the API server said before a write and after it."""
    old, new = content(before), content(after)
    shown_old, shown_new = _without_secrets(old, new)
    return Applied(ref, shown_old, shown_new, old != new)


def content(obj: Object | None) -> Object | None:
    """The object without bookkeeping and status."""
    if obj is None:
        return None
    metadata = {key: value for key, value in (obj.get("metadata") or {}).items() if key not in BOOKKEEPING}
    return {**{key: value for key, value in obj.items() if key != "status"}, "metadata": metadata}


def _without_secrets(old: Object | None, new: Object | None) -> tuple[Object | None, Object | None]:
    if (old or new or {}).get("kind") != "Secret":
        return old, new
    return _hidden(old, new, HIDDEN_OLD), _hidden(new, old, HIDDEN_NEW)


def _hidden(secret: Object | None, other: Object | None, differs: str) -> Object | None:
    """The Secret with words in place of its values; other words where the other one has another value."""
    if secret is None:
        return None
    shown = dict(secret)
    for part in {"data", "stringData"} & set(secret):
        theirs = (other or {}).get(part) or {}
        shown[part] = {
            key: HIDDEN if theirs.get(key) == value else differs for key, value in (secret[part] or {}).items()
        }
    if secret["metadata"].get("annotations"):
        kept = {key: value for key, value in secret["metadata"]["annotations"].items() if key != LAST_APPLIED}
        shown["metadata"] = {**secret["metadata"], "annotations": kept}
    return shown


def diff_of(written: Sequence[Applied]) -> list[Result]:
    """Ansible's `diff` of a task: an entry per object that changed, without the secrets that any of them holds."""
    old = {text for one in written for text in secrets_in(one.before)}
    new = {text for one in written for text in secrets_in(one.after)}
    words = {
        text: HIDDEN if text in old and text in new else HIDDEN_OLD if text in old else HIDDEN_NEW
        for text in old | new
        if text
    }
    return [
        {
            "before_header": str(one.ref),
            "after_header": str(one.ref),
            "before": without(one.before or "", words),
            "after": without(one.after or "", words),
        }
        for one in written
        if one.changed
    ]
