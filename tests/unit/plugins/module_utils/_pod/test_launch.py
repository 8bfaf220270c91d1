# SPDX-License-Identifier: GPL-3.0-or-later
"""What a launch file's nodes are called beside those of another version, and when those that are held back begin."""

from __future__ import annotations

import ast
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._pod import launch
from ansible_collections.rosops.fleet.plugins.module_utils._ros.names import resolve
from ansible_collections.rosops.fleet.tests.unit.plugins.pod_graph import Clock

REVISION, OLD = "1a2b3c4d", "99999999"
NAMES = launch.Names(["/camera", "/camera/driver", "/front/lidar"], REVISION)


def resolved(name: str, node: str) -> str:
    """As rosgraph's resolve_name does."""
    return resolve(name, node.rpartition("/")[0], node)


def node(package: str = "base", args: str = "", remaps: Any = ()) -> Any:
    return SimpleNamespace(package=package, args=args, remap_args=list(remaps))


@pytest.mark.parametrize(
    ("name", "moved"),
    [
        ("/camera", "/camera_1a2b3c4d"),
        ("/camera/rate", "/camera_1a2b3c4d/rate"),
        ("/camera/driver/port", "/camera/driver_1a2b3c4d/port"),  # of the nearest node
        ("/front/lidar", "/front/lidar_1a2b3c4d"),
        ("/front/rate", "/front/rate"),
        ("/cameras", "/cameras"),
    ],
)
def test_a_node_and_its_private_parameters_move(name: str, moved: str) -> None:
    assert NAMES.moved(name) == moved
    assert launch.Names(NAMES.nodes, "").moved(name) == name


def test_the_version_before_is_known_by_its_names() -> None:
    again = "/camera_1a2b3c4d_4"  # another pod of the revision
    there = ["/camera_99999999", "/camera_1a2b3c4d", again, "/front/lidar", "/other_99999999", "/rosout"]
    assert NAMES.before(there) == {"/camera_99999999", again, "/front/lidar"}


def test_private_names_are_learnt_from_the_graph() -> None:
    """In the names that they have without a revision; what goes with each version is none of them."""
    there = ["/camera/image", "/camera/get_loggers", "/camera/driver/state", "/camera/load_nodelet", "/map", "/camera"]
    assert NAMES.private(there, "/camera", launch.LOGGERS) == ["image", "load_nodelet"]
    assert NAMES.private(there, "/camera", launch.MANAGER) == ["image"]
    assert NAMES.private(there, "/camera/driver", launch.LOGGERS) == ["state"]


def test_names_of_this_version_alone_are_found() -> None:
    there = [f"/camera_{REVISION}/image", f"/camera_{REVISION}/get_loggers", f"/front/lidar_{OLD}/scan", "/camera/info"]
    assert NAMES.misplaced(there) == {"/camera": {"image", "get_loggers"}}


def test_private_topics_stay_where_others_expect_them() -> None:
    given = [("scan", "/front/scan"), ("camera/raw", "/raw"), ("info", "~info"), ("points", "points_out")]
    found = launch.remaps_of(node(remaps=given), "/camera", ["image", "raw"], resolved)
    assert dict(found) == {
        "scan": "/front/scan",
        "camera/raw": "/raw",  # a private name, said as a relative one:
        "~raw": "/raw",  # it is private under the new name, too
        "info": "/camera/info",
        "points": "points_out",
        "~image": "/camera/image",
    }


def test_a_nodelet_finds_the_manager_of_its_own_version() -> None:
    names = launch.Names(["/manager", "/relay"], REVISION)
    load = node("nodelet", "load nine/Relay manager --no-bond")
    assert launch.arguments_of(load, "/relay", names, resolved) == f"load nine/Relay /manager_{REVISION} --no-bond"
    for args in ("manager", "standalone nine/Relay", ""):
        assert launch.arguments_of(node("nodelet", args), "/relay", names, resolved) == args
    assert launch.arguments_of(node("base", "load a b"), "/relay", names, resolved) == "load a b"
    with pytest.raises(ValueError, match="loaded into /other, which the launch file does not start"):
        launch.arguments_of(node("nodelet", "load nine/Relay other"), "/relay", names, resolved)


@pytest.mark.parametrize(
    ("package", "args", "kept"),
    [("nodelet", "manager", True), ("nodelet", "load a b", False), ("base", "manager", False)],
)
def test_a_manager_keeps_its_services_to_its_own_version(package: str, args: str, kept: bool) -> None:
    assert ("load_nodelet" in launch.kept_for_itself(node(package, args))) == kept


def test_what_the_version_before_reads_must_not_change_under_it() -> None:
    there = {"limits": {"speed": 0.5, "turn": 1}, "rosdistro": "noetic", "camera": {"rate": 5}}
    wanted = {
        "/limits/speed": 0.8, "/limits/turn": 1, "/limits/new": 2, "/rosdistro": "melodic", "/camera/rate": 9,
        "/limits": {"speed": 0.5},
    }  # fmt: skip
    assert launch.conflicts(wanted, there, NAMES) == ["/limits", "/limits/speed"]


def test_options_stand_before_the_launch_files_own() -> None:
    words = ["--overlap", "--replace=lidar", "--replace=/front/arm", "--package=base", "a.launch", "b.launch", "x:=1"]
    environ = {"ROSOPS_REVISION": REVISION, "ROSOPS_TEMPLATE_HASH": "79d9c6f8b5"}
    found = launch.Options(words, environ)
    assert (found.files, found.held) == ([["base", "a.launch"], ["base", "b.launch"]], ["lidar", "/front/arm"])
    assert found.version == f"{REVISION}_79d9c6f8b5"
    found = launch.Options(["/srv/a.launch"], environ)
    assert (found.files, found.held, found.version) == ([["/srv/a.launch"]], [], "")


def test_a_node_may_be_named_without_its_namespace() -> None:
    for word in ("lidar", "front/lidar", "/front/lidar"):
        assert launch.named(word, NAMES.nodes) == ["/front/lidar"]
    assert launch.named("/lidar", NAMES.nodes) == launch.named("dar", NAMES.nodes) == []


def test_a_held_node_begins_when_nobody_listens_any_more_where_the_old_one_was() -> None:
    places, listening = {"/front/lidar_99999999": ("10.0.0.1", 1), "/front/lidar": ("10.0.0.2", 2)}, {("10.0.0.1", 1)}
    waiting = launch.Waiting(places.__getitem__, listening.__contains__)
    assert not waiting.over("/front/lidar", ["/front/lidar_99999999", "/camera_99999999"])
    assert not waiting.over("/front/lidar", [])  # it has left the graph, and its process has not ended
    listening.clear()
    listening.add(("10.0.0.2", 2))
    assert not waiting.over("/front/lidar", ["/front/lidar"])  # another one came, under the plain name
    listening.clear()
    assert waiting.over("/front/lidar", ["/front/lidar"])  # killed: its registration tells nothing
    assert launch.Waiting(places.__getitem__, listening.__contains__).over("/front/lidar", [])


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(launch, "clock", made.now)
    monkeypatch.setattr(launch.time, "sleep", made.sleep)
    return made


class Graph:
    """A master, and a launch whose nodes register what they have by and by: second -> topics."""

    def __init__(self, clock: Clock, topics: dict[float, set[str]], before: dict[float, set[str]]) -> None:
        self.clock, self.topics, self.nodes = clock, topics, before
        self.away = (OSError,)
        self.names, self.runner, self.held, self.log = NAMES, self, ["/front/lidar"], list[tuple[float, str]]()
        self.known: set[str] = set()
        self.others = NAMES.before(self.at(before))

    def at(self, table: dict[float, set[str]]) -> set[str]:
        return next(found for second, found in sorted(table.items(), reverse=True) if second <= self.clock.at)

    def registered(self) -> tuple[set[str], set[str]]:
        if self.clock.at == 3.0:
            raise OSError("for a moment")
        return self.at(self.topics), self.at(self.nodes)

    def spin_once(self) -> bool:
        return True

    def learn(self, topics: set[str]) -> None:
        found = {name for names in NAMES.misplaced(topics).values() for name in names} - self.known
        self.known |= found
        self.log += [(self.clock.at, f"learn {name}") for name in sorted(found)]

    def begin(self, full: str) -> None:
        self.log.append((self.clock.at, f"begin {full}"))


HERE = f"/camera_{REVISION}/"
SLOW = {0.0: set(), 1.0: {HERE + "a"}, 2.0: {HERE + "a", HERE + "b"}, 20.0: {HERE + "a", HERE + "b", HERE + "c"}}


def test_private_names_are_learnt_beside_the_version_before_and_held_nodes_begin_after_it(clock: Clock) -> None:
    """Who does the work alone is not started once more, whatever it still has to say."""
    graph = Graph(clock, SLOW, {0.0: {"/front/lidar_99999999"}, 7.0: set()})
    waiting = launch.Waiting(lambda _node: ("10.0.0.1", 1), lambda _place: clock.at < 8.0)
    launch.attend(graph, graph, waiting)
    assert graph.log == [(1.5, "learn a"), (2.5, "learn b"), (8.0, "begin /front/lidar")]
    assert clock.at == 8.0


def test_at_the_very_first_start_a_node_has_a_minute_to_say_its_names(clock: Clock) -> None:
    """One may load a model before it does."""
    graph = Graph(clock, SLOW, {0.0: set()})
    launch.attend(graph, graph, launch.Waiting(lambda _node: ("", 0)))
    assert graph.log == [
        (0.5, "begin /front/lidar"), (1.5, "learn a"), (2.5, "learn b"), (20.5, "learn c"),
    ]  # fmt: skip
    assert clock.at == pytest.approx(launch.LONGEST)


def test_python_2_understands_it() -> None:
    """No interpreter of it is needed: what it does not know are annotations, f-strings, keyword-only and the like."""
    tree = ast.parse(Path(launch.__file__).read_text("utf-8"), feature_version=(3, 4))
    new = (ast.JoinedStr, ast.AnnAssign, ast.NamedExpr, ast.Nonlocal, ast.YieldFrom, ast.Starred, ast.AsyncFunctionDef)
    assert not [found for found in ast.walk(tree) if isinstance(found, new)]
    functions = [found for found in ast.walk(tree) if isinstance(found, ast.FunctionDef)]
    assert not [one.name for one in functions if one.returns or one.args.kwonlyargs or one.args.posonlyargs]
    assert not [one for one in ast.walk(tree) if isinstance(one, ast.Raise) and one.cause]
    bases = [one for one in ast.walk(tree) if isinstance(one, ast.ClassDef)]
    assert all(one.bases and not one.keywords for one in bases)
