# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from the lab's hosts: the applications' logs and the cgroups' counters. I/O."""

from __future__ import annotations

import io
import json
import subprocess
import tarfile
from pathlib import Path
from types import TracebackType
from typing import IO

from .cluster import EDGE, ROBOT, STORAGE, Cluster
from .jsonlog import Lines, lines
from .usage import Samples

Logs = dict[str, dict[str, Lines]]  # app -> file -> records


def pattern(namespace: str) -> str:
    """The directories of a namespace's claims on a host, for the shell."""
    return f"{STORAGE}/pvc-*_{namespace}_*"


def read_logs(cluster: Cluster, namespace: str, keep: Path) -> Logs:
    """The logs on the namespace's claims, straight from the hosts' disks; the originals are kept as they are."""
    found: Logs = {}
    for host in (EDGE, ROBOT):
        packed = cluster.ssh(host, f"tar -cz {pattern(namespace)}", check=False)
        keep.with_name(f"{keep.name}-{host}.tar.gz").write_bytes(packed)
        if not packed:
            continue
        with tarfile.open(fileobj=io.BytesIO(packed), mode="r:gz") as tar:
            for member in tar.getmembers():
                file = tar.extractfile(member) if member.isfile() and member.name.endswith(".jsonl") else None
                if file is not None:
                    path = Path(member.name)
                    found.setdefault(path.parent.name, {})[path.name] = lines(file.read().decode(errors="replace"))
    return found


def wipe_logs(cluster: Cluster, namespace: str) -> None:
    """Empty the claims, so that the next round's applications begin from nothing."""
    for host in (EDGE, ROBOT):
        cluster.ssh(host, f"for d in {pattern(namespace)}; do find $d -mindepth 1 -delete; done", check=False)


class Sampling:
    """Samples both hosts for as long as it is open."""

    def __init__(self, cluster: Cluster, keep: Path) -> None:
        self._cluster = cluster
        self._paths = {host: keep.with_name(f"{keep.name}-{host}-usage.jsonl") for host in (EDGE, ROBOT)}
        self._running: list[tuple[subprocess.Popen[bytes], IO[bytes]]] = []

    def __enter__(self) -> Sampling:
        script = Path(__file__).with_name("sampler.py").read_bytes()
        for host, path in self._paths.items():
            file = path.open("wb")
            process = subprocess.Popen(  # noqa: S603 - our own
                self._cluster.ssh_words(host, "exec python3 -"), stdin=subprocess.PIPE, stdout=file
            )
            assert process.stdin is not None
            process.stdin.write(script)
            process.stdin.close()
            self._running.append((process, file))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        for process, file in self._running:
            process.terminate()
            process.wait(timeout=10)
            file.close()

    def samples(self) -> dict[str, Samples]:
        """Host -> what was sampled."""
        return {host: _samples(path) for host, path in self._paths.items()}


def _samples(path: Path) -> Samples:
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue  # cut off when the sampling ended
    return found
