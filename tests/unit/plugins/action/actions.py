# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""An action plugin run by itself: arguments and variables in, result out."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any


def run(module: Any, args: dict[str, Any], task_vars: dict[str, Any], check_mode: bool = False) -> dict[str, Any]:
    task = SimpleNamespace(args=args, check_mode=check_mode, async_val=0, diff=True, environment=None, no_log=False)
    connection = SimpleNamespace(_shell=SimpleNamespace(tmpdir="/unused", env_prefix=lambda **_: ""))
    templar = SimpleNamespace(template=lambda value: value)
    made = module.ActionModule(
        task=task, connection=connection, play_context=None, loader=None, templar=templar, shared_loader_obj=None
    )
    found: dict[str, Any] = made.run(task_vars={"inventory_hostname": "robot1", **task_vars})
    return found
