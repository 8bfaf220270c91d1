# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which credentials an image's registry gets."""

from __future__ import annotations

from base64 import b64encode

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.logins import auths


def login(registry: str, user: str = "u") -> dict[str, str]:
    return {"name": "pull", "registry": registry, "username": user, "password": "p:w"}


@pytest.mark.parametrize(
    ("image", "registry", "fits"),
    [
        ("r.example/app:1", "r.example", True),
        ("r.example/app:1", "https://r.example/v2/", True),
        ("r.example:5000/app:1", "r.example:5000", True),
        ("r.example:5000/app:1", "r.example", False),
        ("r.example.org/app:1", "r.example", False),
        ("r.example/team/app@sha256:0", "r.example/team", True),
        ("r.example/teams/app:1", "r.example/team", False),
        ("redis:7", "https://index.docker.io/v1/", True),
        ("team/app", "docker.io", True),
        ("r.example/app:1", "docker.io", False),
    ],
)
def test_which_registry(image: str, registry: str, fits: bool) -> None:
    assert auths(image, [login(registry)]) == ([b64encode(b"u:p:w").decode()] if fits else [])


def test_several_and_those_that_somebody_else_keeps() -> None:
    logins = [login("r.example", "a"), {"name": "other"}, login("r.example", "b"), login("r.example", "a")]
    assert auths("r.example/app", logins) == [b64encode(f"{user}:p:w".encode()).decode() for user in "ab"]
