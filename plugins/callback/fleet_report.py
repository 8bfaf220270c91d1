# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Outcome per host at the end of a run, on screen and as JSON. What is said is worked out in `_report`."""

from __future__ import annotations

DOCUMENTATION = r"""
name: fleet_report
type: aggregate
short_description: Outcome of every host, and where the time went
version_added: 1.0.0
author: rosops.fleet contributors (@rosops)
description:
  - At the end of a run prints one line per host and writes all of it as JSON.
  - "A host's outcome is one of V(updated) (something was changed), V(unchanged), V(failed), V(deferred-offline)
    (unreachable), and V(deferred-busy) or V(rolled-back), which a play declares itself. On screen, check mode says
    C(would change) and C(would not change); in the file C(check_mode) is true."
  - The role P(rosops.fleet.update#role) says the outcome of a robot. A play declares one with
    M(ansible.builtin.set_fact) of C(fleet_outcome), a word or C({outcome, reason, steps}). A failure outweighs it,
    unless the word itself is one of C(failed), C(rolled-back), C(deferred-busy), C(deferred-offline).
  - What a host's tasks did on another one (C(delegate_to)) counts for that host. A C(run_once) task that fails, or
    does not reach its host, ends the run for all hosts of its play whose batch is not over, so these are C(failed). So
    does a play's C(max_fail_percentage).
  - Where nothing is printed for 15 seconds, says which task goes on, and of an update where it stands, as tools that
    run playbooks (AWX) may end a silent one.
  - Results under C(no_log) are neither printed nor written.
  - An error in the report itself is a warning and never ends the run. Under an ansible-core that is older than the
    collection needs there is no report.
  - The last run of each playbook that was not in check mode stays in a file of its own,
    C(fleet-report-<playbook>.json). The playbook C(status) takes what became of every host from the hosts' clusters,
    where the playbooks keep it.
  - "The file: C(playbook), C(check_mode), C(started) (UTC), C(elapsed), C(outcomes) (how many of each), C(hosts),
    C(plays) and C(stages) (name, seconds; a stage is a role, or the play for tasks outside of one), C(slowest_tasks)
    (ten, with name, action, play, stage, seconds, hosts, changed), C(tasks) (how many), C(apis) (of each cluster that
    the run asked C(host) and C(source), the API's address and whence the access to it was)."
  - "A host in the file: C(host), C(groups), C(outcome), C(reason), C(failed_task), C(changed) (names of tasks),
    C(ready) (verdict, elapsed, checks and unmet ones of M(rosops.fleet.ros_ready)), C(steps) (of an update, each with
    C(name), C(apps), C(handoff), C(outcome), C(reason), C(from), C(to), C(phases) in seconds, C(busy_wait)), C(counts)
    (Ansible's own)."
  - Seconds of a task run from its start to its last host's result, so they add up to the run only under a strategy that
    takes one task after the other.
options:
  path:
    description:
      - The JSON file of the last run. Relative to the directory of the ansible.cfg in use, or without one to the
        current directory.
      - Empty writes none. It is for its user only (0600).
    type: str
    default: reports/fleet-report.json
    env:
      - name: ROSOPS_FLEET_REPORT
    ini:
      - section: callback_fleet_report
        key: path
requirements:
  - enable in configuration, C(callbacks_enabled = rosops.fleet.fleet_report)
"""

import contextlib
import itertools
import json
import os
import time
from pathlib import Path
from typing import Any

from ansible import constants as C  # noqa: N812 - its customary name
from ansible import context
from ansible.playbook.role_include import IncludeRole
from ansible.plugins.callback import CallbackBase
from ansible.release import __version__

from ..module_utils._common.documents import Data
from ..plugin_utils._model.outcomes import BUSY, FAILED, OFFLINE, ROLLED_BACK, UNCHANGED, UPDATED
from ..plugin_utils._report.files import placed, write
from ..plugin_utils._report.host_run import note_run
from ..plugin_utils._report.results import HIDDEN
from ..plugin_utils._report.run import RunReport, Task, screen
from ..plugin_utils._report.silence import LOOK, Silence
from ..plugin_utils._update.ledger import Standing
from ..plugin_utils._update.world import ticking
from ..plugin_utils._upstream.ansible_core import identity, playbook_file

CORE = (2, 19)  # as in meta/runtime.yml
COLOURS = {
    UPDATED: C.COLOR_CHANGED,
    UNCHANGED: C.COLOR_OK,
    FAILED: C.COLOR_ERROR,
    OFFLINE: C.COLOR_UNREACHABLE,
    BUSY: C.COLOR_WARN,
    ROLLED_BACK: C.COLOR_WARN,
}


def name_of(task: Any) -> str:
    """The task's name, after its role's without the collection."""
    # one that includes a role has its name alone, and takes no word about it
    name = task.get_name() if isinstance(task, IncludeRole) else task.get_name(include_role_fqcn=False)
    return str(name).strip()


def secret_free(result: Any) -> dict[str, Any]:
    """Ansible has taken out what no_log covers; where the task itself says no_log, keep only what happened."""
    data = dict(result.result)
    if result.task.no_log or "censored" in data:
        kept = {key: data[key] for key in ("changed", "failed", "unreachable") if key in data}
        return {**kept, "censored": HIDDEN}
    return data


class CallbackModule(CallbackBase):  # type: ignore[misc] # ansible-core carries no types
    """What goes wrong in a method ansible-core makes a warning of, and the run goes on."""

    CALLBACK_VERSION = 2.0
    CALLBACK_TYPE = "aggregate"
    CALLBACK_NAME = "rosops.fleet.fleet_report"
    CALLBACK_NEEDS_ENABLED = True

    def __init__(self) -> None:
        super().__init__()
        # an older one hands results on in another way; the first task of each playbook says that it is too old
        self.disabled = tuple(map(int, __version__.split(".")[:2])) < CORE
        self.report = RunReport(time.monotonic(), time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()))
        standing = Standing(Path(C.DEFAULT_LOCAL_TMP))
        self.silence = Silence(self._display.display, time.monotonic, standing.words)
        self.ahead: set[str] = set()  # plays that have not begun
        self.beside = contextlib.ExitStack()

    # --- what happens -----------------------------------------------------------------------------------------------

    def v2_playbook_on_start(self, playbook: Any) -> None:
        self.report.playbook = Path(playbook_file(playbook)).name
        self.ahead = {identity(play) for play in playbook.get_plays()}
        self.beside.enter_context(ticking(LOOK, self.silence.look))

    def v2_playbook_on_play_start(self, play: Any) -> None:
        self.ahead.discard(identity(play))
        manager = play.get_variable_manager()
        found = manager.get_vars(play=play, include_hostvars=False) if manager else {}
        self.silence.begins(play.get_name().strip())
        hosts, batch = (found.get(f"ansible_play_{which}", []) for which in ("hosts_all", "batch"))
        self.report.play(play.get_name().strip(), hosts, time.monotonic(), batch)
        note_run(self.report.so_far())

    def v2_playbook_on_task_start(self, task: Any, is_conditional: bool = False) -> None:  # noqa: ARG002 - Ansible's
        self.silence.begins(name_of(task))
        for_all = task.run_once is True or task.any_errors_fatal is True
        role = getattr(task, "_role", None)
        stage = str(role.get_name()).rpartition(".")[2] if role else ""
        info = Task(name_of(task), str(task.action), stage, for_all)
        self.report.task(identity(task), info, time.monotonic())

    v2_playbook_on_handler_task_start = v2_playbook_on_task_start

    def _ended(self, result: Any) -> tuple[str, str, dict[str, Any], float]:
        """The task and the host of a result, what may be said of it, and when that came."""
        name = str(result.host.get_name())
        self.silence.heard(name)
        self.report.host(name, [group.get_name() for group in result.host.get_groups()])
        return identity(result.task), name, secret_free(result), time.monotonic()

    def v2_runner_on_ok(self, result: Any) -> None:
        self.report.ok(*self._ended(result))

    def v2_runner_on_failed(self, result: Any, ignore_errors: bool = False) -> None:
        self.report.failed(*self._ended(result), ignore_errors)

    def v2_runner_on_skipped(self, result: Any) -> None:
        task, host, _data, now = self._ended(result)
        self.report.ran(task, host, now)

    def v2_runner_on_unreachable(self, result: Any) -> None:
        self.report.unreachable(*self._ended(result))

    def v2_playbook_on_no_hosts_remaining(self) -> None:
        self.report.too_many_failed()

    # --- the report -------------------------------------------------------------------------------------------------

    def v2_playbook_on_stats(self, stats: Any) -> None:
        self.beside.close()
        counts = {host: stats.summarize(host) for host in stats.processed}
        if self.ahead:
            self.report.cut_short(counts)
        report = self.report.finish(counts, time.monotonic(), check_mode=bool(context.CLIARGS.get("check")))
        self._print(report)
        self._write(report)

    def _print(self, report: Data) -> None:
        self._display.banner("FLEET REPORT" + (" (check mode: nothing was changed)" if report["check_mode"] else ""))
        colours = [None, *(COLOURS[host["outcome"]] for host in report["hosts"])]
        for line, colour in itertools.zip_longest(screen(report), colours):
            self._display.display(line, color=colour)

    def _write(self, report: Data) -> None:
        path = placed(str(self.get_option("path") or ""))
        if path is None:
            return
        text = json.dumps(report, indent=2, default=str) + "\n"
        write(path, text)
        if path.is_file() and not report["check_mode"]:  # a later look at the fleet must not hide what an update did
            write(path.with_name(f"{path.stem}-{Path(self.report.playbook).stem}{path.suffix}"), text)
        # AWX deletes the copy of the project in which a job runs
        gone = "AWX_HOST" in os.environ and path.is_relative_to(Path.cwd())
        where = "fleet_outcomes, an artifact of this job; files in its directory go with it" if gone else path
        self._display.display(f"report: {where}")
