# SPDX-License-Identifier: GPL-3.0-or-later
"""k3s is exchanged whole and kept, whenever the exchange is cut off."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host import k3s_change
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s_change import Change, K3sChange
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import Clock

BINARY, CONFIG = "/usr/local/bin/k3s", "/etc/rancher/k3s/config.yaml"
DB = "/var/lib/rancher/k3s/server/db"
REGISTRIES, ENVIRONMENT = "/etc/rancher/k3s/registries.yaml", "/etc/rancher/k3s/environment"
OLD = {BINARY: "v1.34.2+k3s1", CONFIG: "a: 1", ENVIRONMENT: "A=1"}
NEW = {BINARY: "v1.34.3+k3s1", CONFIG: "a: 2", REGISTRIES: "mirrors: {}"}


class Cut(BaseException):
    """The host lost its power."""


class Machine:
    """A host whose k3s says what is in its binary's file."""

    def __init__(self, root: Path, role: str = "server", **files: str) -> None:
        self.root, self.asked = root, list[list[str]]()
        self.fails, self.saved, self.full = "", 0, False
        self.put({**OLD, **files})
        self.clock, self.stops_at = Clock(), 0.0
        self.change = K3sChange(self.run, role, str(root))
        self.change.now, self.change.sleep = self.clock.now, self.clock.sleep

    def put(self, files: dict[str, str]) -> None:
        for name, text in files.items():
            path = self.root / name.lstrip("/")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.unlink(missing_ok=True)
            path.write_text(text)

    def stage(self, files: dict[str, str]) -> None:
        self.put({f"{name}.next": text for name, text in files.items()})

    def run(self, command: list[str], **_options: Any) -> tuple[int, str, str]:
        if command[-1] == "--version":
            return 0, f"k3s version {Path(command[0]).read_text()} (1a2b3c)\n", ""
        if command[:2] == ["systemctl", "show"]:
            again = any(words[1] == "restart" for words in self.asked) and self.clock.at >= self.stops_at
            return 0, f"{len(self.asked) if again else 'first'}\n", ""
        self.asked.append([Path(command[0]).name, *command[1:]])
        failed = bool(self.fails) and self.fails in " ".join(command)
        if command[1:] == ["certificate", "rotate"] and not failed:
            for path in [*self.root.glob(f"{KUBELET[1:]}.*[ty]"), *self.root.glob(f"{ADMIN[1:]}.*[ty]")]:
                path.unlink()
        if command[1:3] == ["etcd-snapshot", "save"] and not failed:
            self.save(dict(zip(command[3::2], command[4::2], strict=True)))
        return int(failed), "", "boom" if failed else ""

    def save(self, flags: dict[str, str]) -> None:
        """As k3s does: into the directory of its configuration where no other is said. A full disk is no error."""
        directory = Path(flags.get("--etcd-snapshot-dir", self.root / "mnt/snapshots"))
        self.saved += 1
        if not self.full:
            self.put({f"/{directory.relative_to(self.root)}/{flags['--name']}-edge1-{self.saved}": ""})

    def there(self) -> dict[str, str]:
        found = {name: self.root / name.lstrip("/") for name in {**OLD, **NEW}}
        return {name: path.read_text() for name, path in found.items() if path.exists()}


@pytest.fixture
def machine(tmp_path: Path) -> Machine:
    return Machine(tmp_path, **{"/var/lib/rancher/k3s/server/db/etcd/member": ""})


def switch(machine: Machine, files: dict[str, str] = NEW) -> Change:
    machine.stage(files)
    return machine.change.switch(list(files), [ENVIRONMENT])


def test_what_is_staged_comes_and_what_was_there_is_kept(machine: Machine) -> None:
    machine.stage(NEW)
    assert machine.change.version(f"{BINARY}.next") == NEW[BINARY]
    found = switch(machine)
    assert machine.there() == NEW
    assert (machine.root / "usr/local/bin/k3s.previous").read_text() == OLD[BINARY]
    assert found == machine.change.record()
    assert found.version == OLD[BINARY]
    assert found.unproven
    start = [["daemon-reload"], ["enable", "k3s"], ["restart", "--no-block", "k3s"]]
    assert machine.asked[-3:] == [["systemctl", *words] for words in start]
    assert not list(machine.root.rglob("*.next"))


def test_it_waits_for_the_end_of_the_process_before(machine: Machine) -> None:
    machine.stops_at = 30.0
    switch(machine)
    assert machine.clock.at == pytest.approx(30.0, abs=0.3)
    machine.asked, machine.stops_at = [], 1000.0
    with pytest.raises(FleetError, match="k3s did not stop within 120 s"):
        machine.change.back()


def test_the_way_back_is_what_was_there(machine: Machine) -> None:
    switch(machine)
    machine.stage({CONFIG: "a: 3"})
    for _again in range(2):
        machine.change.back()
        assert machine.there() == OLD
    assert [path.read_text() for path in machine.root.rglob("*.next")] == ["a: 3"]
    assert machine.change.record().unproven
    machine.change.prove()
    with pytest.raises(FleetError, match="no unproven change"):
        machine.change.back()
    # and from there on again
    switch(machine)
    machine.change.back()
    assert machine.there() == OLD


@pytest.mark.parametrize(("is_proven", "kept"), [(False, OLD), (True, NEW)])
def test_a_next_change_goes_back_to_what_was_proven(machine: Machine, is_proven: bool, kept: dict[str, str]) -> None:
    switch(machine)
    if is_proven:
        machine.change.prove()
    switch(machine, {BINARY: "v1.34.4+k3s1", CONFIG: "a: 3"})
    assert machine.change.record().version == kept[BINARY]
    machine.change.back()
    assert machine.there() == kept


def test_nothing_is_exchanged_where_something_is_missing(machine: Machine) -> None:
    with pytest.raises(FleetError, match=r"config.yaml.next is not there"):
        machine.change.switch([CONFIG], [])
    assert machine.there() == OLD
    assert machine.asked == []


@pytest.mark.parametrize(("role", "snapshot"), [("server", True), ("agent", False)])
def test_a_servers_datastore_is_kept_first(tmp_path: Path, role: str, snapshot: bool) -> None:
    machine = Machine(tmp_path, role, **{"/var/lib/rancher/k3s/server/db/etcd/member": ""})
    found = switch(machine)
    saves = [command for command in machine.asked if command[1:3] == ["etcd-snapshot", "save"]]
    asked = ["k3s", "etcd-snapshot", "save", "--name", "rosops-before-v1.34.2"]
    assert [command[:5] for command in saves] == ([asked] if snapshot else [])
    assert found.snapshot == (f"{DB}/snapshots/rosops-before-v1.34.2-edge1-1" if snapshot else "")
    switch(machine)  # a second try writes no second one: what runs is not proven
    assert [command for command in machine.asked if command[1:3] == ["etcd-snapshot", "save"]] == saves


@pytest.mark.parametrize(
    ("fails", "words"),
    [
        ("etcd-snapshot save", r"etcd-snapshot save .*: boom; nothing was exchanged"),
        # k3s ends with 0 where its disk is full: what it was to keep is looked for
        ("", r"left no rosops-before-v1.34.2 in .*/db/snapshots; nothing was exchanged"),
    ],
)
def test_a_datastore_that_cannot_be_kept_forbids_the_change(machine: Machine, fails: str, words: str) -> None:
    machine.fails, machine.full = fails, not fails
    with pytest.raises(FleetError, match=words):
        switch(machine)
    assert machine.there() == OLD
    assert machine.change.record() == Change()


def test_of_all_versions_three_snapshots_stay(machine: Machine) -> None:
    machine.put({f"{DB}/snapshots/{name}": "" for name in ("etcd-snapshot-edge1-1", "on-demand-edge1-2")})
    for patch in range(3, 9):
        found = switch(machine, {BINARY: f"v1.34.{patch}+k3s1"})
        machine.change.prove()
        assert (machine.root / found.snapshot[1:]).exists()
        os.utime(machine.root / found.snapshot[1:], (patch, patch))
    there = sorted(path.name for path in (machine.root / DB[1:] / "snapshots").iterdir())
    ours = [f"rosops-before-v1.34.{before}-edge1-{before - 1}" for before in (5, 6, 7)]
    assert there == ["etcd-snapshot-edge1-1", "on-demand-edge1-2", *ours]


def test_a_database_in_a_file_is_copied_while_nobody_writes_to_it(tmp_path: Path) -> None:
    machine = Machine(tmp_path, **{"/var/lib/rancher/k3s/server/db/state.db": "rows"})
    found = switch(machine)
    assert found.snapshot == "/var/lib/rancher/k3s/server/db.previous"
    assert (tmp_path / "var/lib/rancher/k3s/server/db.previous/state.db").read_text() == "rows"
    assert machine.asked[0] == ["systemctl", "stop", "k3s"]
    assert machine.asked[-1] == ["systemctl", "restart", "--no-block", "k3s"]


def test_k3s_runs_again_where_its_database_could_not_be_copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    machine = Machine(tmp_path, **{"/var/lib/rancher/k3s/server/db/state.db": "rows"})
    monkeypatch.setattr(k3s_change.shutil, "copytree", Mock(side_effect=OSError("no space left on device")))
    with pytest.raises(OSError, match="no space"):
        switch(machine)
    assert machine.asked[-1] == ["systemctl", "start", "--no-block", "k3s"]
    assert machine.there() == OLD


MINOR = {BINARY: "v1.35.0+k3s1"}


@pytest.mark.parametrize(
    ("coming", "datastore", "rows"), [(MINOR, True, "old"), (MINOR, False, "new"), (NEW, True, "new")]
)
def test_an_earlier_minor_version_gets_its_database_back(
    tmp_path: Path, coming: dict[str, str], datastore: bool, rows: str
) -> None:
    machine = Machine(tmp_path, **{f"{DB}/state.db": "old"})
    switch(machine, coming)
    machine.put({f"{DB}/state.db": "new", f"{DB}/state.db-wal": "new"})
    machine.asked = []
    machine.change.back(datastore)
    assert machine.there()[BINARY] == OLD[BINARY]
    assert (tmp_path / f"{DB[1:]}/state.db").read_text() == rows
    assert (tmp_path / f"{DB[1:]}/state.db-wal").exists() is (rows == "new")
    stopped = ["systemctl", "stop", "k3s"] in machine.asked
    assert stopped is (rows == "old")
    assert machine.asked[-1] == ["systemctl", "restart", "--no-block", "k3s"]


def test_an_earlier_minor_version_gets_its_etcd_back(machine: Machine) -> None:
    switch(machine, MINOR)
    # by a clock that was set back; and of a version that begins alike
    os.utime(machine.root / f"{DB[1:]}/snapshots/rosops-before-v1.34.2-edge1-1", (-100, -100))
    machine.put({f"{DB}/snapshots/rosops-before-v1.34.20-edge1-400": ""})
    machine.asked = []
    machine.change.back(datastore=True)
    snapshot = machine.root / f"{DB[1:]}/snapshots/rosops-before-v1.34.2-edge1-1"
    assert machine.asked[:2] == [
        ["systemctl", "stop", "k3s"],
        ["k3s", "server", "--cluster-reset", f"--cluster-reset-restore-path={snapshot}"],
    ]
    assert machine.there()[BINARY] == OLD[BINARY]


@pytest.mark.parametrize("datastore", [True, False])
def test_a_database_that_became_etcd_comes_back_as_it_was(tmp_path: Path, datastore: bool) -> None:
    """k3s takes SQLite's rows over once; an etcd that it did not fill would be taken for the cluster's by the next."""
    machine = Machine(tmp_path, **{f"{DB}/state.db": "old"})
    switch(machine, {CONFIG: "cluster-init: true"})
    (tmp_path / f"{DB[1:]}/state.db").rename(tmp_path / f"{DB[1:]}/state.db.migrated")
    machine.put({f"{DB}/etcd/member": ""})
    machine.change.back(datastore)
    assert (tmp_path / f"{DB[1:]}/state.db").exists() is datastore
    assert (tmp_path / f"{DB[1:]}/etcd").exists() is not datastore
    assert machine.there() == OLD


def test_k3s_starts_where_its_etcd_cannot_be_put_back(machine: Machine) -> None:
    switch(machine, MINOR)
    machine.fails = "--cluster-reset"
    with pytest.raises(FleetError, match=r"cluster-reset.*: boom; it starts with the datastore of the newer one"):
        machine.change.back(datastore=True)
    assert machine.asked[-1] == ["systemctl", "restart", "--no-block", "k3s"]
    assert machine.change.record().unproven


def test_what_has_ended_since_it_served_is_not_proven(machine: Machine) -> None:
    switch(machine)
    start = machine.change.invocation()
    machine.run(["k3s", "ends, and is started again"])
    with pytest.raises(FleetError, match="k3s served, and has ended and started again since"):
        machine.change.prove(start)
    assert machine.change.record().unproven
    machine.change.prove(machine.change.invocation())
    assert not machine.change.record().unproven
    machine.change.prove(start)  # as it is by now


def test_power_lost_at_any_moment_leaves_whole_files_and_the_way_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted by what is written: at each of these moments the power is lost, and somebody goes back, or on."""
    writes: dict[str, Any] = {"link": os.link, "replace": Path.replace}
    moments, left = 0, 0

    def counted(name: str) -> Any:
        def call(*args: Any) -> None:
            nonlocal moments, left
            moments, left = moments + 1, left - 1
            if left == 0:
                raise Cut
            writes[name](*args)

        return call

    monkeypatch.setattr(k3s_change.os, "link", counted("link"))
    monkeypatch.setattr(Path, "replace", counted("replace"))
    switch(Machine(tmp_path / "clean"))
    for at in range(1, moments + 1):
        for on in (False, True):
            machine, left = Machine(tmp_path / f"{at}-{on}"), at
            with pytest.raises(Cut):
                switch(machine)
            whole = {name: {OLD.get(name, ""), NEW.get(name, "")} for name in {**OLD, **NEW}}
            assert all(text in whole[name] for name, text in machine.there().items()), at
            left = 0
            if on:
                switch(machine)
                assert machine.there() == NEW, at
            if machine.change.record().unproven:
                machine.change.back()
            assert machine.there() == OLD, at


# --- certificates -----------------------------------------------------------------------------------------------------

KUBELET, ADMIN = "/var/lib/rancher/k3s/agent/client-kubelet", "/var/lib/rancher/k3s/server/tls/client-admin"
FIRST, SECOND = "Fw0yNjAzMDEwODAwMDBaFw0yNzAzMDEwODAwMDBa", "Fw0yNjExMjYwODAwMDBaFw0yNzExMjYwODAwMDBa"


def issued(validity: str) -> dict[str, str]:
    """What k3s writes for a start that finds none."""
    pem = f"-----BEGIN CERTIFICATE-----\n{validity}\n-----END CERTIFICATE-----\n"
    return {f"{name}.{kind}": pem for name in (KUBELET, ADMIN) for kind in ("crt", "key")}


@pytest.fixture
def certified(tmp_path: Path) -> Machine:
    return Machine(tmp_path, "agent", **issued(FIRST))


def kept_keys(machine: Machine) -> list[Path]:
    return [path for path in machine.root.rglob("*.previous") if "/var/lib/rancher" in str(path)]


def test_certificates_are_made_anew_while_k3s_stands_still(certified: Machine) -> None:
    certified.change.switch([], [], renew=True)
    assert certified.asked == [
        ["systemctl", "stop", "k3s-agent"],
        ["k3s", "certificate", "rotate"],
        ["systemctl", "daemon-reload"],
        ["systemctl", "enable", "k3s-agent"],
        ["systemctl", "restart", "--no-block", "k3s-agent"],
    ]
    assert certified.change.renewed()
    certified.put(issued(SECOND))
    ends = ["2027-03-01T08:00:00", "2027-11-26T08:00:00"]
    assert certified.change.ends()["agent/client-kubelet.crt"] == ends
    assert certified.change.ends()["server/tls/client-admin.crt"] == ends
    assert len(kept_keys(certified)) == 4
    certified.change.prove()
    assert not kept_keys(certified)
    assert not certified.change.renewed()
    assert certified.change.ends()["agent/client-kubelet.crt"] == [ends[1], ends[1]]


def test_those_of_before_come_back(certified: Machine) -> None:
    certified.change.switch([], [], renew=True)
    certified.put(issued(SECOND))
    certified.change.back()
    assert (certified.root / f"{KUBELET[1:]}.key").read_text() == issued(FIRST)[f"{KUBELET}.key"]
    assert not certified.change.renewed()
    certified.change.prove()
    assert not kept_keys(certified)


def test_where_k3s_makes_none_anew_those_of_before_come_back(certified: Machine) -> None:
    certified.fails = "certificate rotate"
    with pytest.raises(FleetError, match=r"certificate rotate: boom"):
        certified.change.switch([], [], renew=True)
    assert not certified.change.renewed()
    certified.change.back()
    assert certified.asked[-1] == ["systemctl", "restart", "--no-block", "k3s-agent"]


@pytest.mark.parametrize("started", [False, True])
def test_what_was_cut_off_is_gone_on_with_and_not_begun_anew(certified: Machine, started: bool) -> None:
    certified.change.switch([], [], renew=True)
    if started:
        certified.put(issued(SECOND))
    certified.asked = []
    certified.change.switch([], [], renew=True)
    assert [words for words in certified.asked if "certificate" in words or "stop" in words] == []
    assert certified.asked[-1] == ["systemctl", "restart", "--no-block", "k3s-agent"]
    certified.put(issued(SECOND))
    assert certified.change.ends()["agent/client-kubelet.crt"][0] == "2027-03-01T08:00:00"


def test_another_unproven_change_is_no_rotation(certified: Machine) -> None:
    certified.stage({CONFIG: "a: 2"})
    certified.change.switch([CONFIG], [])
    assert not certified.change.renewed()
    certified.change.switch([], [], renew=True)
    assert ["k3s", "certificate", "rotate"] in certified.asked
    certified.change.back()
    assert certified.there() == OLD
    assert (certified.root / f"{KUBELET[1:]}.key").exists()
