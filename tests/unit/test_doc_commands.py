# SPDX-License-Identifier: GPL-3.0-or-later
"""Every command of README, docs and the roles' READMEs is run by a test, or marked as one that is not.

The mark is a comment right above the block, which readers do not see: `<!-- not run: needs real hosts -->`.
A block that is none of commands has `<!-- not commands -->`, or a fence with another language.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

import pytest
from doc_blocks import CHECKOUT, PAGES, Block, blocks, blocks_of

SITE = "tests/unit/playbooks/test_site_robots.py"
REHEARSAL = "tests/update/test_5_rehearsal.py::test_rehearsal_and_reality_agree"
COLLECT = "tests/unit/playbooks/test_collect.py::test_results_come_once_and_links_stay_there"
UPDATE = "tests/update/test_1_fleet.py"
# A command, its options and what stands for a name as a regular expression -> the test that runs it.
RUN = {
    r"PLAY validate": "tests/unit/playbooks/test_new.py::test_it_is_valid_at_once_under_the_name_of_its_directory",
    r"PLAY site": f"{UPDATE}::test_what_site_brought_is_unchanged",
    r"PLAY site LIMIT": f"{SITE}::test_who_runs_nothing_comes_first_and_who_works_in_waves",
    r"PLAY site (--limit edge1|-e k3s_enrol=robot1,robot2)": "tests/update/test_9_edge_anew.py"
    "::test_an_edge_that_was_made_anew_has_its_robots_back_by_name",
    r"PLAY site --check --diff": f"{SITE}::test_check_mode_shows_what_a_robot_would_get_and_what_its_gate_says",
    r"PLAY site --tags apps,ready": "tests/update/test_5_doors.py::test_second_run_is_told_who_is_there",
    r"PLAY site --tags k3s( --check)?": "tests/update/test_4_k3s.py"
    "::test_check_mode_and_a_second_run_start_no_k3s_anew",
    r"PLAY site --tags observability": "tests/observability/test_8_shipper.py::test_off_and_on_again",
    r"PLAY status( LIMIT)?": "tests/update/test_8_awx.py::test_the_account_for_awx_is_enough",
    r"PLAY update": f"{UPDATE}::test_twelve_apps_on_two_robots_in_one_run",
    r"PLAY update --check --diff": f"{UPDATE}::test_check_mode_says_what_would_change_and_changes_nothing",
    r"PLAY update -e '\{\"update_waves\": [^']*\}' -e update_failure_budget=0": "tests/update/test_2_bad_versions.py"
    "::test_version_that_crashes_later",
    r"PLAY update -e '\{\"update_remove_apps\": \[\"\w+\"\]\}'( --check)?": "tests/update/test_9_taken_out.py"
    "::test_an_app_that_was_taken_out_goes_when_that_is_asked_for",
    r"PLAY (update|rollback) LIMIT( -e '\{\"update_apps\": \[\"\w+\"\]\}')?": f"{UPDATE}"
    "::test_rollback_to_the_previous_and_to_a_named_revision",
    r"PLAY revoke -e robot=robot\d( --check)?": "tests/unit/playbooks/test_revoke.py"
    "::test_a_robot_is_named_and_not_asked",
    r"PLAY rotate( --check| -e rotate=token)?": "tests/update/test_9_rotated.py"
    "::test_certificates_are_made_anew_under_robots_at_work",
    r"PLAY guarded -e guarded_tasks=\$PWD/tasks/reboot\.yml( LIMIT)?": "tests/unit/playbooks/test_guarded_tasks.py"
    "::test_they_run_once_and_change_nothing_the_second_time",
    r"openssl (req|x509) .*": "tests/observability/test_tls.py"
    "::test_prometheus_takes_samples_of_those_with_a_certificate_alone",
    r"PLAY record LIMIT": REHEARSAL,
    r"PLAY awx_access -e awx_access_dir=~/\.awx-access": "tests/update/test_8_awx.py"
    "::test_the_account_for_awx_is_enough",
    r"PLAY collect -e (collect_dest=results|collect_robots=robot1|'\{.*\}')( --check)?": COLLECT,
    r"ansible-playbook rosops\.fleet\.awx_setup -e @my-awx\.yml": "tests/unit/playbooks/test_awx_setup.py"
    "::test_an_awx_has_it_all_and_a_second_run_changes_nothing",
    r"rosops-may robot1( --app arm| --(hold 600|release) --owner apt)?": "tests/unit/test_other_updaters.py"
    "::test_commands",
    r"ansible-playbook -i my-lab rosops\.fleet\.update_test --limit lab1,edge1 .*": REHEARSAL,
}
WORDS = {"PLAY ": r"ansible-playbook rosops\.fleet\.", "LIMIT": r"--limit robot\d"}
PATTERNS = [re.compile(re.sub("|".join(WORDS), lambda word: WORDS[word[0]], pattern)) for pattern in RUN]
SHELL = [block for block in blocks() if block.is_shell]


def not_run(block: Block) -> list[str]:
    """Its commands that nothing runs."""
    return [one for one in block.commands if not any(pattern.fullmatch(one) for pattern in PATTERNS)]


@pytest.mark.parametrize("block", SHELL, ids=lambda block: block.where)
def test_commands_are_run_or_marked(block: Block) -> None:
    marked, left = block.mark.startswith("not run: "), not_run(block)
    assert marked or left == [], "add a test that runs it (RUN), or a mark above the block that says why none does"
    assert left or not marked, "a test runs all of it: take the mark away"


@pytest.mark.parametrize(("pattern", "by"), RUN.items())
def test_what_runs_them_is_there(pattern: str, by: str) -> None:
    path, _, name = by.partition("::")
    text = (CHECKOUT / path).read_text("utf-8")
    assert f"def {name}(" in text
    playbooks = re.findall(r"\w+", pattern.partition("PLAY ")[2].split(" ")[0])
    assert [one for one in playbooks if not re.search(rf"\b{one}\b", text)] == []


# A program -> how every page writes it; `my-lab` is the rehearsal's second inventory, secrets.yml the user's own.
ONE_WAY = {
    "ansible-playbook": re.compile(r"ansible-playbook ((-i my-lab )?rosops\.fleet\.\w+|secrets\.yml)"),
    "kubectl": re.compile(r"(sudo )?k3s kubectl "),
}
OF_REPOSITORY = sorted(path for path in (CHECKOUT / "playbooks" / "files" / "repository").rglob("*") if path.is_file())


def misspelt(texts: Iterable[str]) -> list[str]:
    """Commands that are written in another way than on all other pages."""
    commands = [one for one in texts if (re.match(r"ansible-playbook -?\w|(sudo )?(k3s )?kubectl -n ", one))]
    return [one for one in commands if not any(way.match(one) for name, way in ONE_WAY.items() if name in one)]


def test_commands_are_spelled_in_one_way() -> None:
    said = [one for block in SHELL for one in block.commands]
    for path in [*PAGES, *OF_REPOSITORY]:
        text = path.read_text("utf-8")
        said += re.findall(r"`([^`\n]+)`", text) + re.findall(r"(?:#|-|run:) +(ansible-playbook .+)", text)
    assert misspelt(said) == []


def test_another_spelling_is_found() -> None:
    words = ["ansible-playbook site.yml", "ansible-playbook -i inventory rosops.fleet.site", "kubectl -n a get pods"]
    assert misspelt(words) == words


def test_no_pattern_is_left_over() -> None:
    said = [one for block in SHELL for one in block.commands]
    assert [pattern.pattern for pattern in PATTERNS if not any(pattern.fullmatch(one) for one in said)] == []


def test_a_new_command_is_found_wherever_it_stands() -> None:
    page = """
    ansible-playbook rosops.fleet.site    # known

* an item

      frobnicate --all \\
        -v

```bash
curl http://192.0.2.1
```

<!-- not run: needs a moon -->

    launch

<!-- not commands -->

    a b
"""
    found = [block for block in blocks_of("page", page) if block.is_shell]
    assert [not_run(block) for block in found] == [[], ["frobnicate --all -v"], ["curl http://192.0.2.1"], ["launch"]]
    assert [block.mark for block in found] == ["", "", "", "not run: needs a moon"]
