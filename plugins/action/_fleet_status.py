# SPDX-License-Identifier: GPL-3.0-or-later
"""For the playbook status: what was read of the fleet as text on the screen and as a page for the browser.

`fleet` is what `_fleet_info` returned. Where no keeper has read a robot's graph, `graphs` names the variable in which
the robot has what `ros_graph_info` returned.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import ClassVar

from ..module_utils._common.documents import Arguments, Result, Variables
from ..plugin_utils._action.base import FleetAction
from ..plugin_utils._action.voice import display, show
from ..plugin_utils._model import names
from ..plugin_utils._model.keys import read
from ..plugin_utils._report.files import placed, text_of, write
from ..plugin_utils._report.host_run import SPOILT
from ..plugin_utils._report.look import Asked, Look, status_of
from ..plugin_utils._report.page import status_page
from ..plugin_utils._report.results import message_of
from ..plugin_utils._report.ros_graph import Reading
from ..plugin_utils._report.rows import Trouble, logs_of
from ..plugin_utils._report.text import TABLES, status_text, summary_text
from ..plugin_utils._upstream.ansible_core import BRIEF


class ActionModule(FleetAction):
    _requires_connection = False
    ARGUMENTS: ClassVar = {
        "fleet": {"type": "dict", "required": True},
        "graphs": {"type": "str", "required": True},
        "page": {"type": "str", "default": "reports/fleet-status.html"},
        "mode": {"type": "str", "choices": ["0600", "0640", "0644"], "default": "0600"},
    }

    def work(self, params: Arguments, known: Variables) -> Result:
        look = read(Look, params["fleet"])
        own = {host: known["hostvars"][host].get(params["graphs"], {}) for host in look.graphs}
        results = {**own, **params["fleet"]["read"]}
        graphs, wrong = readings(results, look.graphs)
        status = status_of(look.status, graphs, wrong)
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        tables = status_text(status) if display.verbosity else f"{TABLES}\n"
        text = f"{summary_text(status, now, look.name)}\n{tables}"
        show(f"\n{text}")
        # what -v would print of the result is what has just been shown
        result: Result = {"text": text, **BRIEF}
        try:
            limit = str(known.get("ansible_limit") or "")
            path = placed(params["page"])
            before = text_of(path) if path else ""
            page = status_page(status, now, before, limit, look.name) if path else ""
            result["changed"] = page != before
            if path and page != before and not self._task.check_mode:
                write(path, page, int(params["mode"], 8))
        except OSError as error:
            result.update(failed=True, msg=f"the page cannot be written: {error}")
        return result


def readings(results: Mapping[str, Result], graphs: Mapping[str, Asked]) -> tuple[dict[str, Reading], list[Trouble]]:
    """The graphs by robot. One that could not be read, or makes no sense, is a problem, and keeps nobody from the
    others. A robot that went away meanwhile shows as such."""
    found: dict[str, Reading] = {}
    wrong: list[Trouble] = []
    for host, one in results.items():
        asked, where = graphs[host], f"ROS graph of {host}"
        if "graph" in one:
            try:
                found[asked.robot] = Reading.from_dict(one["graph"], asked.promised)
            except SPOILT as error:
                wrong.append(Trouble(where, f"it makes no sense: {error}", graph=asked.robot))
        elif not one.get("unreachable"):
            logs = logs_of(asked.robot, names.MASTER_NAME)
            wrong.append(Trouble(where, message_of(one), logs, graph=asked.robot))
    return found, wrong
