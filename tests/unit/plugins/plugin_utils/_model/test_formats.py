# SPDX-License-Identifier: GPL-3.0-or-later
"""How values look, and lists that come as text: answers of AWX's survey, and what `-e name=value` gives."""

from __future__ import annotations

from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.plugin_utils._model.formats import (
    FORMS,
    listed,
    moving_tag,
    quantity_value,
    wrong_waves,
)


@pytest.mark.parametrize(
    ("form", "good", "bad"),
    [
        (
            "quantity",
            ["0", "1", "1.5", "100m", "1Gi", "2e3", "5E", "1Ki"],
            ["", "1GB", "Gi", "-1", "1 Gi", "1.", "1e", ".5"],
        ),
        (
            "image",
            ["ros", "ros:noetic", "example.org:5000/a/b_c:1.0", "a@sha256:" + "0" * 64, "localhost/x:1"],
            ["", "A", "a:", "a@", "a@sha256:0123", "http://a", "a//b", "a b", ":1"],
        ),
        ("app-name", ["a", "a-1"], ["", "1a", "-a", "a-", "A", "a_b", "a.b", "a" * 41]),
        ("robot-name", ["robot1", "7", "a-b"], ["", "a.b", "a_b", "A", "a" * 58, "robot1\n"]),
        (
            "graph-name",
            ["a", "/a/b", "~a", "a/1", "/3d/points", "~/3d", "~3d"],
            ["", "/", "~", "1a", "a-b", "a//b", "a/", "/a b", "ä"],
        ),
        ("graph-pattern", ["/*", "/3d/*", "~status", "*"], ["", "/", "1a", "/a//*"]),
        ("param-name", ["a/b", "/3d/x"], ["", "/", "1a", "~a", "/a//b"]),
        (
            "host-path",
            ["/data", "/data/x", "/dev/input", "/home/a"],
            [
                *("/home", "/dev", "/", "/datax", "/data-x", "/data//x", "/data/./x", "data/x", "/etc/ssh", "/proc"),
                *("/sys/class/gpio", "/run/k3s/containerd/containerd.sock", "/var/lib/rancher/k3s", "/var/lib/kubelet"),
            ],
        ),
        ("device", ["/dev/ttyUSB0", "/dev/bus/usb/"], ["/dev", "/dev/..", "/devices", "dev/x", "/dev/mem"]),
        ("mount-path", ["/a", "/a/b/"], ["", "/", "a", "/a:b", "/a/../b", "/a b"]),
        ("port-name", ["web", "a1", "9a", "a-b", "a" * 15], ["", "9", "a" * 16, "a--b", "-a", "A"]),
        ("secret-key", ["a", "A.b-c_d", ".x"], ["", "a b", "a/b", "a" * 254]),
        ("file-mode", ["0644", "0755"], ["", "644", "0888", "07777"]),
        (
            "master-uri",
            ["http://a:1", "http://1.2.3.4:11311/"],
            ["a:1", "http://a", "http://1.2.3:1", "http://a:0", "http://a:113110", "https://a:1", "http://:1"],
        ),
        ("env-name", ["A", "_a1"], ["", "1A", "A-B", "A B"]),
        ("unicode", ["", "a: ä\n"], ["\ud800"]),  # half of a surrogate pair
    ],
)
def test_forms(form: str, good: list[str], bad: list[str]) -> None:
    assert [text for text in good if not FORMS[form].test(text)] == []
    assert [text for text in bad if FORMS[form].test(text)] == []


def test_quantities_compare() -> None:
    values = [quantity_value(text) for text in ("1n", "1m", "0.5", "1", "1k", "1Ki", "1e6", "1Mi")]
    assert None not in values
    assert values == sorted(values)  # type: ignore[type-var]
    assert (quantity_value("1Ki"), quantity_value("1k"), quantity_value("1Gi")) == (1024, 1000, 1024**3)


@pytest.mark.parametrize(
    ("image", "moving"),
    [("a", True), ("a:latest", True), ("a:1", False), ("h:5000/a", True), ("a@sha256:" + "0" * 64, False)],
)
def test_moving_tags(image: str, moving: bool) -> None:
    assert moving_tag(image) is moving


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (None, []),
        ("  \n", []),
        ([], []),
        (["a", 1], ["a", 1]),
        (("a",), ["a"]),
        (1, [1]),
        ("camera", ["camera"]),
        ("camera, lidar", ["camera", "lidar"]),
        ("camera\nlidar\n", ["camera", "lidar"]),
        ("1 25% 100%", ["1", "25%", "100%"]),
        ("[camera, lidar]", ["camera", "lidar"]),
    ],
)
def test_what_was_meant(given: Any, meant: list[Any]) -> None:
    assert [str(one) for one in listed(given)] == [str(one) for one in meant]


@pytest.mark.parametrize("given", ["[a, b", "[a]: b", "[a] b", "[2026-13-01]", f"[{5000 * '1'}]"], ids=range(5))
def test_what_begins_as_a_list_has_to_be_one(given: str) -> None:
    with pytest.raises(SpecError, match="is no list; allowed: a list, or words with commas"):
        listed(given)


@pytest.mark.parametrize(
    ("waves", "wrong"),
    [
        *((waves, "") for waves in (None, "", 1, "1", "100%", [1, "25%", "100%"], "[1, 25%, 100%]", "1, 050%")),
        ("all", "has 'all'"),
        ("0", "has '0'"),
        ([0], "has 0"),
        ("0%", "has '0%'"),
        ("101%", "has '101%'"),
        ([True], "has True"),
        ([1.5], "has 1.5"),
        ("[1", "'[1' is no list"),
    ],
)
def test_waves_that_ansible_would_stumble_over(waves: Any, wrong: str) -> None:
    found = wrong_waves(waves)
    assert (bool(found), found[: len(wrong)]) == (bool(wrong), wrong)
