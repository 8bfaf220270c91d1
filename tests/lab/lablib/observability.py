# SPDX-License-Identifier: GPL-3.0-or-later
"""The programs that watch a fleet, as images under the real ones' names: which there are, and where they are built.

They are built only when asked for: nothing else of the lab needs them, and the first build takes a quarter of an hour.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .artifacts import Cache, Recipe
from .errors import LabError
from .go import go_pin
from .oci import architecture
from .paths import OBSERVABILITY, pins

_CODE = ("observability_build.py", "oci.py")
_GO_CODE = ("go.py", *_CODE)
_DEBIAN_CODE = ("debian.py", *_CODE)


@dataclass(frozen=True)
class Part:
    """One image, as the pins describe it, made of a module or of packages; pins.toml says what each of these means."""

    name: str
    image: str
    programs: Mapping[str, str]
    tools: Mapping[str, str] = field(default_factory=dict)
    module: str = ""
    sums: str = ""
    version: str = ""
    version_variable: str = ""
    tags: Sequence[str] = ()
    packages: Sequence[str] = ()
    files: Sequence[str] = ()
    command: Sequence[str] = ()
    user: str = "0"
    directories: Sequence[str] = ()

    @property
    def module_directory(self) -> Path:
        return OBSERVABILITY / self.name

    @property
    def archive(self) -> str:
        """Its file name, which says what is in it."""
        return f"{self.name}-{self.image.rpartition(':')[2]}.tar"


def parts() -> dict[str, Part]:
    return {name: Part(name, **pinned) for name, pinned in pins()["observability"].items()}


def recipe(part: Part) -> Recipe:
    made_of = {"go": go_pin()} if part.module else {"suite": pins()["debian"]["suite"]}
    code = _GO_CODE if part.module else _DEBIAN_CODE
    return Recipe(
        kind=f"observability-{part.name}",
        title=part.image,
        values={
            "pins": pins()["observability"][part.name],
            "archive": part.archive,
            "architecture": architecture(),
            **made_of,
        },
        files=(*([part.module_directory] if part.module else ()), *(Path(__file__).with_name(name) for name in code)),
    )


def choose(names: Iterable[str]) -> list[Part]:
    """The parts of these names; all of them where none is named."""
    known = parts()
    wanted = list(names) or list(known)
    if unknown := [name for name in wanted if name not in known]:
        raise LabError(f"{', '.join(unknown)}: no such part", todo=f"name some of {', '.join(known)}")
    return [known[name] for name in wanted]


def built(cache: Cache) -> dict[str, Any]:
    """What the inventory offers: the archives that are there now, as they are, and which image each of them holds."""
    found = [(part, cache.path(recipe(part)) / part.archive) for part in parts().values()]
    there = {part.image: str(archive) for part, archive in found if archive.is_file()}
    return {"observability_archives": list(there.values()), "observability_images": there} if there else {}


def part_with(program: str) -> Part:
    """The part whose image, or whose tools, have a program of this name."""
    names: dict[str, Part] = {}
    for part in parts().values():
        names.update(dict.fromkeys([*(Path(place).name for place in part.programs), *part.tools], part))
    if program not in names:
        raise LabError(f"{program}: no such program", todo=f"name one of {', '.join(sorted(names))}")
    return names[program]


def program_path(artifact: Path, part: Part, program: str) -> Path:
    """Where a program is in the part's artifact."""
    inside = next((place for place in part.programs if Path(place).name == program), "")
    return artifact / "root" / inside.lstrip("/") if inside else artifact / "tools" / program
