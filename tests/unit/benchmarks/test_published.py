# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What other benchmarks publish for the page."""

from __future__ import annotations

from pathlib import Path

from published import Table, publish, published
from update.page import section


def test_a_published_table_is_a_section_of_the_page(tmp_path: Path) -> None:
    table = Table("Many robots", "On a machine.", ["robots", "s"], [["10", "1.5"]])
    publish("second", Table("Later", "", [], []), tmp_path)
    publish("first", table, tmp_path)
    [first, second] = published(tmp_path)
    assert (first, second.title) == (table, "Later")
    assert section(first).splitlines()[:3] == ["## Many robots", "", "On a machine."]
    assert "| 10     | 1.5 |" in section(first)
