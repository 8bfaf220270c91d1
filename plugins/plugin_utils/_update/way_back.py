# Copyright: (c) 2026, rosops.fleet contributors
# GNU General Public License v3.0+ (see LICENSE or https://www.gnu.org/licenses/gpl-3.0.txt)
# SPDX-License-Identifier: GPL-3.0-or-later
"""The way back of a step: to the version before it, under the proof that it is what it was."""

from __future__ import annotations

from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import NotReadyError, RosError
from ansible_collections.rosops.fleet.plugins.module_utils._common.poll import FAIL, WAIT
from ansible_collections.rosops.fleet.plugins.module_utils._step.record import mark_of
from ansible_collections.rosops.fleet.plugins.module_utils._step.update_record import run_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update import step as decide
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.beside import took_over
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.manifests import marked
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.rest import BusyError
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.revisions import identity, key_of
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.turn import Now, Turn
from ansible_collections.rosops.fleet.plugins.plugin_utils._update.world import Calm, Graph, Object

UNKNOWN = "nobody can tell whether its new version is at work"


def hold_new(turn: Turn, now: Now) -> None:
    """A version that goes may be at work, however bad it is. One that is dead is not, nor one that nobody finds."""
    if turn.policy(now.step) == "force" or now.step.kind == "master":
        return
    pods = turn.read().pods
    if decide.is_dead(now.step, pods) or (now.beside and not took_over(now.step, pods)):
        return
    now.beside = False  # it works
    actions = decide.new_actions(now.step, _graph(turn, now), pods)
    if actions:
        seen = turn.rest(now, Calm(actions), "its new version is idle, to take it back")
        if seen.verdict == WAIT and not decide.is_dead(now.step, turn.read().pods):  # one that crashes tells nothing
            raise BusyError(f"the new version is at work, so it was not taken back: {seen.reason}")
        if seen.verdict == FAIL:
            raise NotReadyError(f"{UNKNOWN}: {seen.reason}")


def _graph(turn: Turn, now: Now) -> Graph:
    """As it is now; a master that is silent for a moment is waited for."""
    try:
        return turn.host.graph(turn.master)
    except RosError as error:
        turn.say(f"{now.step.name}: {error}")
    try:
        turn.master_answers("the master answers, to ask whether the new version is at work")
        return turn.host.graph(turn.master)
    except (RosError, NotReadyError) as error:
        raise NotReadyError(f"{UNKNOWN}: {error}") from error


def _made(turn: Turn, now: Now) -> list[Object]:
    """The Deployments that this very step has made: they were not there before it, and are there with its mark."""
    if not now.step.created:
        return []
    there, run = {key_of(item): item for item in turn.read().deployments}, run_of(now.started)
    made = [there[key_of(item)] for item in now.step.created if key_of(item) in there]
    return [
        {**identity(item), "metadata": {**identity(item)["metadata"], "uid": item["metadata"].get("uid")}}
        for item in made
        if (mark := mark_of(item)) is not None and mark.run == run
    ]


def go(turn: Turn, now: Now) -> None:
    """The old version again, and its part of the graph."""
    step, settings = now.step, turn.settings
    follows = now.gate.succession.nodes if now.gate else step.renames
    old = sorted({*step.old_nodes.values(), *follows} - {""})
    turn.say(f"{step.name}: taken back")
    if turn.recorded and old:
        # first, so that a service never points to nothing: the old server lives, and the new one's end cannot take
        # away what is not its own any more
        try:
            turn.host.register(turn.master, now.graph, old)
        except RosError as error:  # without the old version there is nothing to register
            turn.say(f"{step.name}: its old nodes are not registered again yet: {error}")
    # marked, too: until it is proven again the contract of this step's beginning counts, whoever goes on from here; and
    # never without the contract, which a refused apply may have left unwritten
    turn.apply_all([*now.maps, *marked(step.previous.values(), run_of(now.started))])
    turn.cluster.delete(_made(turn, now))
    turn.cluster.wait(list(step.previous.values()), settings.ready_timeout)
    dead = sorted({*step.new_nodes.values(), *follows.values()} - {"", *old})
    if dead:
        turn.host.reap(turn.master, dead)
    if now.gate:
        proof = decide.proof_of_old(step, now.gate, settings.rate_tolerance)
        turn.ready(proof, settings.ready_timeout, f"{step.name} is as it was")
    turn.apply_all(list(step.previous.values()))
