# SPDX-License-Identifier: GPL-3.0-or-later
"""A launch file as an app: `launch.py [--overlap] [--replace=NODE] [--package=NAME] FILE... [ARG:=VALUE]...`.

It runs on the interpreter of the image's own roslaunch, which may be Python 2.7 (ROS up to Melodic): so it is written
for both, stands alone, and has its types in comments. In what it adds to roslaunch:

* A node that could not be started ends it, as does one that is `required`, with that one's exit code, or 1.
* A node that is deaf to SIGINT is ended after seconds, not after a quarter of a minute.
* `--overlap`: the version before is still at work. Every node's name gets this pod's version behind it
  (`ROSOPS_REVISION` and `ROSOPS_TEMPLATE_HASH`), and so do its private parameters; others read them where they know
  them (`/camera/fx`), as the version has set them that was started last. Private topics and services stay under the
  name that others know: `~image` of the node `camera_1a2b3c4d_79d9c6f8b5` is `/camera/image`. Which ones a node has the
  graph says: that of the version before, or the first seconds of this one, after which such a node is started once
  more.
* `--replace`: nodes of which there must not be two. They begin when those of the version before have ended.

Sources: roslaunch 1.12 to 1.15 (`parent.py`, `pmon.py`, `launch.py`), wiki.ros.org/Names, wiki.ros.org/nodelet.
"""

import os
import re
import shlex
import socket
import sys
import time

try:
    from shlex import quote
except ImportError:  # Python 2
    from pipes import quote

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any, Callable, Dict, Iterable, List, Mapping, Sequence, Set, Tuple

# Every node has these, and nobody expects them where another node's are.
LOGGERS = frozenset(("get_loggers", "set_logger_level"))
# Of a nodelet manager, which the nodelets of its own version load themselves into.
MANAGER = LOGGERS | frozenset(("load_nodelet", "unload_nodelet", "list", "bond"))
# What roslaunch itself sets for the whole graph.
GRAPH_PARAMS = frozenset(("/rosdistro", "/rosversion", "/run_id", "/rosout"))
SUFFIX = re.compile(r"_[0-9a-f]{8}(?:_[bcdfghjklmnpqrstvwxz2456789]{1,10})?(?=/|\Z)")  # `_ros/names.py` explains it

INTERRUPT, TERMINATE = 5.0, 2.0  # s that a node has to end after SIGINT, and then after SIGTERM
LOOK = 0.5  # s between two looks at the graph, while there is something to look for
LONGEST = 60.0  # s for nodes to say their private names
ERROR = "ERROR:"  # what roslaunch's errors begin with
ATTEMPT = 0.5  # s for a connection, which takes milliseconds


def stable(name):  # type: (str) -> str
    """A graph name without versions: `/camera_1a2b3c4d_79d9c6f8b5/image` is `/camera/image`."""
    return SUFFIX.sub("", name)


def owner_of(name, nodes):  # type: (str, Iterable[str]) -> str
    """The node in whose private namespace a name stands; empty: in nobody's."""
    return max([node for node in nodes if name.startswith(node + "/")] or [""], key=len)


def named(name, nodes):  # type: (str, Iterable[str]) -> List[str]
    """The nodes that somebody means by a name, which may leave out their namespace."""
    if name.startswith("/"):
        return [node for node in nodes if node == name]
    return [node for node in nodes if node.endswith("/" + name)]


class Names(object):
    """The nodes of a launch file, by the names that they have in it, and what they are called in this version."""

    def __init__(self, nodes, version):  # type: (Iterable[str], str) -> None
        self.nodes, self.suffix = sorted(nodes), "_" + version if version else ""

    def moved(self, name):  # type: (str) -> str
        """The name of a node, or of a parameter that is private to one, in this version."""
        top = name if name in self.nodes else owner_of(name, self.nodes)
        return top + self.suffix + name[len(top) :] if top else name

    def before(self, registered):  # type: (Iterable[str]) -> Set[str]
        """Nodes of other versions of this launch file."""
        own = [node + self.suffix for node in self.nodes if self.suffix]
        return set(node for node in registered if stable(node) in self.nodes and node not in own)

    def private(self, names, node, skip):  # type: (Iterable[str], str, Iterable[str]) -> List[str]
        """What of these topics and services, in stable names, is private to the node: without the node's name."""
        found = [name[len(node) + 1 :] for name in names if owner_of(name, self.nodes) == node]
        return sorted(name for name in set(found) if name and name not in skip)

    def misplaced(self, names):  # type: (Iterable[str]) -> Dict[str, Set[str]]
        """Node -> its private names that stand below this version's name, where nobody else looks for them."""
        found = {}  # type: Dict[str, Set[str]]
        for name in names:
            plain = stable(name)
            node = owner_of(plain, self.nodes)
            if node and name.startswith(node + self.suffix + "/"):
                found.setdefault(node, set()).add(plain[len(node) + 1 :])
        return found


def _words(node):  # type: (Any) -> List[str]
    return shlex.split(node.args or "")


def kept_for_itself(node):  # type: (Any) -> Iterable[str]
    """The private names of a node that go with its version."""
    return MANAGER if node.package == "nodelet" and _words(node)[:1] == ["manager"] else LOGGERS


def remaps_of(node, full, private, resolve):
    # type: (Any, str, Iterable[str], Callable[[str, str], str]) -> List[Tuple[str, str]]
    """The remappings of a node that has another name now, so that its private topics stay where they were."""
    remaps = {}
    for source, target in node.remap_args:
        # what is relative to the node's own name is meant under the name that others know
        remaps[source] = full + "/" + target[1:].lstrip("/") if target.startswith("~") else target
        name = resolve(source, full)
        if name.startswith(full + "/"):
            remaps["~" + name[len(full) + 1 :]] = remaps[source]
    for name in private:
        remaps.setdefault("~" + name, full + "/" + name)
    return sorted(remaps.items())


def arguments_of(node, full, names, resolve):  # type: (Any, str, Names, Callable[[str, str], str]) -> str
    """A nodelet's load has to find the manager of its own version. ValueError: that is not in the launch file."""
    words = _words(node)
    if node.package != "nodelet" or words[:1] != ["load"] or len(words) < 3:
        return str(node.args or "")
    manager = resolve(words[2], full)
    if manager not in names.nodes:
        raise ValueError(
            "nodelet %s is loaded into %s, which the launch file does not start: two of it cannot be there; "
            "list it in launch.replace, or take handoff: replace" % (full, manager)
        )
    words[2] = names.moved(manager)
    return " ".join(quote(word) for word in words)


def conflicts(wanted, there, names):  # type: (Mapping[str, object], Any, Names) -> List[str]
    """Parameters that the version before reads, too, and that this launch file would change under it."""
    found = []
    for name in sorted(wanted):
        if name in GRAPH_PARAMS or names.moved(name) != name:
            continue
        value = there
        for part in name.strip("/").split("/"):
            value = value.get(part) if isinstance(value, dict) else None
        if value is not None and value != wanted[name]:
            found.append(name)
    return found


class Options(object):
    """What stands before the launch file's own arguments."""

    def __init__(self, words, environ):  # type: (Sequence[str], Mapping[str, str]) -> None
        said = [word for word in words if word.startswith("--")]
        package = [word[len("--package=") :] for word in said if word.startswith("--package=")]
        files = [word for word in words if word not in said and ":=" not in word]
        self.files = [package + [name] for name in files]  # as roslaunch takes them
        self.held = [word[len("--replace=") :] for word in said if word.startswith("--replace=")]
        version = [environ.get("ROSOPS_" + word) for word in ("REVISION", "TEMPLATE_HASH")]
        self.version = "_".join(filter(None, version)) if "--overlap" in said else ""


clock = getattr(time, "monotonic", time.time)  # a robot without a battery sets its clock just when pods start


def listens(address):  # type: (Tuple[str, int]) -> bool
    try:
        socket.create_connection(address, ATTEMPT).close()
    except (OSError, socket.error):
        return False
    return True


class Waiting(object):
    """For the end of the nodes that this version replaces. One leaves the graph before its process ends, and may have
    a device until then: so it has gone when nobody listens any more where it was."""

    def __init__(self, address_of, listening=listens):
        # type: (Callable[[str], Tuple[str, int]], Callable[[Tuple[str, int]], bool]) -> None
        self.address_of, self.listening = address_of, listening
        self.places = {}  # type: Dict[str, Set[Tuple[str, int]]]

    def over(self, node, before):  # type: (str, Iterable[str]) -> bool
        """Whether all have gone that had this node's part; `before`: those that are registered now."""
        there = [self.address_of(one) for one in before if stable(one) == node]
        known = self.places.get(node, set()).union(there)
        self.places[node] = set(place for place in known if self.listening(place))
        return not self.places[node]


class Master(object):
    """The ROS master, asked through the image's own rosgraph."""

    def __init__(self, rosgraph):  # type: (Any) -> None
        self.api, self.parse = rosgraph.Master("/rosops_fleet_launch"), rosgraph.network.parse_http_host_and_port
        self.away = (rosgraph.MasterException, OSError, socket.error)

    def registered(self):  # type: () -> Tuple[Set[str], Set[str]]
        """Topics and services, and the nodes that have any."""
        state = [entry for kind in self.api.getSystemState() for entry in kind]
        return set(name for name, _nodes in state), set(node for _name, nodes in state for node in nodes)

    def address_of(self, node):  # type: (str) -> Tuple[str, int]
        host, port = self.parse(self.api.lookupNode(node))
        return str(host), int(port)

    def forget(self, names, server):  # type: (Iterable[str], str) -> None
        """Take parameters away, and where roslaunch is, in little time: this process is to end."""
        socket.setdefaulttimeout(ATTEMPT)
        host, port = self.parse(server)
        for name in list(names) + ["/roslaunch/uris/host_%s__%s" % (re.sub("[^a-z0-9]", "_", host.lower()), port)]:
            try:
                self.api.deleteParam(name)
            except self.away:  # there was none, or there is no master any more
                pass


def launch_of(roslaunch, master, options):  # type: (Any, Master, Options) -> Any
    """The class of roslaunch's own launch, with names of this version."""
    from rosgraph.names import ns_join, resolve_name
    from roslaunch.core import Param, RLException, is_machine_local

    anonymous = re.compile(r"_%d_\d+\Z" % os.getpid())  # $(anon): another one in each version as it is

    class Launch(roslaunch.parent.ROSLaunchParent):  # type: ignore[misc] # roslaunch has no types
        def _load_config(self):  # type: () -> None
            roslaunch.parent.ROSLaunchParent._load_config(self)
            self.by_name = {ns_join(node.namespace, node.name): node for node in self.config.nodes}
            elsewhere = [name for name, node in self.by_name.items() if not is_machine_local(node.machine)]
            if elsewhere:
                raise RLException("%s would be started on other machines" % ", ".join(sorted(elsewhere)))
            self.names = Names([name for name in self.by_name if not anonymous.search(name)], options.version)
            self.held = self._held()  # type: List[str]
            if options.version:
                self._take_names()
            self.config.nodes = [node for name, node in self.by_name.items() if name not in self.held]

        server_uri = ""  # as long as there was one, which forgets it at its end
        others = frozenset()  # type: Iterable[str]

        def _start_server(self):  # type: () -> None
            roslaunch.parent.ROSLaunchParent._start_server(self)
            self.server_uri = self.server.uri

        def _start_pm(self):  # type: () -> None
            """roslaunch forgets how a process ended; whoever asks this one is told (`_ros/roslaunch.py`)."""
            roslaunch.parent.ROSLaunchParent._start_pm(self)
            monitor, alive = self.pm, self.pm.get_process

            def get_process(name):  # type: (str) -> Any
                return alive(name) or next((one for one in monitor.dead_list if one.name == name), None)

            monitor.get_process = get_process

        def _held(self):  # type: () -> List[str]
            found = []  # type: List[str]
            for word in options.held if options.version else ():
                meant = named(word, self.names.nodes)
                if not meant:
                    known = ", ".join(self.names.nodes)
                    raise RLException("launch.replace names %s, which is none of its nodes: %s" % (word, known))
                found += meant
            return found

        def _take_names(self):  # type: () -> None
            topics, nodes = master.registered()
            self.known, self.others = set(map(stable, topics)), self.names.before(nodes)
            if self.others:
                wanted = {name: param.value for name, param in self.config.params.items()}
                changed = ", ".join(conflicts(wanted, master.api.getParam("/"), self.names))
                if changed:
                    raise RLException("%s would change under the version at work; take handoff: replace" % changed)
            for name, param in list(self.config.params.items()):  # others read a private one where they know it
                moved = self.names.moved(name)
                self.config.params[moved] = Param(moved, param.value)
            self.config.clear_params = []  # the version before reads them
            self.config.executables = [one for one in self.config.executables if one.args[:1] != ["delete"]]
            self.given = {name: (node.args, list(node.remap_args)) for name, node in self.by_name.items()}
            for full in self.names.nodes:
                self._rename(full)
                self.by_name[full].name += self.names.suffix

        def _rename(self, full):  # type: (str) -> None
            node = self.by_name[full]
            node.args, node.remap_args = self.given[full]
            private = self.names.private(self.known, full, kept_for_itself(node))
            node.remap_args = remaps_of(node, full, private, resolve_name)
            try:
                node.args = arguments_of(node, full, self.names, resolve_name)
            except ValueError as error:
                if full not in self.held:
                    raise RLException(str(error))

        def learn(self, topics):  # type: (Iterable[str]) -> None
            """Start those once more whose private names nobody knew."""
            for full, found in sorted(self.names.misplaced(topics).items()):
                names = found.difference(kept_for_itself(self.by_name[full]))
                added = set(full + "/" + name for name in names).difference(self.known)
                if added:
                    self.known |= added
                    self._rename(full)
                    if self._end(self.by_name[full]):
                        self.begin(full)

        def _end(self, node):  # type: (Any) -> bool
            """Whether it was there: one that has ended is left so, as roslaunch does."""
            found = [process for process in self.pm.procs if process.name == node.process_name]
            for process in found:
                process.required = process.respawn = False  # this end is nobody's but its own
                try:
                    self.pm.unregister(process)
                except ValueError:  # it ended just now
                    return False
                process.stop([])
            return bool(found)

        def begin(self, full):  # type: (str) -> None
            self.runner.launch_node(self.by_name[full])

        def absent(self):  # type: () -> List[str]
            """Nodes that could not be started; roslaunch goes on without them."""
            return sorted(node.name for node in self.config.nodes if not node.process_name)

        def why_absent(self, told):  # type: (Iterable[str]) -> str
            """The nodes, and why by roslaunch's own words: without its list of all places where it has looked."""
            first = [text.strip().splitlines()[0] for text in told if text.strip().startswith(ERROR)]
            causes = [line[len(ERROR) :].strip() for line in first]
            said = "%s could not be started" % ", ".join(self.absent())
            return "%s: %s" % (said, "; ".join(causes)) if causes else said

    return Launch


def attend(launch, master, waiting):  # type: (Any, Master, Waiting) -> None
    """Until nothing is held any more, and no private name is expected.

    No node is started once more when it does the work alone: where there was a version before, only beside it.
    """
    began, first, looking = clock(), not launch.others, True
    before = set()  # type: Set[str]
    while (launch.held or looking) and launch.runner.spin_once():
        time.sleep(LOOK)
        try:
            topics, nodes = master.registered()
            others = launch.names.before(nodes)
            looking = clock() - began < LONGEST and (first or bool(others))
            if topics != before:  # a node that registers has not said all yet
                before = topics
            elif looking:
                launch.learn(topics)
            ready = [full for full in launch.held if waiting.over(full, others)]
        except master.away:  # it is asked again
            continue
        for full in ready:
            launch.held.remove(full)
            launch.begin(full)


def main(words):  # type: (Sequence[str]) -> int
    """Does not return before the launch file's nodes have ended."""
    import rosgraph
    import roslaunch
    import roslaunch.core
    import roslaunch.nodeprocess
    import roslaunch.parent
    import roslaunch.rlutil

    class Deaths(roslaunch.pmon.ProcessListener):  # type: ignore[misc] # roslaunch has no types
        """The exit code of the node whose end ended all."""

        code = 0

        def process_died(self, process_name, exit_code):  # type: (str, int) -> None
            process = launch.pm.get_process(process_name)
            if process is not None and process.required:
                self.code = exit_code or 1

    options, deaths = Options(words, os.environ), Deaths()
    launch = None  # type: Any
    told = []  # type: List[str]
    roslaunch.core.add_printerrlog_handler(told.append)
    os.environ.setdefault("PYTHONUNBUFFERED", "1")  # of the nodes: what they say is the container's log
    os.environ.setdefault("ROSCONSOLE_STDOUT_LINE_BUFFERED", "1")
    while not rosgraph.is_master_online():
        time.sleep(LOOK)
    try:
        master = Master(rosgraph)
        identity = roslaunch.rlutil.get_or_generate_uuid(None, False)
        roslaunch.configure_logging(identity)
        files = [roslaunch.rlutil.resolve_launch_arguments(words)[0] for words in options.files]
        made = launch_of(roslaunch, master, options)
        launch = made(identity, files, process_listeners=[deaths], force_screen=True, **_patience(roslaunch))
        launch.start(auto_terminate=False)
        if launch.absent():
            launch.shutdown()
            raise roslaunch.RLException(launch.why_absent(told))
        if options.version:
            attend(launch, master, Waiting(master.address_of))
        launch.pm.registrations_complete()
        launch.spin()
    except roslaunch.RLException as error:
        sys.stderr.write("rosops.fleet: %s\n" % error)
        deaths.code = 1
    if launch is not None and launch.server_uri:
        own = [launch.names.moved(full) for full in launch.names.nodes] if options.version else []
        master.forget(own, launch.server_uri)
    return deaths.code


def _patience(roslaunch):  # type: (Any) -> Dict[str, float]
    """For nodes that are deaf: an option of ROSLaunchParent since Noetic, constants before."""
    module = roslaunch.nodeprocess
    if hasattr(module, "DEFAULT_TIMEOUT_SIGINT"):
        return {"sigint_timeout": INTERRUPT, "sigterm_timeout": TERMINATE}
    module._TIMEOUT_SIGINT, module._TIMEOUT_SIGTERM = INTERRUPT, TERMINATE
    return {}


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
