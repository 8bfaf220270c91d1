# SPDX-License-Identifier: GPL-3.0-or-later
"""Mappings that others give a form, of any content. What is ours in them gets a type where it comes in."""

from __future__ import annotations

from typing import Any, Dict, Mapping

Arguments = Mapping[str, Any]  # what a module or an action is given
Result = Dict[str, Any]  # what a module or an action answers
Variables = Mapping[str, Any]  # of a host, a role or a task
Document = Mapping[str, Any]  # JSON of another kind, as it is read, and fields of ROS messages
Data = Dict[str, Any]  # the same, as it is made
