# SPDX-License-Identifier: GPL-3.0-or-later
"""Put a staged k3s (binary, configuration, unit) in place of the one that runs, and keep that one to go back to.

What is to come lies beside its place as `<path>.next`, what was there stays as `<path>.previous`, and a record says
which files there were and whether the change is proven. As long as it is not, nothing that is kept is written over: a
change that was cut off, or tried again, goes back to what last worked. Each file is exchanged at once, so that a cut
leaves whole files.
"""

from __future__ import annotations

import json
import os
import shutil
import time
from typing import Iterable, Mapping, NamedTuple

from .._common.errors import FleetError
from .._common.poll import PASS, WAIT, Seen, poll
from .certificates import KUBELET_KEY, end_of, renewable
from .k3s import BINARY, DATA_DIR, ETCD, SERVICES, K3sHost, Run

RECORD = "/var/lib/rosops-fleet/k3s-change.json"
NEXT, PREVIOUS = ".next", ".previous"
SNAPSHOT = "rosops-before"
SNAPSHOTS_KEPT = 3
STOP_TIMEOUT = 120.0  # systemd kills after 90 s
DATABASE = f"{DATA_DIR}/server/db"
SQLITE = f"{DATABASE}/state.db"
SNAPSHOTS = f"{DATABASE}/snapshots"
DATABASE_COPY = f"{DATABASE}.previous"
DATABASE_LEFT = f"{DATABASE}.left"  # that of a version which was taken back


class Change(NamedTuple):
    """The last one: `version` and `files` (path -> whether it was there) before it, and where its datastore is kept."""

    version: str = ""
    files: Mapping[str, bool] = {}
    unproven: bool = False
    snapshot: str = ""


class K3sChange(K3sHost):
    """Exchanges a host's k3s."""

    def __init__(self, run: Run, role: str, root: str = "/") -> None:
        super().__init__(run, root)
        self.service, self.server = SERVICES[role], role == "server"
        self.now, self.sleep = time.monotonic, time.sleep

    def record(self) -> Change:
        """Empty where there was none."""
        try:
            found = json.loads(self.read(RECORD))
            return Change(**{key: found[key] for key in Change._fields if key in found})
        except (ValueError, TypeError):
            return Change()

    def switch(self, write: Iterable[str], remove: Iterable[str], renew: bool = False) -> Change:
        """Keep what is there, exchange it, and start k3s again. FleetError before anything was exchanged.

        With `renew` its certificates are made anew, too. What was cut off after these were taken away only starts.
        """
        coming, going = list(write), [name for name in remove if self.path(name).exists()]
        missing = [name for name in coming if not self.path(name + NEXT).exists()]
        if missing:
            raise FleetError(f"{', '.join(name + NEXT for name in missing)} is not there; nothing was exchanged")
        try:
            record = self._keep([*coming, *going, *(renewable(self) if renew else ())])
        except (FleetError, OSError):
            self.must("systemctl", "start", "--no-block", self.service)  # it may have been stopped for its database
            raise
        for name in coming:
            self.path(name + NEXT).replace(self.path(name))
        for name in going:
            self.path(name).unlink()
        if renew and not self.renewed():
            self.must("systemctl", "stop", self.service)
            self.must(str(self.path(BINARY)), "certificate", "rotate")
        self._start()
        return record

    def back(self, datastore: bool = False) -> Change:
        """What was there before the change that is not proven, and start k3s again.

        With `datastore` that, too, where the change was to another minor version, or from SQLite to etcd: a k3s does
        not go back to the earlier one without. What the cluster was told since is lost then, so it is for a change of
        just now, on a server that shares its datastore with no other.
        """
        record = self.record()
        if not record.unproven:
            raise FleetError("there is no unproven change of k3s to go back from")
        kept = ""
        became_etcd = record.snapshot == DATABASE_COPY and self.path(ETCD).exists()
        if datastore and (became_etcd or _minor(record.version) != _minor(self.version())):
            kept = record.snapshot if self.path(record.snapshot).exists() else ""
        if kept:
            self.must("systemctl", "stop", self.service)
        for name, existed in record.files.items():
            if existed:
                self._link(name + PREVIOUS, name)
            else:
                self.path(name).unlink(missing_ok=True)
        try:
            if kept:
                self._restore(kept)
        finally:
            self._start()
        return record

    def prove(self, start: str = "") -> None:
        """What runs is proven: the next change keeps it.

        `start` names the start of the unit that was proven; FleetError if there was another one since.
        """
        record = self.record()
        if record.unproven:
            if start and self.invocation() != start:
                raise FleetError(f"{self.service} served, and has ended and started again since")
            self._write(record._replace(unproven=False))
            for name in (name for name in record.files if name.startswith(DATA_DIR)):
                self.path(name + PREVIOUS).unlink(missing_ok=True)  # a key of before is of no more use

    # --- certificates -----------------------------------------------------------------------------------------------

    def renewed(self) -> bool:
        """Whether the change that nobody has proven has taken the certificates away, or there are new ones by now."""
        record, key = self.record(), self.path(KUBELET_KEY)
        if not (record.unproven and record.files.get(KUBELET_KEY)):
            return False
        return not (key.exists() and key.samefile(self.path(KUBELET_KEY + PREVIOUS)))

    def ends(self) -> dict[str, list[str]]:
        """When each certificate ended before the change that nobody has proven, and when it ends now."""
        record = self.record()
        kept = record.files if record.unproven else {}
        found = {}
        for name in renewable(self):
            ends = [end_of(self.read(name + PREVIOUS if kept.get(name) else name)), end_of(self.read(name))]
            if all(ends):
                found[name[len(DATA_DIR) + 1 :]] = ends
        return found

    # --- keeping ----------------------------------------------------------------------------------------------------

    def _keep(self, names: Iterable[str]) -> Change:
        before = self.record()
        files = dict(before.files) if before.unproven else {}
        for name in (name for name in names if name not in files):
            files[name] = self.path(name).exists()
            if files[name]:
                self._link(name, name + PREVIOUS)
        version = before.version if before.unproven else self.version()
        snapshot = before.snapshot if before.unproven else self._snapshot(version)
        record = Change(version, files, True, snapshot)
        self._write(record)
        return record

    def _snapshot(self, version: str) -> str:
        """A copy of the datastore as it is now: where it is; empty where this host holds none."""
        if not self.server:
            return ""
        if self.path(ETCD).exists():
            name, there = f"{SNAPSHOT}-{version.partition('+')[0]}", self.path(SNAPSHOTS)
            before = sorted(there.glob(f"{SNAPSHOT}-*"), key=lambda path: path.stat().st_mtime)
            # older ones go here: k3s would count those of each version by themselves, and be silent about what stays
            for old in before[: 1 - SNAPSHOTS_KEPT]:
                old.unlink()
            left = "nothing was exchanged"
            # its directory is said, as `k3s_config` may have another
            save = ("etcd-snapshot", "save", "--name", name, "--etcd-snapshot-dir", str(there))
            self.must(str(self.path(BINARY)), *save, otherwise=left)
            made = set(there.glob(f"{name}-*")) - set(before)
            if not made:  # a full disk is no error to k3s
                raise FleetError(f"k3s etcd-snapshot save left no {name} in {there}; {left}")
            return f"/{made.pop().relative_to(self.root)}"
        if self.path(SQLITE).exists():
            # only a database that nobody writes to is copied whole
            self.must("systemctl", "stop", self.service)
            shutil.rmtree(str(self.path(DATABASE_COPY)), ignore_errors=True)
            shutil.copytree(str(self.path(DATABASE)), str(self.path(DATABASE_COPY)))
            return DATABASE_COPY
        return ""

    def _restore(self, kept: str) -> None:
        """Put the datastore that was kept in place of the one that a newer k3s has changed. k3s is stopped."""
        if kept != DATABASE_COPY:
            reset = ("server", "--cluster-reset", f"--cluster-reset-restore-path={self.path(kept)}")
            self.must(str(self.path(BINARY)), *reset, otherwise="it starts with the datastore of the newer one")
            return
        new, old = self.path(f"{DATABASE}.new"), self.path(DATABASE_LEFT)
        for place in (new, old):
            shutil.rmtree(str(place), ignore_errors=True)
        shutil.copytree(str(self.path(kept)), str(new))
        self.path(DATABASE).rename(old)
        new.rename(self.path(DATABASE))

    def _link(self, name: str, other: str) -> None:
        """The same file under another name, put there at once. A binary of 70 MB is not copied."""
        new = self.path(f"{other}.new")
        new.unlink(missing_ok=True)
        os.link(str(self.path(name)), str(new))
        new.replace(self.path(other))
        new.unlink(missing_ok=True)  # rename does nothing where both names are of one file

    def _write(self, record: Change) -> None:
        place, new = self.path(RECORD), self.path(f"{RECORD}.new")
        place.parent.mkdir(parents=True, exist_ok=True)
        with new.open("w", encoding="utf-8") as file:
            file.write(json.dumps(record._asdict(), sort_keys=True))
            file.flush()
            os.fsync(file.fileno())
        new.replace(place)

    # --- commands ---------------------------------------------------------------------------------------------------

    def _start(self) -> None:
        """Start it again. Returns when the process before is gone, which would still answer for the new one."""
        self.must("systemctl", "daemon-reload")
        self.must("systemctl", "enable", self.service)  # somebody may have taken it out of the boot
        before = self.invocation()
        self.must("systemctl", "restart", "--no-block", self.service)

        def end() -> Seen:
            return Seen(WAIT if self.invocation() == before else PASS)

        if poll(end, STOP_TIMEOUT, 0.2, now=self.now, sleep=self.sleep).verdict != PASS:
            raise FleetError(f"{self.service} did not stop within {STOP_TIMEOUT:g} s")

    def invocation(self) -> str:
        """systemd's name for this one start of the unit."""
        return str(self.run(["systemctl", "show", self.service, "-p", "InvocationID", "--value"])[1]).strip()


def _minor(version: str) -> list[str]:
    return version.split(".")[:2]
