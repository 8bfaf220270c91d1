# SPDX-License-Identifier: GPL-3.0-or-later
"""Which values are secrets, and how to keep them out of what is shown."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any

from ...module_utils._common.documents import json_of

SHORTEST = 4  # a shorter secret is hidden where it stands alone: everything else would be full of it
# Whatever is below these is the operator's business with k3s or Alertmanager, and may hold passwords.
OPAQUE = ("k3s_config", "k3s_environment", "k3s_registries", "observability_alertmanager_config")
# k3s_token, k3s_agent_token, password, identity_token, auth; but not k3s_token_file and the like, which are paths
_SECRET_KEY = re.compile(r"(?:^|[_~/-])(?:token|password|passwd|psk|secret|secret_key)$|^auth$", re.IGNORECASE)

# An app's environment has the names that its author gave, so the nets are wider there.
_SECRET_VARIABLE = re.compile(
    r"(?i)passw|passphrase|secret|token|credential|(?:api|access|private)_?key|(?:^|_)(?:auth|pwd|pin|psk)$"
    r"|(?:^|(?<!low)(?<!high)(?<!band)_)pass$"
)
_OPTION = r"--?[\w-]*(?:passw(?:or)?d|token|secret|psk)"
_HEADER = re.compile(r"(?i)\bauthorization: *(?:(?:bearer|basic) )?([^\s\"',]+)")
# Before the @ of an address, with a scheme or without one, but for an image's tag and digest; and options of a command.
_PASSWORD_IN_TEXT = re.compile(
    r"(?:(?:://[^\s/:@]*|(?:^|[\s\"'=])[\w.-]+):(?=[^\s/@]+@(?!sha\d))|" + _OPTION + r"[= ])"
    r"([^\s/@\"']+)"
)
# A line of a file of settings, to its end: `mqtt.password = x`, `export DB_PASSWORD=x`, `"psk": "x",`.
_LINE = re.compile(
    r"(?im)^[ \t]*(?:export[ \t]+)?[\"']?[\w./~-]*"
    r"(?:passw(?:or)?d|passphrase|token|secret|psk|(?:api|access|private|secret)_?key)[\"']?[ \t]*[=:][ \t]*"
    r"[\"']?(?!(?:true|false|yes|no|on|off|null|none)\b)([^\s\"'][^\n]*)"
)


def secrets_in(value: Any) -> Iterator[str]:
    """The secrets of an object: a Secret's values, of variables and keys whose name says so, passwords within texts.

    Objects that are kept as JSON within others, as a step keeps its way back, are looked through as well.
    """
    if isinstance(value, Mapping):
        if _SECRET_VARIABLE.search(str(value.get("name"))) and isinstance(value.get("value"), str):
            yield str(value["value"])
        if value.get("kind") == "Secret":
            held = [value[part] for part in ("data", "stringData") if isinstance(value.get(part), Mapping)]
            yield from (str(text) for part in held for text in part.values())
        for key, item in value.items():
            yield from [item] if isinstance(item, str) and _SECRET_KEY.search(str(key)) else []
            yield from secrets_in(item)
    elif isinstance(value, (list, tuple)):
        for before, item in zip(("", *value), value):
            named = isinstance(item, str) and re.fullmatch(_OPTION, str(before))
            yield from [item] if named else secrets_in(item)
    elif isinstance(value, str):
        yield from _PASSWORD_IN_TEXT.findall(value)
        yield from _HEADER.findall(value)
        yield from (found.rstrip(" \t\r,\"'") for found in _LINE.findall(value))
        if value[:1] in ("{", "["):
            try:
                yield from secrets_in(json_of(value))
            except ValueError:
                return


def without(value: Any, words: Mapping[str, str]) -> Any:
    """The value with every text that is a key of `words`, or has one in it, in other words."""
    if isinstance(value, Mapping):
        return {key: without(item, words) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [without(item, words) for item in value]
    if not isinstance(value, str):
        return value
    if value in words:
        return words[value]
    for secret in sorted(words, key=len, reverse=True):
        for form in (secret, json.dumps(secret)[1:-1]):
            value = value.replace(form, words[secret]) if len(secret) >= SHORTEST else value
    return value


def is_secret(path: str) -> bool:
    """Whether the value at a path (or under a key) is a secret.

    >>> is_secret("hosts.edge1.k3s_token"), is_secret("robot_namespace_pull_secrets")
    (True, False)
    """
    return _SECRET_KEY.search(path.rsplit(".", 1)[-1].split("[")[0]) is not None


def redact(name: str, value: Any, seen: dict[str, str], hidden: bool = False) -> Any:
    """What a variable or a key is, JSON's types only, with a number in the place of every secret: for one the same one.

    `seen` carries the numbers from call to call. Empty secrets and those that are no text keep their type, so that a
    check of the type still finds them.
    """
    hidden = hidden or name in OPAQUE or is_secret(name)
    if isinstance(value, dict):
        return {key: redact(key, item, seen, hidden) for key, item in value.items()}
    if isinstance(value, list):
        return [redact("", item, seen, hidden) for item in value]
    if isinstance(value, str):
        return seen.setdefault(value, f"(secret {len(seen) + 1})") if value and hidden else value
    return 0 if hidden and isinstance(value, (int, float)) and not isinstance(value, bool) else value
