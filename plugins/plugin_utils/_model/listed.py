# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Lists that may come as text: what a survey of AWX answers, and what `-e name=value` gives, is a text."""

from __future__ import annotations

import re
from typing import Any

import yaml

from ...module_utils._common.errors import SpecError

WAVE = re.compile(r"[1-9][0-9]*|(0*[1-9][0-9]?|100)%")


def listed(value: Any) -> list[Any]:
    """The list that was meant: of YAML or JSON, or of words with commas, blanks or lines between them.

    Nothing and an empty text, which an optional question of a survey gives, are an empty list.
    """
    if isinstance(value, (list, tuple)):
        return list(value)
    if isinstance(value, (int, float)):
        return [value]
    text = "" if value is None else str(value).strip()
    if not text.startswith("["):
        return [word for word in re.split(r"[\s,]+", text) if word]
    try:
        found = yaml.safe_load(text)
    except yaml.YAMLError:
        found = None
    if not isinstance(found, list):
        raise SpecError(f"{text!r} is no list; allowed: a list, or words with commas between them")
    return found


def wrong_waves(value: Any) -> str:
    """What is wrong with waves of hosts, which Ansible would only stumble over; empty if nothing is."""
    try:
        waves = listed(value)
    except SpecError as error:
        return str(error)
    wrong = [wave for wave in waves if isinstance(wave, bool) or not WAVE.fullmatch(str(wave))]
    return f"has {wrong[0]!r}" if wrong else ""
