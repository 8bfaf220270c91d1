# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Download k3s's binary, checked, through the proxies of its environment."""

from __future__ import annotations

DOCUMENTATION = r"""
module: k3s_download
short_description: Download k3s's binary, checked, through the proxies of its environment
version_added: 1.0.0
description:
  - Brings a file of known SHA-256, or of one that a list of sums next to it names, and puts it in place whole.
  - Proxies come as an option, so that a password in one is on no command line, as a task's C(environment) is.
author:
  - rosops.fleet contributors (@rosops)
options:
  url:
    description: Where the file is.
    type: str
    required: true
  dest:
    description: Where it goes.
    type: path
    required: true
  sha256:
    description: Its SHA-256. Without one O(sums) is read.
    type: str
    default: ""
  sums:
    description: Address of a list as C(sha256sum) writes it, with a line for the last part of O(url).
    type: str
    default: ""
  environment:
    description: Environment of k3s's unit. Of it C(HTTP_PROXY), C(HTTPS_PROXY), C(ALL_PROXY) and C(NO_PROXY) count.
    type: dict
    default: {}
  timeout:
    description: Seconds to wait for an answer.
    type: float
    default: 60
attributes:
  check_mode:
    description: Nothing is downloaded; whether the file would be is said where its sum is given.
    support: full
  diff_mode:
    description: A binary has no readable difference.
    support: none
"""

EXAMPLES = r"""
- name: Download the binary
  rosops.fleet.k3s_download:
    url: https://github.com/k3s-io/k3s/releases/download/v1.34.2%2Bk3s1/k3s
    sums: https://github.com/k3s-io/k3s/releases/download/v1.34.2%2Bk3s1/sha256sum-amd64.txt
    dest: /usr/local/bin/k3s
"""

RETURN = r"""
sha256:
  description: The file's SHA-256; empty in check mode where no sum was given.
  returned: success
  type: str
"""

import os
import re
from pathlib import Path
from typing import Any, Callable, Mapping

from ansible.module_utils.basic import AnsibleModule
from ansible.module_utils.urls import open_url

from ..module_utils._common.errors import FleetError
from ..module_utils._host.k3s import BLOCK, sha256, without_secrets

ARGUMENTS = {
    "url": {"type": "str", "required": True},
    "dest": {"type": "path", "required": True},
    "sha256": {"type": "str", "default": ""},
    "sums": {"type": "str", "default": ""},
    "environment": {"type": "dict", "default": {}, "no_log": True},
    "timeout": {"type": "float", "default": 60},
}
MODE = 0o755
SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$", re.MULTILINE)
PROXY = re.compile(r"(https?|all|no)_proxy", re.IGNORECASE)


def proxies(environment: Mapping[str, object]) -> dict[str, str]:
    """What of a unit's environment concerns a download, in both spellings that programs read."""
    found = {str(name): str(value) for name, value in environment.items() if PROXY.fullmatch(str(name))}
    return {spelled: value for name, value in found.items() for spelled in (name.lower(), name.upper())}


def listed_sum(text: str, name: str, where: str) -> str:
    """A file's sum out of a list of sha256sum."""
    for digest, listed in SUM_LINE.findall(text):
        if listed == name:
            return str(digest)
    raise FleetError(f"{where} has no SHA-256 of {name}")


def fetch(open_url: Callable[[str], Any], url: str, place: Path, expected: str, mode: int) -> bool:
    """Whether the file had to be brought. FleetError, and nothing there, where what came is not what was expected."""
    if sha256(place) == expected:
        return False
    part = place.with_name(f"{place.name}.part")
    try:
        answer = open_url(url)
        with part.open("wb") as file:
            for block in iter(lambda: answer.read(BLOCK), b""):
                file.write(block)
        came = sha256(part)
        if came != expected:
            raise FleetError(f"it has the SHA-256 {came}, expected is {expected}")
        part.chmod(mode)
        part.replace(place)
    finally:
        if part.exists():
            part.unlink()
    return True


def main() -> None:
    module = AnsibleModule(argument_spec=ARGUMENTS, supports_check_mode=True, required_one_of=[("sha256", "sums")])
    params = module.params
    place, expected = Path(params["dest"]), params["sha256"]
    os.environ.update(proxies(params["environment"]))

    def open_(url: str) -> Any:
        return open_url(url, timeout=params["timeout"])

    if module.check_mode:
        module.exit_json(changed=not expected or sha256(place) != expected, sha256=expected)
    try:
        name = params["url"].rpartition("/")[2]
        expected = expected or listed_sum(open_(params["sums"]).read().decode(), name, params["sums"])
        changed = fetch(open_, params["url"], place, expected, MODE)
    except (FleetError, OSError) as error:
        module.fail_json(msg=without_secrets(f"{params['url']} could not be downloaded: {error}"))
    module.exit_json(changed=changed, sha256=expected)


if __name__ == "__main__":
    main()
