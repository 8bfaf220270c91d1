# SPDX-License-Identifier: GPL-3.0-or-later
"""A binary comes whole and checked, or not at all; through the proxies that k3s itself goes through."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import FleetError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import fetch, listed_sum, proxies

BINARY = b"k3s" * 1000
SUM = hashlib.sha256(BINARY).hexdigest()


class Network:
    def __init__(self, content: bytes = BINARY) -> None:
        self.content, self.asked = content, list[str]()

    def __call__(self, url: str) -> io.BytesIO:
        self.asked.append(url)
        return io.BytesIO(self.content)


def test_it_comes_whole_and_once(tmp_path: Path) -> None:
    network, place = Network(), tmp_path / "k3s"
    assert fetch(network, "https://x/k3s", place, SUM)
    assert (place.read_bytes(), place.stat().st_mode & 0o777) == (BINARY, 0o755)
    assert not fetch(network, "https://x/k3s", place, SUM)
    assert network.asked == ["https://x/k3s"]
    assert [path.name for path in tmp_path.iterdir()] == ["k3s"]


def test_what_is_not_what_it_should_be_does_not_come(tmp_path: Path) -> None:
    place = tmp_path / "k3s"
    place.write_text("the one before")
    with pytest.raises(FleetError, match=f"expected is {SUM}"):
        fetch(Network(b"something else"), "https://x/k3s", place, SUM)
    assert place.read_text() == "the one before"
    assert [path.name for path in tmp_path.iterdir()] == ["k3s"]


def test_a_list_of_sums() -> None:
    text = f"{'0' * 64}  k3s-arm64\n{SUM}  k3s\n"
    assert listed_sum(text, "k3s", "https://x/sums") == SUM
    with pytest.raises(FleetError, match="https://x/sums has no SHA-256 of k3s-armhf"):
        listed_sum(text, "k3s-armhf", "https://x/sums")


def test_proxies_out_of_the_units_environment() -> None:
    found = proxies({"HTTPS_PROXY": "http://me:s3cret@proxy:3128", "no_proxy": "10.0.0.0/8", "K3S_DEBUG": True})
    assert found == {
        "https_proxy": "http://me:s3cret@proxy:3128",
        "HTTPS_PROXY": "http://me:s3cret@proxy:3128",
        "no_proxy": "10.0.0.0/8",
        "NO_PROXY": "10.0.0.0/8",
    }
