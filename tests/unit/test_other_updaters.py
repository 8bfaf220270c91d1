# SPDX-License-Identifier: GPL-3.0-or-later
"""`rosops-may` as a process, and what docs/other-updaters.md shows: each block is run as its own tool would run it."""

from __future__ import annotations

import base64
import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._robot.door import PATH
from ansible_collections.rosops.fleet.plugins.module_utils._ros import raw_node
from ansible_collections.rosops.fleet.plugins.module_utils._ros.raw_node import Slave
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.cluster_around import (
    certificate,
    environment,
    start_server,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.module_utils._robot.robot_at_the_door import (
    FILE,
    OWNER,
    SPACE,
    World,
    at_the_door,
    rosops_may,
)
from doc_blocks import CHECKOUT, Block, blocks_of

MAY = rosops_may()
INSTALLED = "/usr/local/bin/rosops-may"
PROXY = f"/api/v1/namespaces/{SPACE}/services/ros-keeper:11411/proxy"


class Api(ThreadingHTTPServer):
    """The API server of a world, and what was asked of it: verb, resource, name."""

    daemon_threads = True

    def __init__(self, world: World) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.world, self.asked = world, set[tuple[str, str, str]]()
        self.tokens = set[str]()
        threading.Thread(target=self.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class _Handler(BaseHTTPRequestHandler):
    server: Api

    def log_message(self, *_unused: object) -> None:
        """Quiet."""

    def _answer(self) -> None:
        path, api = self.path.partition("?")[0], self.server
        verb = {"GET": "get", "PUT": "update", "POST": "create"}[self.command]
        service = re.match(r"/api/v1/namespaces/[^/]+/services/([^/]+)/proxy/", path)
        name = service[1] if service else path.partition("/leases/")[2]
        api.asked.add((verb, "services/proxy" if service else "leases", name))
        api.tokens.add(self.headers.get("Authorization", ""))
        body = json.loads(self.rfile.read(int(self.headers.get("Content-Length") or 0)) or "null")
        status, said = api.world.send(self.command, self.path, body)
        data = json.dumps(said).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    do_GET = do_PUT = do_POST = _answer  # noqa: N815 - the library's names


@pytest.fixture
def world(monkeypatch: pytest.MonkeyPatch) -> Iterator[World]:
    with at_the_door(monkeypatch) as made:
        yield made


@pytest.fixture
def api(world: World) -> Iterator[Api]:
    made = Api(world)
    yield made
    made.shutdown()
    made.server_close()


@pytest.fixture
def tools(tmp_path: Path, api: Api) -> Path:
    """Programs in the place of those of a host: kubectl, sleep, and what a service does."""
    config = {
        "clusters": [{"name": "c", "cluster": {"server": api.url}}],
        "users": [{"name": "u", "user": {"token": "sesame"}}],
    }
    made = tmp_path / "bin"
    made.mkdir()
    (made / "config.json").write_text(json.dumps(config))
    programs = {
        "kubectl": f'echo "$@" >> {made}/asked; cat {made}/config.json',
        "sleep": "kill $PPID",  # whoever would wait and ask again
        "calibrate": "exit 0",
    }
    for name, text in programs.items():
        (made / name).write_text(f"#!/bin/sh\n{text}\n")
        (made / name).chmod(0o755)
    return made


@pytest.fixture
def host(tools: Path) -> dict[str, str]:
    """The environment of a process there."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith(("KUBE", "PYTHON"))}
    return {**kept, "PATH": f"{tools}:{Path(sys.executable).parent}:/usr/bin:/bin"}


def run(words: list[str], host: Mapping[str, str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, env=dict(host), capture_output=True, text=True, check=False, timeout=60)  # noqa: S603


# --- the pages' blocks ------------------------------------------------------------------------------------------------

PAGE = (CHECKOUT / "docs" / "other-updaters.md").read_text("utf-8")
# What a block says of itself -> the test that runs it.
SHOWN = {
    r"^rosops-may robot1 ": "commands",
    r"ansible.builtin.copy": "file",
    r"^kind: Role$": "rights",
    r"DPkg::": "apt",
    r"^\[Service\]$": "systemd",
    r"--owner flightctl": "flightctl",
    r"--owner mender": "mender",
    r"^kind: Job$|^command: ": "argocd",
}


def shown(what: str) -> list[Block]:
    pattern = next(pattern for pattern, name in SHOWN.items() if name == what)
    found = [block for block in blocks_of("page", PAGE) if re.search(pattern, block.text, re.MULTILINE)]
    assert found
    return [block._replace(text=block.text.replace(INSTALLED, str(FILE))) for block in found]


def test_each_block_is_run_by_a_test_of_this_file() -> None:
    found = [
        [name for pattern, name in SHOWN.items() if re.search(pattern, block.text, re.MULTILINE)]
        for block in blocks_of("page", PAGE)
    ]
    assert [names for names in found if len(names) != 1] == []
    assert [name for name in SHOWN.values() if f"def test_{name}(" not in Path(__file__).read_text("utf-8")] == []


def test_commands(world: World, host: dict[str, str]) -> None:
    (block,) = shown("commands")
    codes = [run([str(FILE), *shlex.split(one)[1:]], host).returncode for one in block.commands]
    assert (codes, world.holder) == ([0, 0, 0, 0], "")
    world.goal("/arm/move")
    found = [run([str(FILE), *shlex.split(one)[1:]], host) for one in block.commands]
    assert [one.returncode for one in found] == [75, 75, 75, 0]
    assert found[0].stderr == "rosops-may: robot1: not now: busy on /arm: 1 ACTIVE\n"


def test_file() -> None:
    (block,) = shown("file")
    source = block.value[0]["tasks"][0]["ansible.builtin.copy"]["src"]
    assert (CHECKOUT / source.rpartition("/rosops/fleet/")[2]).samefile(FILE)
    assert os.access(FILE, os.X_OK)


def test_rights(api: Api, host: dict[str, str]) -> None:
    """What is asked of the API server is what the role allows, and the first rule is enough to ask."""
    (block,) = shown("rights")
    rules = [
        {
            (verb, one, name)
            for verb in rule["verbs"]
            for one in rule["resources"]
            for name in rule.get("resourceNames", [""])
        }
        for rule in block.value["rules"]
    ]
    run([str(FILE), "robot1"], host)
    assert api.asked == rules[0]
    for words in (["--hold", "9"], ["--release"], ["--hold", "9"]):
        run([str(FILE), "robot1", "--owner", "me", *words], host)
    assert api.asked == {one for rule in rules for one in rule}
    assert api.tokens == {"Bearer sesame"}


@pytest.mark.skipif(not shutil.which("apt-config"), reason="this host has no apt")
def test_apt(world: World, host: dict[str, str], tmp_path: Path) -> None:
    """As apt does: each command by /bin/sh, and it stops where one before dpkg fails."""
    (block,) = shown("apt")
    (tmp_path / "conf").write_text(block.text)

    def invoke(when: str) -> int:
        words = ["apt-config", "-c", str(tmp_path / "conf"), "dump", "--format", "%v%n", f"DPkg::{when}"]
        ours = [one for one in run(words, host).stdout.splitlines() if str(FILE) in one]
        assert len(ours) == 1
        return run(["/bin/sh", "-c", ours[0]], host).returncode

    assert (invoke("Pre-Invoke"), world.holder) == (0, f"{OWNER}apt")
    assert (invoke("Post-Invoke"), world.holder) == (0, "")
    world.goal("/arm/move")
    assert (invoke("Pre-Invoke"), world.holder) == (75, "")


def test_systemd(world: World, host: dict[str, str], tools: Path, tmp_path: Path) -> None:
    (block,) = shown("systemd")
    text = block.text.replace("/usr/local/bin/calibrate", str(tools / "calibrate"))
    said = [line.partition("=") for line in text.splitlines() if "=" in line]
    commands = {key: shlex.split(value) for key, _, value in said if key.startswith("Exec")}
    assert [*commands] == ["ExecCondition", "ExecStart", "ExecStopPost"]
    assert (run(commands["ExecCondition"], host).returncode, world.holder) == (0, f"{OWNER}calibration")
    assert (run(commands["ExecStopPost"], host).returncode, world.holder) == (0, "")
    world.goal("/arm/move")
    assert 1 <= run(commands["ExecCondition"], host).returncode <= 254
    if shutil.which("systemd-analyze"):
        (tmp_path / "ours.service").write_text(text)
        found = run(["systemd-analyze", "verify", "--man=no", str(tmp_path / "ours.service")], host)
        assert [line for line in found.stderr.splitlines() if "ours.service" in line] == []


def test_flightctl(world: World, host: dict[str, str]) -> None:
    """Not by a shell, with an absolute path, and for as long as it may take."""
    before, after = (block.value for block in shown("flightctl"))
    ((hold,), (release,)) = ([shlex.split(one["run"]) for one in rule] for rule in (before, after))
    assert {one["timeout"] for one in (*before, *after)} <= {"1h", "1m"}
    assert hold[0].startswith("/")
    assert (run(hold, host).returncode, world.holder) == (0, f"{OWNER}flightctl")
    assert (run(release, host).returncode, world.holder) == (0, "")
    world.goal("/arm/move")
    assert run(hold, host).returncode != 0  # it would wait, and ask again


def test_mender(world: World, host: dict[str, str], tmp_path: Path) -> None:
    """0, 21 and 1 are all that Mender knows."""
    scripts = []
    for number, block in enumerate(shown("mender")):
        scripts.append(tmp_path / f"script{number}")
        scripts[-1].write_text(block.text)
        scripts[-1].chmod(0o755)
    enter, leave = ([str(one)] for one in scripts)
    assert (run(enter, host).returncode, world.holder) == (0, f"{OWNER}mender")
    world.run(1800)  # a reboot, in which the keeper begins anew
    world.start()
    assert (run(enter, host).returncode, world.holder) == (0, f"{OWNER}mender")
    assert (run(leave, host).returncode, world.holder) == (0, "")
    world.goal("/arm/move")
    found = run(enter, host)
    assert (found.returncode, "not now" in found.stderr) == (21, True)
    world.away = True
    assert (run(enter, host).returncode, run(leave, host).returncode) == (1, 1)


def test_argocd(world: World, host: dict[str, str]) -> None:
    job, after = (block.value for block in shown("argocd"))
    assert job["metadata"]["annotations"]["argocd.argoproj.io/hook"] == "PreSync"
    pod = job["spec"]["template"]["spec"]
    (container,) = pod["containers"]
    (volume,) = pod["volumes"]
    assert container["volumeMounts"][0]["name"] == volume["name"]
    assert (run(container["command"], host).returncode, world.holder) == (0, f"{OWNER}argocd")
    assert [*world.held_until] == ["/arm/move"]
    assert (run(after["command"], host).returncode, world.holder) == (0, "")
    world.goal("/arm/move")
    assert run(container["command"], host).returncode == 75


# --- how the cluster is found -----------------------------------------------------------------------------------------


def may(*words: str) -> int:
    code: int = MAY.main(["robot1", *words])
    return code


@pytest.mark.parametrize(
    "words", ["--hold 60", "--owner a", "--release", "--hold 0 --owner a", "--hold 9 --release --owner a"]
)
def test_half_a_question_is_refused(words: str) -> None:
    with pytest.raises(SystemExit) as ended:
        may(*words.split())
    assert ended.value.code == 2


def test_by_kubectl_s_own_configuration(
    host: dict[str, str], tools: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("PATH", host["PATH"])
    monkeypatch.setenv("KUBERNETES_SERVICE_HOST", "127.0.0.1")
    assert may("--kubeconfig", "/root/robot1", "--context", "there") == 0
    view = "config view --raw --minify --flatten --output=json"
    assert (tools / "asked").read_text() == f"--kubeconfig=/root/robot1 --context=there {view}\n"
    monkeypatch.delenv("KUBERNETES_SERVICE_HOST")
    assert may() == 0
    config = json.loads((tools / "config.json").read_text())
    texts = [base64.b64encode(one).decode() for one in certificate()]
    config["users"][0]["user"] = dict(zip(("client-certificate-data", "client-key-data"), texts, strict=True))
    config["clusters"][0]["cluster"]["certificate-authority-data"] = texts[0]
    (tools / "config.json").write_text(json.dumps(config))
    assert may() == 0
    (tools / "config.json").write_text(json.dumps({**config, "users": None}))
    assert may() == 1
    assert "neither a token nor a client's certificate" in capsys.readouterr().err
    (tools / "kubectl").write_text("#!/bin/sh\necho error: no context >&2; exit 1\n")
    assert may() == 1
    assert "(--kubeconfig, KUBECONFIG): error: no context" in capsys.readouterr().err
    monkeypatch.setenv("PATH", "/nowhere")
    assert may() == 1
    assert "takes kubectl, or k3s" in capsys.readouterr().err


def test_in_a_pod_by_its_account(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Over TLS, with the server's own authority."""
    server = start_server(tmp_path, SPACE)
    try:
        for key, value in environment(server).items():
            monkeypatch.setenv(key, value)
        monkeypatch.setattr(MAY, "ACCOUNT", tmp_path)
        monkeypatch.delenv("KUBECONFIG", raising=False)
        server.put(f"{PROXY}{PATH}may-change", {"go": True, "reason": "", "holder": "", "lease": ""})
        assert may() == 0
        path, query, headers = server.seen()
        assert (query["namespace"], headers["authorization"]) == (SPACE, "Bearer first")
        assert path == f"{PROXY}{PATH}may-change"
        # a keeper that knows nothing of the Lease: the robot is not held, so it is no go
        assert may("--hold", "60", "--owner", "a") == 75
        assert "was over before it began" in capsys.readouterr().err
        server.drop(f"{PROXY}{PATH}may-change")
        server.put(f"{PROXY}{PATH}may-change", {"go": "yes"})
        assert may() == 1
        server.drop(f"{PROXY}{PATH}may-change")
        server.put(f"{PROXY.replace(SPACE, 'fleet')}{PATH}may-change", {"go": True})
        assert may() == 0  # a shared master's keeper
        server.refuse = lambda path: 403 if path.startswith(PROXY) else 0  # whoever may ask that one alone
        assert may() == 0
        server.refuse = lambda path: 403 if PATH in path else 0
        assert may() == 1
        assert PROXY in capsys.readouterr().err
        (tmp_path / "ca.crt").write_bytes(certificate()[0])
        assert may() == 1
        assert "certificate" in capsys.readouterr().err.lower()
    finally:
        server.stop()


def test_at_the_keeper_itself(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(raw_node, "POLL", 0.01)
    slave = Slave("/ros_keeper", "127.0.0.1", 0, "http://127.0.0.1:1/")
    slave.show(PATH, world.door.page)
    slave.start()
    try:
        assert may("--url", slave.uri) == 0
        world.goal("/arm/move")
        assert may("--url", slave.uri) == 75
    finally:
        slave.stop()
    assert may("--url", slave.uri) == 1


@pytest.mark.parametrize(
    "answer",
    [
        "",
        "nonsense\r\n",
        "HTTP/1.1 200 OK\r\nContent-Length: 99\r\n\r\n{",
        "HTTP/1.1 500 No\r\nContent-Length: 9\r\n\r\n",
    ],
)
def test_an_answer_that_is_cut_off_says_nothing(answer: str, capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as listener:

        def cut() -> None:
            with listener.accept()[0] as link:
                link.recv(1 << 16)
                link.sendall(answer.encode())

        threading.Thread(target=cut, daemon=True).start()
        assert may("--url", f"http://127.0.0.1:{listener.getsockname()[1]}") == 1
    assert "cannot be asked" in capsys.readouterr().err


def test_no_name_on_the_graph_writes_to_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    said = {"go": False, "reason": "busy on /x\x9b2J\n/\u202eü"}
    assert MAY.main(["robot1"], lambda *_: (200, said)) == 75
    assert capsys.readouterr().err == "rosops-may: robot1: not now: busy on /x\\x9b2J /\\u202eü\n"


def test_an_address_that_is_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert may("--url", "http://10.0.0.7:11411x") == 1
    assert "11411x" in capsys.readouterr().err


def test_a_token_goes_nowhere_else(api: Api) -> None:
    with ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as elsewhere:

        class Away(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(302)
                self.send_header("Location", api.url)
                self.send_header("Content-Length", "0")
                self.end_headers()

            def log_message(self, *_unused: object) -> None:
                """Quiet."""

        elsewhere.RequestHandlerClass = Away
        threading.Thread(target=elsewhere.handle_request, daemon=True).start()
        send: Any = MAY.sender(f"http://127.0.0.1:{elsewhere.server_address[1]}", token="sesame")  # noqa: S106
        assert send("GET", "/x", None)[0] == 302
    assert api.asked == set()


def test_the_oldest_python_has_all_of_it() -> None:
    python = shutil.which("python3.8")
    if not python or run([python, "--version"], os.environ).returncode:
        pytest.skip("there is no Python 3.8 here")
    assert "SECONDS" in run([python, str(FILE), "--help"], os.environ).stdout
