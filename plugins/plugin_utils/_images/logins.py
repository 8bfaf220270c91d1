# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which credentials belong to which image, as the kubelet takes them from pull secrets. Pure."""

from __future__ import annotations

import base64
import re
from collections.abc import Iterable

from ...module_utils._common.documents import Variables
from .archive import normal_ref

HUB = ("docker.io", "index.docker.io", "registry-1.docker.io")


def auths(image: str, logins: Iterable[Variables]) -> list[str]:
    """`user:password` in base64, for each of the logins (`{registry, username, password}`) to the image's registry.

    Items without `registry` name Secrets that somebody else keeps: only the cluster knows what is in them.
    """
    place = _place(normal_ref(image))
    found = [
        base64.b64encode(f"{login['username']}:{login['password']}".encode()).decode()
        for login in logins
        if login.get("registry") and f"{place}/".startswith(f"{_place(str(login['registry']))}/")
    ]
    return list(dict.fromkeys(found))


def _place(address: str) -> str:
    """Host and path, without scheme and API version; the Hub has several names."""
    host, slash, path = re.sub(r"^https?://", "", address).rstrip("/").partition("/")
    path = re.sub(r"^v[12]$", "", path)
    return f"{HUB[0] if host in HUB else host}{slash if path else ''}{path}"
