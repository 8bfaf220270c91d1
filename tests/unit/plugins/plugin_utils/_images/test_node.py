# SPDX-License-Identifier: GPL-3.0-or-later
"""Images on a simulated node: what is copied, imported, pulled, kept, and what is said when a step fails."""

from __future__ import annotations

import json
import subprocess
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from ansible_collections.rosops.fleet.plugins.module_utils._common.errors import SpecError
from ansible_collections.rosops.fleet.plugins.module_utils._host.k3s import BINARY
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.archive import Image, normal_ref, opened
from ansible_collections.rosops.fleet.plugins.plugin_utils._images.node import (
    LABEL,
    LOOK,
    PIN,
    PLACE,
    ImagesError,
    NodeImages,
    Present,
    auths,
    images_plan,
    node_images,
    pins,
    present,
)
from ansible_collections.rosops.fleet.tests.unit.plugins.plugin_utils._images.archives import (
    ID,
    docker,
    docker_image,
    sha,
    tar_of,
)

APPS, REDIS = "docker.io/lab/apps:1.0", "docker.io/library/redis:7"
BASE = tar_of({f"usr/share/file{number}": b"" for number in range(99)})


class Node:
    """A host with containerd. `broken` is the one step that fails, by its first words."""

    def __init__(self, broken: str = "", k3s: bool = True) -> None:
        self.images: dict[str, str] = {}
        self.blobs: set[str] = set()
        self.labels: dict[str, str] = {}
        self.forgets = self.refuses = False  # of the next import: a layer that it had, or all but some of what it got
        self.files: dict[str, str] = {}
        self.calls: list[str] = []
        self.broken = broken
        self.k3s = k3s
        self.imports = True
        self.program = Path("/nowhere")

    def module(self, name: str, args: Mapping[str, Any], secret: bool = False) -> dict[str, Any]:
        assert secret == ("stdin" in args)
        words = args.get("argv") or ["file", args["state"], args["path"]]
        what = ["", "pin", *words[4:]] if LABEL in words else words
        return self._step(" ".join(what[1:])) or getattr(self, name.rpartition(".")[2])(**args)

    def copy(self, src: str, dest: str, rate_limit: str) -> dict[str, Any]:
        self.files[dest] = src
        self.content = tarred(src)
        return self._step(f"copy {Path(src).name} {rate_limit}".strip()) or {}

    def _step(self, what: str) -> dict[str, Any]:
        self.calls.append("look" if "uname" in what else what)
        return {"failed": True, "rc": 1, "stderr": "no space"} if self.broken and self.broken in what else {}

    def file(self, path: str, state: str) -> dict[str, Any]:
        self.files.pop(path, None)
        return {"state": state}

    def command(self, argv: list[str], stdin: str = "") -> dict[str, Any]:
        if stdin:
            return self._pull_as(argv, stdin)
        if LABEL in argv:
            self.labels.update(zip(argv[5::2], argv[4::2], strict=True))
        elif argv[-2] == "pull":
            self.images[argv[-1]] = "sha256:pulled"
        elif argv[-2] == "import" and self.imports:
            self.images.update({one.ref: one.id for one in self.content[0]})
            self.blobs |= self.content[1]
            self.blobs -= {sha(BASE)} if self.forgets else set()
            failed, self.forgets, self.refuses = self.refuses, False, False
            return {"failed": failed}
        elif argv[0] == "/bin/sh":
            found = [{"id": digest, "repoTags": [ref]} for ref, digest in self.images.items()]
            labels = ["REF LABELS", *(f"{ref} {PIN}={why}" for ref, why in self.labels.items() if why)]
            parts = ["x86_64", json.dumps({"images": found}), "\n".join(labels), "\n".join(self.blobs), "{}"]
            there = {"rc": 0, "stdout": "\n--- rosops.fleet ---\n".join(parts)}
            ended = {"failed": True, "rc": 127, "stdout": "x86_64\n--- rosops.fleet ---", "stderr": "k3s: not found"}
            return there if self.k3s else ended
        return {"rc": 0}

    def _pull_as(self, argv: list[str], stdin: str) -> dict[str, Any]:
        """The real shell, and in the place of k3s a program that says what it was given."""
        assert argv[3] == BINARY
        found = subprocess.run(  # noqa: S603
            [*argv[:3], str(self.program), *argv[4:]], input=f"{stdin}\n", capture_output=True, text=True, check=False
        )
        if not found.returncode:
            self.images[argv[-1]] = "sha256:pulled"
        return {"failed": bool(found.returncode), "rc": found.returncode, "stderr": found.stderr}


def tarred(path: str) -> tuple[list[Image], set[str]]:
    """What an import makes of it."""
    with opened(path) as found:
        files = [file for member in found.members.values() if (file := found.archive.extractfile(member))]
        return found.images(), {sha(file.read()) for file in files}


@pytest.fixture(name="archive")
def _archive(tmp_path: Path) -> dict[str, str]:
    return {"path": docker(tmp_path / "apps.tar", ["lab/apps:1.0"])}


def test_everything_is_brought_once_and_the_room_is_free_again(archive: dict[str, str]) -> None:
    node, said = Node(), list[str]()
    images = NodeImages(node, rate_limit="2m", say=said.append)
    brought = images.bring([archive], ["redis:7"])
    after = f"{APPS} {ID}\n{REDIS} sha256:pulled\n"
    assert brought == {"changed": True, "present": node.images, "diff": {"before": "", "after": after}}
    assert node.calls == [
        "look", "copy apps.tar 2m", f"ctr --namespace k8s.io images import {PLACE}", f"absent {PLACE}",
        "crictl pull docker.io/library/redis:7", "look", f"pin wanted {APPS} wanted {REDIS}",
    ]  # fmt: skip
    assert node.files == {}
    assert [text.split()[0] for text in said] == ["copying", "importing", "pulling"]
    node.calls.clear()
    again = images.bring([archive], ["redis:7"])
    assert (again["changed"], again["diff"], node.calls) == (False, {"before": after, "after": after}, ["look"])


def test_nothing_wanted_costs_nothing() -> None:
    node = Node()
    assert NodeImages(node).bring([], [])["changed"] is False
    assert node.calls == []


def test_check_mode_looks_and_says_what_would_be_there(archive: dict[str, str]) -> None:
    node = Node()
    node.images[normal_ref("redis:7")] = "sha256:old"
    brought = NodeImages(node).bring([archive], ["redis:7", "lab/new:1"], check=True)
    assert node.calls == ["look"]
    assert "failed" not in brought
    assert brought["diff"] == {
        "before": f"{REDIS} sha256:old\n",
        "after": f"{APPS} {ID}\ndocker.io/lab/new:1 as the registry has it\n{REDIS} sha256:old\n",
    }


def test_check_mode_meets_a_host_without_k3s_and_a_run_does_not_pass_over_it(archive: dict[str, str]) -> None:
    images = NodeImages(Node(k3s=False))
    assert images.bring([archive], [], check=True)["diff"]["after"] == f"{APPS} {ID}\n"
    with pytest.raises(ImagesError, match="cannot be listed: k3s: not found"):
        images.bring([archive], [])


@pytest.mark.parametrize(
    ("broken", "message", "kept"),
    [
        ("copy", r"apps.tar could not be copied: no space", [PLACE]),
        ("import", r"apps.tar could not be imported: no space", []),
        ("pin", r"wanted docker.io/lab/apps:1.0 wanted docker.io/library/redis:7: no space", []),
        ("pull", r"crictl pull docker.io/library/redis:7: no space", []),
        ("absent", f"{PLACE}: no space", [PLACE]),
    ],
)
def test_a_step_that_fails_is_named_with_its_reason(
    archive: dict[str, str], broken: str, message: str, kept: list[str]
) -> None:
    """Only an interrupted transfer is kept, for the next one."""
    node = Node(broken)
    with pytest.raises(ImagesError, match=message):
        NodeImages(node).bring([archive], ["redis:7"])
    assert list(node.files) == kept


def test_an_image_that_no_archive_has_is_said_to_be_so(archive: dict[str, str]) -> None:
    told = rf"crictl pull docker.io/lab/apps:1.0.1: no space; no archive in images_archives has it, only {APPS}"
    with pytest.raises(ImagesError, match=told):
        NodeImages(Node("pull")).bring([archive], ["lab/apps:1.0.1"])
    with pytest.raises(ImagesError, match=r"redis:7: no space$"):
        NodeImages(Node("pull")).bring([], ["redis:7"])


def test_one_archive_at_a_time_lies_on_the_node_also_two_of_one_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        docker(tmp_path / name / "apps.tar", [f"lab/{name}:1.0"])
    node = Node()
    assert "failed" not in NodeImages(node).bring([{"path": f"~/{name}/apps.tar"} for name in ("old", "new")], [])
    assert {"docker.io/lab/old:1.0", "docker.io/lab/new:1.0"} == {*node.images}
    assert [call.split()[0] for call in node.calls] == [
        "look", "copy", "ctr", "absent", "copy", "ctr", "absent", "look", "pin",
    ]  # fmt: skip


def test_an_import_that_did_nothing_is_a_problem(archive: dict[str, str]) -> None:
    node = Node()
    node.imports = False
    assert NodeImages(node).bring([archive], [])["msg"] == f"{APPS} is not there"
    node.images[APPS] = "sha256:other"
    assert NodeImages(node).bring([archive], [])["msg"] == f"{APPS} has the ID sha256:other, not {ID}"


# --- a next version --------------------------------------------------------------------------------------------------


def versions(tmp_path: Path) -> tuple[list[dict[str, str]], list[dict[str, str]]]:
    """Two archives, whose images have all but one layer in common."""
    made = [
        docker_image(tmp_path / f"apps-{name}.tar", f"lab/apps:{name}", [BASE, tar_of({name: b""})]) for name in "12"
    ]
    return [{"path": made[0]}], [{"path": made[1]}]


def test_of_a_next_version_only_what_is_new_crosses_the_link(tmp_path: Path) -> None:
    (first, second), node, said = versions(tmp_path), Node(), list[str]()
    images = NodeImages(node, rate_limit="2m", say=said.append)
    images.bring(first, [])
    assert "failed" not in images.bring(second, [])
    copies = [call for call in node.calls if call.startswith("copy")]
    assert copies == ["copy apps-1.tar 2m", "copy thin.tar 2m"]
    assert "copying 0.0 MB of 0.1 MB: " in said[2]
    assert {*node.images} == {"docker.io/lab/apps:1", "docker.io/lab/apps:2"}
    assert node.labels == {"docker.io/lab/apps:1": "before", "docker.io/lab/apps:2": "wanted"}
    assert images.bring(second, [])["changed"] is False


@pytest.mark.parametrize("does", ["forgets", "refuses"])
def test_what_a_part_does_not_bring_comes_with_the_whole_archive(tmp_path: Path, does: str) -> None:
    (first, second), node = versions(tmp_path), Node()
    images = NodeImages(node)
    images.bring(first, [])
    setattr(node, does, True)
    assert "failed" not in images.bring(second, [])
    assert [call for call in node.calls if call.startswith("copy")][1:] == ["copy thin.tar", "copy apps-2.tar"]
    assert sha(BASE) in node.blobs


# --- a registry that asks who one is ---------------------------------------------------------------------------------


@pytest.fixture(name="private")
def _private(tmp_path: Path) -> Node:
    """A node whose crictl takes credentials from its environment, and a registry that knows one user."""
    node, right = Node(), b64encode(b"me:hunter2").decode()
    node.program = tmp_path / "k3s"
    node.program.write_text(
        '#!/bin/sh\n[ "$1 $2" = "crictl pull" ] || exit 3\n'
        f'[ "$CRICTL_AUTH" = "{right}" ] || {{ echo "$3: not authorized" >&2; exit 1; }}\n'
        'tr "\\0" " " < /proc/$$/cmdline > "$0.seen"\n'
    )
    node.program.chmod(0o700)
    return node


def login(registry: str = "r.example", user: str = "me", word: str = "hunter2") -> dict[str, str]:
    return {"name": "pull", "registry": registry, "username": user, "password": word}


def test_credentials_reach_crictl_and_no_command_line(private: Node) -> None:
    logins = [login(word="stale"), login(), login(word="older")]
    NodeImages(private, logins=logins).bring([], ["r.example/app:1", "redis:7"])
    assert set(private.images) == {"r.example/app:1", REDIS}
    said = " ".join(private.calls) + Path(f"{private.program}.seen").read_text()
    assert "crictl pull r.example/app:1" in said
    assert not [secret for secret in ("hunter2", b64encode(b"me:hunter2").decode()) if secret in said]


def test_wrong_credentials_are_told_and_not_shown(private: Node) -> None:
    with pytest.raises(ImagesError) as caught:
        NodeImages(private, logins=[login(word="wrong")]).bring([], ["r.example/app:1"])
    assert "crictl pull r.example/app:1: r.example/app:1: not authorized" in str(caught.value)
    assert "wrong" not in str(caught.value)


# --- what is to be done ----------------------------------------------------------------------------------------------


def listing(*images: tuple[str, list[str]]) -> str:
    return json.dumps({"images": [{"id": digest, "repoTags": tags} for digest, tags in images]})


@pytest.mark.parametrize(("text", "brings", "pulls"), [
    ("", True, True), (listing(), True, True), (listing(("1", ["docker.io/lab/other:1.0"])), True, True),
    (listing((ID, [APPS])), False, True), (listing((ID.partition(":")[2], [APPS])), False, True),
    (listing(("sha256:old", [APPS, REDIS])), True, False),
])  # fmt: skip
def test_what_is_there_by_id_does_not_travel(tmp_path: Path, text: str, brings: bool, pulls: bool) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0"])
    names = ["redis:7", "docker.io/redis:7", "lab/apps:1.0"]  # what an archive holds is not pulled
    wanted, bring, pull = images_plan([{"path": path}], names, Present("x86_64", node_images(text)))
    assert [*bring] == ([path] if brings else [])
    assert pull == ([REDIS] if pulls else [])
    assert wanted == {APPS: ID, REDIS: ""}


def test_only_the_named_images_count(tmp_path: Path) -> None:
    path = docker(tmp_path / "a.tar", ["lab/apps:1.0", "lab/ros:noetic"])
    present = Present("x86_64", {APPS: ID})
    assert images_plan([{"path": path}], [], present)[1]
    assert images_plan([{"path": path, "images": ["lab/apps:1.0"]}], [], present)[1] == {}
    with pytest.raises(SpecError, match=r"does not hold docker.io/lab/apps:2.0, only docker.io/lab/apps:1.0"):
        images_plan([{"path": path, "images": ["lab/apps:2.0"]}], [], present)


def test_of_archives_that_hold_one_name_the_last_counts(tmp_path: Path) -> None:
    new = b'{"architecture": "amd64"}'
    archives = [{"path": docker(tmp_path / "all.tar", ["lab/apps:1.0", "lab/ros:noetic"])}]
    archives += [{"path": docker(tmp_path / "apps.tar", ["lab/apps:1.0"], new)}]
    node = Node()
    assert [NodeImages(node).bring(archives, [])["changed"] for _run in range(2)] == [True, False]
    assert node.images[APPS] == sha(new)
    del node.images["docker.io/lab/ros:noetic"]  # with it comes the other image of the name
    assert [NodeImages(node).bring(archives, []).get("failed") for _run in range(2)] == [None, None]
    assert node.images[APPS] == sha(new)


def test_one_archive_may_be_named_for_each_of_its_images(tmp_path: Path) -> None:
    path = docker(tmp_path / "all.tar", ["lab/apps:1.0", "lab/ros:noetic"])
    archives = [{"path": path, "images": [one]} for one in ("lab/apps:1.0", "lab/ros:noetic")]
    assert [one.ref for one in images_plan(archives, [], Present("x86_64", {}))[1][path]] == [APPS, ROS]


def test_an_archive_for_another_machine_is_refused(tmp_path: Path) -> None:
    path = docker(tmp_path / "d.tar", ["a:1"])
    with pytest.raises(SpecError, match="holds images for amd64, but the host is aarch64"):
        images_plan([{"path": path}], [], Present("aarch64", {}))


@pytest.mark.parametrize(("image", "registry", "fits"), [
    ("r.example/app:1", "r.example", True), ("r.example/app:1", "https://r.example/v2/", True),
    ("r.example:5000/app:1", "r.example:5000", True), ("r.example:5000/app:1", "r.example", False),
    ("r.example.org/app:1", "r.example", False), ("r.example/team/app@sha256:0", "r.example/team", True),
    ("r.example/teams/app:1", "r.example/team", False), ("redis:7", "https://index.docker.io/v1/", True),
    ("team/app", "docker.io", True), ("r.example/app:1", "docker.io", False),
])  # fmt: skip
def test_which_registry(image: str, registry: str, fits: bool) -> None:
    assert auths(image, [login(registry, word="p:w")]) == ([b64encode(b"me:p:w").decode()] if fits else [])


def test_several_and_those_that_somebody_else_keeps() -> None:
    logins = [login(user="a"), {"name": "other"}, login(user="b"), login(user="a")]
    assert auths("r.example/app", logins) == [b64encode(f"{user}:hunter2".encode()).decode() for user in "ab"]


# --- what is there ----------------------------------------------------------------------------------------------------

IMAGES = {
    "images": [
        {"id": "sha256:f707", "repoTags": ["docker.io/lab/ros:noetic"], "repoDigests": [], "pinned": False},
        {"id": "a47b", "repoTags": ["docker.io/lab/apps:1.1"], "repoDigests": ["docker.io/lab/apps@sha256:5d08"]},
    ]
}
LABELS = """\
REF                      TYPE                     DIGEST      SIZE      PLATFORMS   LABELS
docker.io/lab/apps:1.1   application/vnd.oci.image sha256:5d08 249.6 MiB linux/amd64 \
io.cri-containerd.image=managed,io.cri-containerd.pinned=pinned,rosops.fleet/pinned=wanted
docker.io/lab/ros:noetic application/vnd.docker   sha256:1f34 248.9 MiB linux/amd64 io.cri-containerd.image=managed
docker.io/lab/old:1      application/vnd.docker   sha256:1f35 248.9 MiB linux/amd64 -
docker.io/mine:1         application/vnd.docker   sha256:1f36 248.9 MiB linux/amd64 io.cri-containerd.pinned=pinned
"""
CONTAINERS = {"containers": [{"imageRef": "sha256:f707", "image": {"image": "sha256:f707"}}, {"imageRef": "a47b"}]}


def printed(*parts: str) -> str:
    return "--- rosops.fleet ---\n".join(f"{part}\n" for part in parts).strip()


def test_all_of_it_is_one_command() -> None:
    assert LOOK.count("echo '--- rosops.fleet ---'") == 4
    parts = json.dumps(IMAGES, indent=2), LABELS, "sha256:a\nsha256:b", json.dumps(CONTAINERS)
    found = present(printed("x86_64", *parts))
    assert found == Present(
        "x86_64",
        {
            "docker.io/lab/ros:noetic": "sha256:f707",
            "docker.io/lab/apps:1.1": "sha256:a47b",
            "docker.io/lab/apps@sha256:5d08": "sha256:a47b",
        },
        {"docker.io/lab/apps:1.1": "wanted"},  # what somebody else pinned is not ours to let go
        frozenset({"sha256:a", "sha256:b"}),
        frozenset({"sha256:f707", "sha256:a47b"}),
    )


def test_a_listing_that_is_no_json() -> None:
    with pytest.raises(SpecError, match="no JSON"):
        node_images("FATA[0000] connect: no such file")


# --- pins ------------------------------------------------------------------------------------------------------------

V1, V2, V3, ROS = (f"docker.io/lab/{name}" for name in ("apps:1", "apps:2", "apps:3", "ros:noetic"))
IDS = {V1: "sha256:1", V2: "sha256:2", V3: "sha256:3", ROS: "sha256:0"}


def node(*there: str, used: tuple[str, ...] = (), **now: str) -> Present:
    """`now` are pins, by a version's name."""
    known = {"v1": V1, "v2": V2, "v3": V3, "ros": ROS}
    own = {known[name]: why for name, why in now.items()}
    return Present("x86_64", {ref: IDS[ref] for ref in there}, own, frozenset(), frozenset(IDS[ref] for ref in used))


@pytest.mark.parametrize(
    ("wanted", "there", "changes"),
    [
        ([V1, ROS], node(V1, ROS), {V1: "wanted", ROS: "wanted"}),
        ([V1, V3], node(V1), {V1: "wanted"}),  # one that is not there has nothing to label
        ([V1], node(V1, v1="wanted"), {}),
        # the next version: what was wanted until now is what its step would go back to
        ([V2], node(V1, V2, v1="wanted"), {V1: "before", V2: "wanted"}),
        ([V2], node(V1, V2, v1="before", v2="wanted"), {}),
        ([V3], node(V1, V2, V3, v1="before", v2="wanted"), {V1: "", V2: "before", V3: "wanted"}),
        # version 2 did not get through: 1 runs on, and is what the step to 3 goes back to
        ([V3], node(V1, V2, V3, used=(V1,), v1="before", v2="wanted"), {V2: "before", V3: "wanted"}),
        # nobody had pinned what runs: the node had pulled it by itself
        ([V2], node(V1, V2, used=(V1,)), {V1: "before", V2: "wanted"}),
        ([V2], node(V2, ROS, used=(V2, ROS)), {V2: "wanted"}),  # of another repository: not ours
        ([V1], node(V1, V2, v1="before", v2="wanted"), {V1: "wanted", V2: "before"}),  # back again
        ([], node(V1, v1="wanted"), {V1: "before"}),
        ([V1], node(v1="wanted"), {}),  # somebody has removed it
    ],
)
def test_what_is_wanted_and_what_was_before_it(wanted: list[str], there: Present, changes: dict[str, str]) -> None:
    assert pins(wanted, there) == changes
    left = {ref: why for ref, why in {**there.pins, **changes}.items() if why}
    assert pins(wanted, replace(there, pins=left)) == {}  # a second run changes nothing


@pytest.mark.parametrize(("new", "same"), [("edge1:5000/a@sha256:2", True), ("edge1:5000/b:1", False)])
def test_what_runs_is_kept_where_it_is_of_the_same_repository(new: str, same: bool) -> None:
    there = Present("x86_64", {"edge1:5000/a:1": "sha256:1", new: "sha256:2"}, used=frozenset({"sha256:1"}))
    assert pins([new], there) == {new: "wanted", **({"edge1:5000/a:1": "before"} if same else {})}


@pytest.mark.parametrize("broken", [False, True])
def test_the_shell_labels_all_of_them_and_says_when_one_cannot_be(tmp_path: Path, broken: bool) -> None:
    k3s = tmp_path / "k3s"
    ends = 'case "$6" in */apps:1) exit 3; esac\n' if broken else ""
    k3s.write_text(f'#!/bin/sh\necho "$@" >> {tmp_path}/seen\n{ends}')
    k3s.chmod(0o700)
    found = subprocess.run(  # noqa: S603
        ["/bin/sh", "-c", LABEL, str(k3s), "wanted", V2, "", V1, "before", V3], capture_output=True, check=False
    )  # fmt: skip
    said = (tmp_path / "seen").read_text().splitlines()
    label = "ctr --namespace k8s.io images label"
    assert said[:2] == [
        f"{label} {V2} io.cri-containerd.pinned=pinned rosops.fleet/pinned=wanted",
        f"{label} {V1} io.cri-containerd.pinned= rosops.fleet/pinned=",
    ]
    assert (found.returncode, len(said)) == ((3, 2) if broken else (0, 3))


def test_what_a_step_has_brought_stays_pinned_where_nobody_asks_for_it() -> None:
    """The next run brings the archives alone. What the node has pulled by itself is none of its business."""
    there = node(V1, V2, ROS, v2="wanted")
    assert pins([ROS], there, [V1, V2]) == {ROS: "wanted"}
    assert pins([ROS], there) == {ROS: "wanted", V2: "before"}
