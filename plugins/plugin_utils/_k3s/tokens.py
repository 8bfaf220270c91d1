# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The tokens of a cluster: which ones a host is to keep."""

from __future__ import annotations

import base64
import secrets
import string
from collections.abc import Iterable, Sequence
from pathlib import PurePosixPath

from ...module_utils._common.documents import Result, Variables
from ...module_utils._common.errors import SpecError
from ...module_utils._host.k3s import token_verdict

VARIABLES = {"token": "k3s_token", "agent-token": "k3s_agent_token"}
ALPHABET = string.ascii_lowercase + string.digits
LENGTH = 48


def tokens_to_keep(names: Iterable[str], read: Sequence[Result], variables: Variables) -> dict[str, str]:
    """Name of a token's file to its text: what the first server hands out, else the inventory's, else a new one.

    `read` is what slurp returned for each file of the servers that could be asked, in their order; empty on the first
    server itself. The full form of a token (K10...) lets a member check that it talks to the right cluster before it
    says a word. SpecError where the inventory's is not the cluster's.
    """
    joined = {
        PurePosixPath(file["source"]).name: base64.b64decode(file["content"]).decode().strip()
        for file in reversed(read)
        if "content" in file
    }
    wrong = [
        VARIABLES[name]
        for name, text in joined.items()
        if variables[VARIABLES[name]] and token_verdict(variables[VARIABLES[name]], text, "") != "same"
    ]
    if wrong:
        cluster = variables["k3s_cluster"]
        raise SpecError(f"{', '.join(wrong)} is not the one that the cluster {cluster} runs with; nothing was changed.")
    return {name: joined.get(name) or variables[VARIABLES[name]] or _new() for name in names}


def _new() -> str:
    return "".join(secrets.choice(ALPHABET) for _place in range(LENGTH))
