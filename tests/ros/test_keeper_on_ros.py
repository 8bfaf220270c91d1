# SPDX-License-Identifier: GPL-3.0-or-later
"""The keeper's process beside a real master and real nodes: what it costs, how it begins anew and ends."""

from __future__ import annotations

import os
import signal
import time
from pathlib import Path

import pytest
from scene import Scene, until


def test_what_it_costs_at_idle(scene: Scene) -> None:
    scene.start_master()
    keeper = scene.start_keeper()
    for number in range(10):
        scene.start("listener", f"/listener_{number}", f"/topic_{number}")
        scene.start("service", f"/server_{number}", f"/service_{number}")
    names = [f"/{kind}_{number}" for kind in ("listener", "server") for number in range(10)]
    until("20 nodes", lambda: set(names) <= set(scene.registered()), 60)
    scene.until_recorded(*names)
    until("its parameters", (scene.directory / "record" / "parameters.json").exists)  # nothing is left to learn
    began, used = time.monotonic(), cpu_seconds(keeper.pid)
    time.sleep(15)
    share = (cpu_seconds(keeper.pid) - used) / (time.monotonic() - began)
    status = Path(f"/proc/{keeper.pid}/status").read_text()
    rss = next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS"))
    print(f"\nat idle with 20 nodes: {share:.2%} of a core, {int(rss) / 1024:.1f} MB")
    assert share < 0.01


def cpu_seconds(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def test_it_begins_anew_with_its_code_but_not_while_it_holds_goals(scene: Scene) -> None:
    """As the kubelet brings other files: by changing one link beside them."""
    link = scene.directory / "hooks" / "..data"
    link.parent.mkdir()
    link.symlink_to("..2026_01_01")
    scene.start_master()
    scene.start_keeper()
    scene.start("server", "/worker")
    scene.until_recorded("/worker")
    process, before = scene.processes["keeper"], scene.registered()
    scene.keeper_api.hold("/work", "/worker", 60.0)
    link.unlink()
    link.symlink_to("..2026_01_02")
    time.sleep(3.0)  # that nothing happens is what is looked for
    assert "begins anew" not in scene.said()
    scene.keeper_api.release("/work")
    until("the keeper to begin anew", lambda: scene.said().count("keeping ") == 2)
    until("the keeper", scene.keeper_ready)
    assert process.poll() is None
    assert scene.registered() == before
    assert scene.keeper_api.state()[2] == {}  # type: ignore[index]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_it_ends_when_it_is_told_to(scene: Scene, number: int) -> None:
    scene.start_master()
    keeper = scene.start_keeper()
    keeper.send_signal(number)
    assert keeper.wait(5) == 0
    assert scene.said().endswith("stopped\n")
