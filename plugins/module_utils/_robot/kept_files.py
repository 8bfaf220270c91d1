# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What the keeper must not forget, in files that are written whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any


class KeptFiles:
    """A directory with one JSON file per part; a part that is not there, or is damaged, is None."""

    def __init__(self, directory: str) -> None:
        self.directory = Path(directory)
        self.directory.mkdir(parents=True, exist_ok=True)

    def load(self, part: str) -> Any:
        try:
            return json.loads((self.directory / f"{part}.json").read_text("utf-8"))
        except (OSError, ValueError):
            return None

    def save(self, part: str, content: Any) -> None:
        path = self.directory / f"{part}.json"
        fresh = self.directory / f".{part}.new"
        with fresh.open("w", encoding="utf-8") as file:
            json.dump(content, file, separators=(",", ":"))
            file.flush()
            os.fsync(file.fileno())  # else a power cut may leave the name with nothing behind it
        fresh.replace(path)
