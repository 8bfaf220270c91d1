# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What others give a form: JSON at the border, options and results of modules, fields of ROS messages."""

from __future__ import annotations

from typing import Any, Dict, Mapping

Document = Mapping[str, Any]  # as it is read
Data = Dict[str, Any]  # as it is made
