# SPDX-License-Identifier: GPL-3.0-or-later
"""A robot whose actions have to be idle and whose messages have to say so: the world of `idle_hold` on the network."""

from __future__ import annotations

import contextlib
from functools import partial
from typing import Callable, Iterable, Mapping

from .._common.errors import RosError
from .._common.poll import Seen
from .checks import Check
from .client import Ros1Client
from .conditions import Conditions
from .gate import look
from .idle_hold import Held
from .keeper_client import TIMEOUT, KeeperCalls
from .listener import Listener
from .names import is_meant
from .rpc import in_parallel, tell_publishers


class IdleRobot:
    """Goals are held for so many `seconds` at most, from the moment at which they are."""

    def __init__(
        self, ros: Ros1Client, keeper: KeeperCalls, conditions: Conditions, seconds: Callable[[], float]
    ) -> None:
        self.ros, self.keeper, self.conditions, self.seconds = ros, keeper, conditions, seconds
        self.listener = Listener(ros, conditions.values) if conditions.values else None

    def look(self) -> Seen:
        seen = look(self.ros, self.conditions, ears=self.listener.checks if self.listener else None)
        return Seen(seen.verdict, seen)

    def hold(self, servers: Mapping[str, str]) -> Mapping[str, str]:
        try:
            now = self._now(servers)
        except (OSError, RosError) as error:
            return dict.fromkeys(servers, str(error))
        return at_once({name: partial(self.keeper.hold, name, one, self.seconds()) for name, one in now.items()})

    def _now(self, servers: Mapping[str, str]) -> dict[str, str]:
        """What each action's server is called in its pod."""
        there = self.ros.state()
        return {
            action: next((one for one in there.servers(action) if is_meant(one, [server])), server)
            for action, server in servers.items()
        }

    def release(self, actions: Iterable[str]) -> Mapping[str, str]:
        return at_once({name: partial(self.keeper.release, name) for name in actions})

    def isolate(self, servers: Mapping[str, str]) -> None:
        """roscpp's servers hang up; rospy's have lost their clients to the keeper already."""
        unheard = contextlib.suppress(OSError, RosError)  # whatever comes through after all shows in the next look
        with unheard:
            now = self._now(servers)
            uris = self.ros.addresses(dict.fromkeys(now.values()))[0]
            for action, server in now.items():
                with unheard:
                    if server in uris:
                        tell_publishers(uris[server], f"{action}/goal", [], self.ros.timeout)

    def close(self) -> None:
        """Listen no more."""
        if self.listener:
            self.listener.close()


def at_once(calls: Mapping[str, Callable[[], str]]) -> Mapping[str, str]:
    """Calls of the keeper, by action: who hangs is waited for a single time."""
    return in_parallel(calls, TIMEOUT + 1, lambda _action, error: str(error))


def reason_of(ended: Held) -> str:
    """Every unmet check of the last look, and what is not held."""
    return "; ".join([*map(_told, ended.last.unmet), *ended.problems])


def _told(check: Check) -> str:
    """An action's reason names its server; what is wrong with a value does not say of which."""
    return str(check) if check.kind == "value" else check.reason
