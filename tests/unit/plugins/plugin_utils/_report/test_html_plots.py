# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The plots of the status page by themselves; in the page: test_html_report."""

from __future__ import annotations

import pytest
from ansible_collections.rosops.fleet.plugins.plugin_utils._report.html_plots import plots, rate_words


def test_nothing_to_draw() -> None:
    assert plots({}) == []
    assert (
        plots({"topics": [{"rate": None}], "steps": [{"phases": {}}], "claims": [{"size": "", "used_bytes": 1}]}) == []
    )


def test_a_phase_that_is_not_known_has_a_colour_and_its_name() -> None:
    step = {"robot": "r", "name": "a", "outcome": "updated", "seconds": 3.0, "phases": {"later": 1.0, "gate": 2.0}}
    (figure,) = plots({"steps": [step]})
    assert 'class="c5"' in figure and "later 1.0 s" in figure
    assert figure.index("</svg>gate</li>") < figure.index("</svg>later</li>")


def test_a_claim_beyond_its_size_is_full() -> None:
    claim = {"robot": "r", "name": "c", "bound": True, "size": "1Ki", "used_bytes": 4096}
    (figure,) = plots({"claims": [claim]})
    assert 'width="100.00%"' in figure and "4.0 KiB of 1Ki" in figure and 'class="c2"' in figure


@pytest.mark.parametrize(
    ("rate", "words"),
    [
        (0, "0 Hz"),
        (-1, "0 Hz"),
        (0.04, "0.040 Hz"),
        (0.9999, "1.00 Hz"),
        (9.999, "10.0 Hz"),
        (99.96, "100 Hz"),
        (1e4, "10000 Hz"),
    ],
)
def test_rates_have_three_digits(rate: float, words: str) -> None:
    assert rate_words(rate) == words
