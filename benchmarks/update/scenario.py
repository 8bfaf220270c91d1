# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs in a round and what is changed in it, the same for both arms. Pure.

Placement is the demo's: sensors and servers on the robot, those who listen and ask on the edge.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

REPOSITORY = "lab/apps"
ENTRY = "/ros_entrypoint.sh"  # of the image: ROS is found by what goes through it
PROGRAMS = "/opt/rosops-apps/bin"
PROBE = f"{PROGRAMS}/readiness_probe.sh"
FIRST, MINOR, MAJOR = "1.0", "1.1", "2.0"
RATE = 500.0  # messages a second, as the dissertation's
SLOW = 10.0
REQUESTS = 20.0  # requests a second: enough of them in an update's few seconds for a 95th percentile
TEMPERATURE = "rosops_apps/Temperature"

# What all of an arm's pods ask of the scheduler. Without it they have the least weight that there is (BestEffort), and
# under stress the kernel gives nearly everything to whatever else runs on the host: both arms would lose to that alone.
# So little that all of them and the new pods of twelve apps are within the one core that a host may have.
REQUESTED = {"cpu": "25m", "memory": "64Mi"}


@dataclass(frozen=True)
class App:
    """One program in one Deployment."""

    name: str
    program: str
    placement: str
    pattern: str | None
    remaps: tuple[str, ...] = ()
    env: Mapping[str, str] = field(default_factory=dict)
    tag: str = FIRST
    topic: str | None = None  # published or subscribed
    publishes: bool = False
    service: str | None = None
    action: str | None = None
    group: str | None = None

    @property
    def image(self) -> str:
        """The image's name."""
        return f"{REPOSITORY}:{self.tag}"

    @property
    def volume(self) -> str:
        """The volume with its log: one per place, for a claim can be mounted on one node."""
        return "robot-logs" if self.placement == "local" else "edge-logs"

    @property
    def log_dir(self) -> str:
        """Where it writes its log."""
        return f"/mnt/data/{self.volume}/{self.name}"

    @property
    def node(self) -> str:
        """Its ROS node's name, without a revision."""
        return self.name.replace("-", "_")


@dataclass(frozen=True)
class Change:
    """What an update changes of one app."""

    tag: str | None = None
    env: Mapping[str, str] = field(default_factory=dict)

    def of(self, app: App) -> App:
        """The app after it."""
        return replace(app, tag=self.tag or app.tag, env={**app.env, **self.env})


@dataclass(frozen=True)
class Case:
    """One update that is measured: `app` and `update` are its name in the records."""

    app: str
    update: str
    source: App  # publisher or server
    sink: App  # subscriber or client
    changes: Mapping[str, Change]
    others: tuple[App, ...] = ()  # changed in the same step; only its time is their measure

    @property
    def name(self) -> str:
        """Its name on the command line and in tables."""
        return f"{self.app}/{self.update}"

    @property
    def apps(self) -> tuple[App, ...]:
        """Its apps; the one that the other needs comes first."""
        return (self.source, self.sink, *self.others)

    def changed(self) -> list[App]:
        """The apps that the update changes, as they are after it."""
        return [self.changes[app.name].of(app) for app in self.apps if app.name in self.changes]


def pair(  # noqa: PLR0913 - one pair in one line
    key: str, app: str, update: str, new: Mapping[str, str], suffix: str = "", env: Mapping[str, str] | None = None
) -> Case:
    """A sensor and its statistics on a topic of their own; `new` gives tags for `pub` and `sub`."""
    topic = f"temperature_{key}"
    group = key if len(new) > 1 else None
    common = {"pattern": "pubsub", "remaps": (f"temperature:=temperature_{key}",), "topic": topic, "group": group}
    extra = dict(env or {})
    publisher = App(
        f"{key}-pub",
        f"temperature_publisher{suffix}",
        "local",
        env={"RATE_HZ": f"{RATE:g}", **extra},
        publishes=True,
        **common,  # type: ignore[arg-type]
    )
    subscriber = App(f"{key}-sub", f"temperature_subscriber{suffix}", "remote", env=extra, **common)  # type: ignore[arg-type]
    names = {"pub": publisher.name, "sub": subscriber.name}
    return Case(app, update, publisher, subscriber, {names[end]: Change(tag=tag) for end, tag in new.items()})


def service(key: str, app: str, env: Mapping[str, str] | None = None) -> Case:
    """An adder that becomes a subtracter, and who asks it."""
    name = f"add_two_ints_{key}"
    remaps = (f"add_two_ints:={name}",)
    server = App(
        f"{key}-server",
        "add_two_ints_server",
        "local",
        "service",
        remaps,
        {"OPERATION": "add"},
        service=name,
    )
    client = App(
        f"{key}-client", "add_two_ints_client", "remote", None, remaps, {"RATE_HZ": f"{REQUESTS:g}", **(env or {})}
    )
    return Case(app, "server", server, client, {server.name: Change(env={"OPERATION": "subtract"})})


def action(key: str) -> Case:
    """Prime factors of batches of ten numbers, each some 35 factors: about the dissertation's 220 ms of work."""
    server = App(
        f"{key}-server",
        "prime_factors_server",
        "local",
        "action",
        env={"FACTOR_PAUSE": "0.006"},
        action="prime_factors",
    )
    # a goal that is held for longer than the whole update is not one that came through it
    env = {"BATCH_PAUSE": "0.3", "GOAL_TIMEOUT": "60"}
    client = App(f"{key}-client", "prime_factors_client", "remote", None, env=env)
    return Case("action", "server", server, client, {server.name: Change(tag=MINOR)})


def twelve() -> Case:
    """Six pairs in one step. One of them is measured; the others are slow, as their messages are not what counts."""
    pairs = [pair(f"many{number}", "", "", BOTH, env={"RATE_HZ": f"{SLOW:g}"}) for number in range(5)]
    first = pair("many", "pubsub-twelve", "simultaneous", BOTH)
    others = tuple(replace(app, group="many") for one in pairs for app in one.apps)
    return replace(first, others=others, changes={**first.changes, **{app.name: Change(tag=MINOR) for app in others}})


PLAIN, FLEET = "plain", "fleet"
NO_HOLD = "fleet-no-hold"  # the fleet arm whose keeper holds no goals
RELEASE = "release-before"  # the fleet arm with the playbooks of another checkout, on a lab of its own
ARMS = (PLAIN, FLEET, NO_HOLD)
BOTH = {"pub": MINOR, "sub": MINOR}
# In the order in which they are updated. The action last: what follows an update of it is part of its measure.
CASES = (
    pair("minor", "pubsub", "minor", {"sub": MINOR}),
    pair("major", "pubsub", "major", {"sub": MAJOR}),
    pair("both", "pubsub", "simultaneous", BOTH),
    service("plain", "service"),
    service("kept", "service-persistent", {"PERSISTENT": "true"}),
    pair("cpp", "pubsub-roscpp", "simultaneous", BOTH, suffix="_cpp"),
    pair("cppten", "pubsub-roscpp-queue10", "simultaneous", BOTH, suffix="_cpp", env={"QUEUE_SIZE": "10"}),
    twelve(),
    action("factor"),
)
# The dissertation's, and what makes two of them harder: the publisher's own queue of 10, twelve apps at once.
PUBLISHED = (
    "pubsub/minor",
    "pubsub/major",
    "pubsub/simultaneous",
    "service/server",
    "pubsub-roscpp-queue10/simultaneous",
    "pubsub-twelve/simultaneous",
    "action/server",
)


def of_arm(arm: str, case: str) -> bool:
    """Whether an arm has a say in it: of whether goals are held, in the actions."""
    return arm != NO_HOLD or case.startswith("action/")


def chosen(names: Iterable[str], cases: Iterable[Case] = CASES) -> list[Case]:
    """The cases of these names (`pubsub/minor`) or apps (`pubsub`); all without a name."""
    wanted, every = list(names), list(cases)
    known = {case.name for case in every} | {case.app for case in every}
    if unknown := [name for name in wanted if name not in known]:
        raise ValueError(f"no case {', '.join(unknown)}; there are {', '.join(case.name for case in every)}")
    return [case for case in every if not wanted or {case.name, case.app} & set(wanted)]


def images(cases: Iterable[Case]) -> list[str]:
    """The tags that the cases need, in order."""
    apps = [app for case in cases for app in (*case.apps, *case.changed())]
    return sorted({app.tag for app in apps})
