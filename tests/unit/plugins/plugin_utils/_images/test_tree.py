# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""Which Python an image has, by what its layers hold."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.tree import merged, python_version

Layer = dict[str, str | None]  # path -> None for a directory, the empty text for a file, or a link's target

DEBIAN: Layer = {"usr/bin": None, "usr/bin/python3": "python3.11", "usr/bin/python3.11": ""}
BIONIC: Layer = {"usr/bin/python3": "python3.6", "usr/bin/python3.6": ""}
DIRECTORIES = ("/usr/local/bin", "/usr/bin", "/bin")


def python(*layers: Layer) -> str | None:
    return python_version(merged([[*one.items()] for one in layers]), DIRECTORIES)


@pytest.mark.parametrize(
    ("layers", "version"),
    [
        ([DEBIAN], "3.11"),
        ([BIONIC], "3.6"),
        ([], ""),
        ([{"bin": None, "bin/busybox": "", "bin/sh": "/bin/busybox"}], ""),
        ([{"usr/bin/python": "", "usr/bin/python2.7": "", "usr/lib/python3": None}], ""),
        ([{"usr/bin/python3": None}], ""),  # a directory
        # as `make install` leaves it, found before the distribution's
        ([BIONIC, {"usr/local/bin/python3": "python3.8", "usr/local/bin/python3.8": ""}], "3.8"),
        ([DEBIAN, {"usr/local/bin/python3": "/opt/py/bin/python3.7m", "opt/py/bin/python3.7m": ""}], "3.7"),
        # over the links of alternatives, of directories, and upwards
        ([{"usr/bin/python3": "/etc/alternatives/python3", "etc/alternatives/python3": "../../usr/bin/python3.9"},
          {"usr/bin/python3.9": ""}], "3.9"),
        ([{"bin": "usr/bin", "usr/bin/python3": "../../bin/./python3.10", "usr/bin/python3.10": ""}], "3.10"),
        ([{"bin": "opt/bin", "opt/bin/python3": "python3.12", "opt/bin/python3.12": ""}], "3.12"),
        # links that lead nowhere, or for ever
        ([{"usr/bin/python3": "python3.11"}], ""),
        ([{"usr/bin/python3": "python3"}], ""),
        ([{"usr/bin/python3": "b", "usr/bin/b": "python3"}], ""),
        ([{"usr/local/bin/python3": "gone"}, DEBIAN], "3.11"),
        # what does not say its version
        ([{"usr/bin/python3": ""}], None),
        ([{"usr/bin/python3": "/opt/pypy/bin/pypy3", "opt/pypy/bin/pypy3": ""}], None),
        # what a higher layer takes away, or has otherwise
        ([DEBIAN, {"usr/bin/.wh.python3": ""}], ""),
        ([DEBIAN, {"usr/bin/.wh.python3.11": ""}], ""),
        ([DEBIAN, {"usr/.wh.bin": ""}], ""),
        ([DEBIAN, {".wh.usr": ""}], ""),
        ([DEBIAN, {"usr/bin/.wh..wh..opq": ""}], ""),
        ([DEBIAN, {".wh..wh..opq": ""}], ""),
        ([DEBIAN, {"usr/bin/.wh.python": "", "usr/.wh.bi": ""}], "3.11"),  # names that are only like it
        ([DEBIAN, {"usr/bin/.wh..wh..opq": "", **BIONIC}], "3.6"),  # what stands beside the mark stays
        ([DEBIAN, {"usr/bin/.wh.python3": ""}, DEBIAN], "3.11"),
        ([{"usr/bin/.wh.python3": ""}, DEBIAN], "3.11"),
        ([BIONIC, DEBIAN], "3.11"),
        ([{**DEBIAN, "bin": "usr/bin"}, {"bin": None}, {"usr/bin/.wh.python3": ""}], ""),
    ],
)  # fmt: skip
def test_the_python_of_an_image(layers: list[Layer], version: str | None) -> None:
    assert python(*layers) == version
