# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""What is done beside a block ends with it."""

from __future__ import annotations

import threading

from ansible_collections.rosops.fleet.plugins.plugin_utils._update.ticker import ticking


def test_it_ticks_until_the_block_ends() -> None:
    ticked, threads = threading.Event(), threading.active_count()
    with ticking(0.001, ticked.set):
        assert ticked.wait(10.0)
    assert threading.active_count() == threads
