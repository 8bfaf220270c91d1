# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The file of a recording, on the control node."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._ros.recording import Recording


def as_text(data: Any) -> str:
    """As it is kept: the same graph is the same text."""
    return json.dumps(data, indent=1, sort_keys=True) + "\n"


def load(path: Path) -> Recording:
    """SpecError says why it cannot be had."""
    try:
        return Recording.from_dict(json.loads(path.read_text("utf-8")), str(path))
    except OSError as error:
        raise SpecError(f"the recording {path} cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise SpecError(f"{path} is no JSON: {error}") from error
