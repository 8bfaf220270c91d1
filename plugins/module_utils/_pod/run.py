# SPDX-License-Identifier: GPL-3.0-or-later
"""The entry of what runs in pods, there as `run.py`: `python3 run.py exec|started|stop|sidecar|keeper`.

Nothing more than the way to the command's own module, because a script, unlike a module, is compiled at every start.
"""

# importing pathlib would cost as much as all the rest of a call:
# ruff: noqa: PTH100, PTH110, PTH120
from __future__ import annotations

import importlib
import os
import sys
from importlib.machinery import ModuleSpec, SourceFileLoader
from types import ModuleType

COMMANDS = {
    "exec": "_pod.exec",
    "started": "_pod.started",
    "stop": "_pod.stop",
    "sidecar": "_pod.sidecar",
    "keeper": "_robot.main",
}
# Who lives long, and what modules of the standard library load there if they can, and nobody needs: OpenSSL of hashlib,
# and what shutil packs archives with.
LONG, LEFT_OUT = "keeper", ("_hashlib", "bz2", "lzma")
COMPILED = "ROSOPS_COMPILED"
ROOT = "rosops_fleet"
ARCHIVE = "code.json.gz"  # of the modules: `_ros.gate` -> its source, as JSON; what is started by its path is beside it
GZIP = 31  # zlib's word for it


class Loader(SourceFileLoader):
    """Takes a module's source out of the archive, and what was compiled from the disk.

    Knows whether a module had to be compiled, and what came of it was kept.
    """

    compiled = False

    def __init__(self, name: str, path: str, rooms: Rooms) -> None:
        super().__init__(name, path)
        self.rooms = rooms

    def path_stats(self, _path: str) -> dict[str, int | None]:
        return {"mtime": self.rooms.version, "size": None}

    def get_data(self, path: str) -> bytes:
        source = self.rooms.source(self.name[len(ROOT) + 1 :]) if path == self.path else None
        return super().get_data(path) if source is None else source.encode()

    def set_data(self, path: str, data: bytes, *, _mode: int = 0) -> None:  # type: ignore[override] # of typing
        super().set_data(path, data, _mode=0o644)
        Loader.compiled = Loader.compiled or os.path.exists(path)


class Rooms:
    """Finds the module `_ros.gate` by a path that is mostly no file, `_ros.gate.py`; `_ros` is a directory.

    Opens the archive at the start, and reads it when the first module has to be compiled. So whatever a process imports
    late is of the version that it was started with: a file that the kubelet replaces is there as long as it is open.
    """

    def __init__(self, directory: str) -> None:
        self.directory, self.file = directory, os.open(f"{directory}/{ARCHIVE}", os.O_RDONLY)
        status = os.fstat(self.file)
        self.version = status.st_mtime_ns + status.st_size  # a compiled module keeps 32 bits of it
        self.sources: dict[str, str] = {}

    def source(self, module: str) -> str | None:
        """Of a module, as `_ros.gate`; none of what is beside it."""
        if not self.sources:
            # not needed by a start that finds all compiled
            import json  # noqa: PLC0415
            import zlib  # noqa: PLC0415

            with open(self.file, "rb") as file:  # noqa: PTH123
                self.sources = json.loads(zlib.decompress(file.read(), GZIP))
        return self.sources.get(module)

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> ModuleSpec | None:
        root, _dot, module = name.partition(".")
        if root != ROOT:
            return None
        if "." not in module:
            return ModuleSpec(name, None, is_package=True)
        file = f"{self.directory}/{module}.py"
        spec = ModuleSpec(name, Loader(name, file, self), origin=file)
        spec.has_location = True
        return spec


def leave_out() -> None:
    modules: dict[str, object] = sys.modules  # type: ignore[assignment]
    modules.update(dict.fromkeys(LEFT_OUT))
    # http.server takes one function of html, which brings the names of two thousand characters along, 0.6 MB
    modules["html.entities"] = entities = ModuleType("html.entities")
    entities.html5 = {}  # type: ignore[attr-defined]


def begin_anew(words: list[str]) -> None:
    """The same process, with its memory as new."""
    os.execv(sys.executable, [sys.executable, "-I", "-S", "-OO", *words])  # noqa: S606 - ourselves


def main(words: list[str]) -> int:
    """Import the command's module out of the directory that this file appears in, and run it."""
    if len(words) < 2 or words[1] not in COMMANDS:
        sys.stdout.write(f"usage: run.py {'|'.join(COMMANDS)}\n")
        return 2
    # not the real path: a ConfigMap's files are links, and the other files are where they appear
    directory = os.path.dirname(os.path.abspath(words[0]))
    if words[1] == LONG and sys.flags.optimize < 2:
        begin_anew(words)  # without the texts that explain the standard library, 0.6 MB
    # The mount is read-only, so compiled modules go where the pod may write; a directory per user, as nobody else's is
    # to be trusted.
    sys.pycache_prefix = f"/tmp/rosops-fleet-{os.getuid()}/pycache"  # noqa: S108
    sys.meta_path.append(Rooms(directory))
    if words[1] == LONG:
        leave_out()
    module = importlib.import_module(f"{ROOT}.{COMMANDS[words[1]]}")
    if words[1] == LONG and Loader.compiled and COMPILED not in os.environ:
        # To compile leaves 5 MB of holes in the memory, which a process that finds all compiled has no use for.
        os.environ[COMPILED] = "yes"
        begin_anew(words)
    result: int = module.main(words[2:])
    if result < 0:  # it asks for that, as its code has changed
        os.environ.pop(COMPILED, None)
        begin_anew(words)
    return result


if __name__ == "__main__":
    raise SystemExit(main(sys.argv))
