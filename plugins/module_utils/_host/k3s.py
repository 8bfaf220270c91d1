# SPDX-License-Identifier: GPL-3.0-or-later
"""A host's files; what k3s is there, what it was started with, whether it serves, and its binary's way there.

Decisions are functions of text; `Host`, `K3sHost` and `fetch` are the only I/O.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from pathlib import Path
from typing import Any, Callable, Iterable, Mapping

from .._common.errors import FleetError
from .._common.poll import FAIL, PASS, WAIT, Seen
from .._step.objects import Object

UNIT_DIRECTORY = "/etc/systemd/system"
UNIT_CGROUP = re.compile(r"/k3s(-agent)?\.service(/|$)", re.MULTILINE)
BINARY = "/usr/local/bin/k3s"
CONFIG_DIR = "/etc/rancher/k3s"
DATA_DIR = "/var/lib/rancher/k3s"
ETCD = f"{DATA_DIR}/server/db/etcd"
ENCRYPTION = f"{DATA_DIR}/server/cred/encryption-config.json"  # k3s keeps its key there, if it encrypts Secrets
# Names of our own, so that a file of the operator's is never taken for ours and deleted.
SYSCTLS = "/etc/sysctl.d/90-rosops-fleet.conf"
NEIGHBOURS = "/etc/sysctl.d/90-rosops-fleet-cni0.conf"
AUDIT_POLICY = f"{CONFIG_DIR}/rosops-fleet-audit.yaml"
KUBECONFIG = f"{CONFIG_DIR}/k3s.yaml"
SERVICES = {"server": "k3s", "agent": "k3s-agent"}
# The unit writes here what it was started with (plugin_utils/_k3s/wanted.py).
STARTED_WITH = "/run/rosops-fleet-{service}.started"
STATE = "%n %i %s %Y"  # of one file, for stat
SHOWN = ("LoadState", "ActiveState", "SubState", "UnitFileState", "NRestarts", "Result")
RESTARTS_ALLOWED = 3
FULL_TOKEN = re.compile(r"^K10[0-9a-f]{64}::")
# Forms in which k3s and what it runs write secrets; what is named `before` stays.
SECRETS = (
    re.compile(r"(?P<before>)K10[0-9a-f]{64}::[^\s\"']+"),
    re.compile(r"(?i)(?P<before>authorization[\"']?\s*[=:]\s*[\"']?(?:(?:bearer|basic)\s+)?)[^\s\"',]+"),
    re.compile(
        r"(?i)(?P<before>(?:token|passw(?:or)?d|(?<![a-z])pass|psk|secret|join-?key)[\w-]*[\"']?\s*[=:]\s*[\"']?)[^\s\"',]{6,}"
    ),
    re.compile(r"(?i)(?P<before>--[\w-]*(?:token|password|secret)[ =]+)[^\s\"',]+"),
    re.compile(r"(?P<before>(?:://[^\s/:@]*|(?:^|[\s\"'=])[\w.-]+):)[^\s/@]+(?=@(?!sha\d))"),
)
TROUBLE = re.compile(r"^[EF]\d{4} |level=(error|fatal|panic)|^panic:|\"level\":\"(error|fatal|panic)\"|^error:", re.I)
LONGEST_LINE = 300
BLOCK = 1 << 20  # bytes that are read at once of a large file
SUM_LINE = re.compile(r"^([0-9a-f]{64}) [ *](\S+)$", re.MULTILINE)  # as sha256sum writes it
PROXY = re.compile(r"(https?|all|no)_proxy", re.IGNORECASE)

Run = Callable[..., Any]  # as AnsibleModule.run_command: (return code, standard output, standard error)


def token_password(token: str) -> str:
    """The part of a token that is the secret: the full form `K10<hash of the CA>::<user>:<password>` has more.

    One of an agent's own has no user: `K10<hash of the CA>::<id>.<password>`.
    """
    text = token.strip()
    if not FULL_TOKEN.match(text):
        return text
    said = text.split("::", 1)[1]
    return said.partition(":")[2] or said


def token_verdict(given: str, kept: str, cluster: str) -> str:
    """How the token that was asked for stands to the one there is.

    `kept` is what our file holds, `cluster` what k3s itself wrote once it ran. `absent`: there is none yet; `lost`: the
    cluster has one, our file is gone and none was given; `restore`: the given one is the cluster's, our file is gone;
    `same`; `differs`.
    """
    known = [token_password(token) for token in (kept, cluster) if token.strip()]
    if not known:
        return "absent"
    if given and any(token_password(given) != password for password in known):
        return "differs"
    if not kept.strip():
        return "restore" if given else "lost"
    return "differs" if len(set(known)) > 1 else "same"


def without_secrets(text: str, secrets: Iterable[str] = ()) -> str:
    """The text without tokens and passwords: it goes into an error message."""
    known = {token_password(secret) for secret in secrets if len(secret.strip()) > 3}
    for secret in sorted(known, key=len, reverse=True):
        text = text.replace(secret, "********")
    for form in SECRETS:
        text = form.sub(r"\g<before>********", text)
    return text


def version_of(text: str) -> str:
    """`v1.34.2+k3s1` out of `k3s version v1.34.2+k3s1 (sha)`."""
    found = re.search(r"\bv\d+\.\d+\.\d+\S*", text)
    return found.group(0) if found else ""


def service_verdict(shown: dict[str, str], restarts_before: int) -> Seen:
    """What systemd says about the unit: up, not yet, or hopeless."""
    state = f"{shown.get('ActiveState', '')} ({shown.get('SubState', '')})"
    restarts = int(shown.get("NRestarts") or 0) - restarts_before
    if shown.get("LoadState") != "loaded":
        return Seen(FAIL, f"the unit is {shown.get('LoadState') or 'unknown'}")
    if shown.get("ActiveState") == "failed":
        return Seen(FAIL, f"the unit failed: {shown.get('Result')}")
    if restarts >= RESTARTS_ALLOWED:
        return Seen(FAIL, f"the unit keeps ending: started {restarts} times again, last result {shown.get('Result')}")
    return Seen(PASS if shown.get("ActiveState") == "active" else WAIT, f"the unit is {state}")


def member_verdict(node: Object) -> Seen:
    """Whether this server has a vote in etcd. A learner has none yet: the next server must not be touched before.

    k3s puts the condition EtcdIsVoter on its own Node; a datastore of another kind has no such condition.
    """
    for condition in node.get("status", {}).get("conditions", []):
        if condition.get("type") == "EtcdIsVoter" and condition.get("status") != "True":
            return Seen(WAIT, f"etcd member has no vote yet: {condition.get('message', '')}")
    return Seen(PASS, "etcd member has a vote")


def sha256(path: Path) -> str:
    """Empty where there is no file."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as file:
            for block in iter(lambda: file.read(BLOCK), b""):
                digest.update(block)
    except FileNotFoundError:
        return ""
    return digest.hexdigest()


class Host:
    """Reads of one machine's files; a file that is missing or unreadable reads as empty.

    Every one is read below `root`, so that tests can hand in a recorded tree of another machine.
    """

    def __init__(self, root: str = "/") -> None:
        self.root = Path(root)

    def path(self, name: str) -> Path:
        return self.root / name.lstrip("/")

    def read(self, name: str) -> str:
        try:
            return self.path(name).read_bytes().decode("utf-8", "replace").replace("\0", "")
        except OSError:
            return ""

    def exists(self, name: str) -> bool:
        return os.path.lexists(str(self.path(name)))

    def names(self, name: str) -> list[str]:
        try:
            return sorted(entry.name for entry in self.path(name).iterdir())
        except OSError:
            return []


class K3sHost(Host):
    """Reads of one host's k3s."""

    def __init__(self, run: Run, root: str = "/") -> None:
        super().__init__(root)
        self.run = run

    def must(self, *command: str, data: str | None = None, otherwise: str = "") -> str:
        """What a command printed. FleetError where it failed: how its words end, and what is the case `otherwise`."""
        code, out, err = self.run(list(command), data=data)
        if code != 0:
            told = without_secrets((err or out).strip())[-LONGEST_LINE:]
            raise FleetError("; ".join(filter(None, [f"{' '.join(command)}: {told}", otherwise])))
        return str(out)

    def describe(self, name: str) -> dict[str, object]:
        """Digest and mode of a file; `exists: false` and empty values for one that is not there."""
        path = self.path(name)
        try:
            return {"exists": True, "mode": f"{path.stat().st_mode & 0o7777:04o}", "sha256": sha256(path)}
        except OSError:
            return {"exists": False, "mode": "", "sha256": ""}

    def sizes(self, directory: str) -> dict[str, int]:
        try:
            return {entry.name: entry.stat().st_size for entry in self.path(directory).iterdir()}
        except OSError:
            return {}

    def version(self, binary: str = BINARY) -> str:
        """Empty where there is none that can be run."""
        path = self.path(binary)
        return version_of(self.ran(str(path), "--version")[1]) if path.exists() else ""

    def ran(self, *command: str) -> tuple[int, str, str]:
        """Also where it cannot be run: it was taken away, is another machine's, or what a cut has left of one."""
        try:
            code, out, err = self.run([*command], handle_exceptions=False)
        except OSError as error:
            return 126, "", str(error)
        return code, out, err

    def show(self, service: str) -> dict[str, str]:
        arguments = [argument for name in SHOWN for argument in ("-p", name)]
        text = self.run(["systemctl", "show", service, *arguments])[1]
        return dict(line.partition("=")[::2] for line in text.splitlines() if "=" in line)

    def stale(self, service: str, files: list[str]) -> bool:
        """Whether the running process was started with other files than those that are there now.

        This is asked of the host, not remembered from this run's changes: a run that was interrupted between writing a
        file and restarting would otherwise never be made good.
        """
        now = self.run(["stat", "-c", STATE, *files])[1]
        return sorted(now.splitlines()) != sorted(self.read(STARTED_WITH.format(service=service)).splitlines())

    def journal(self, service: str, lines: int, since: float) -> str:
        """The last lines that say something is wrong; of a unit that says nothing of the kind, the last lines."""
        secrets = [self.read(f"{CONFIG_DIR}/{name}") for name in ("token", "agent-token")]
        command = ["journalctl", "-u", service, "--since", f"@{int(since)}", "-n", "500", "-o", "cat", "--no-pager"]
        said = without_secrets(str(self.run(command)[1]), secrets).splitlines()
        # k3s writes much, and most of it is no news
        errors = [line for line in said if TROUBLE.search(line)]
        return "\n".join(line[:LONGEST_LINE] for line in (errors or said)[-lines:])

    def api(self, path: str) -> tuple[bool, str]:
        """GET below the local API server, with the administrator's certificate that k3s made."""
        kubectl = (BINARY, "kubectl", "--kubeconfig", KUBECONFIG, "--request-timeout", "5s")
        code, out, err = self.ran(*kubectl, "get", "--raw", path)
        return code == 0, (out if code == 0 else err).strip()

    def look(self, role: str, member: str = "", restarts_before: int = 0) -> Seen:
        """One look: the unit is up; on a server the API is ready and, if `member` names its Node, etcd counts it."""
        seen = service_verdict(self.show(SERVICES[role]), restarts_before)
        if seen.verdict != PASS or role != "server":
            return seen
        ready, text = self.api("/readyz")
        if not ready:
            return Seen(WAIT, f"/readyz: {text}")
        if not member:
            return seen
        found, text = self.api(f"/api/v1/nodes/{member}")
        return member_verdict(json.loads(text)) if found else Seen(WAIT, f"Node {member}: {text}")


# --- its binary -------------------------------------------------------------------------------------------------------


def proxies(environment: Mapping[str, object]) -> dict[str, str]:
    """What of a unit's environment concerns a download, in both spellings that programs read."""
    given = ((str(name), str(value)) for name, value in environment.items() if value is not None)
    found = {name: value for name, value in given if PROXY.fullmatch(name)}
    return {spelled: value for name, value in found.items() for spelled in (name.lower(), name.upper())}


def listed_sum(text: str, name: str, where: str) -> str:
    """A file's sum out of a list of sha256sum."""
    for digest, listed in SUM_LINE.findall(text):
        if listed == name:
            return str(digest)
    raise FleetError(f"{where} has no SHA-256 of {name}")


def fetch(open_url: Callable[[str], Any], url: str, place: Path, expected: str) -> bool:
    """Whether the file had to be brought. FleetError, and nothing there, where what came is not what was expected."""
    if sha256(place) == expected and os.access(str(place), os.X_OK):
        return False
    part = place.with_name(f"{place.name}.part")
    try:
        with part.open("wb") as file:
            answer = open_url(url)
            shutil.copyfileobj(answer, file, BLOCK)
        if left := getattr(answer, "length", 0):  # http.client takes the end of a connection for the file's
            raise FleetError(f"it broke off, and {left} bytes are missing")
        came = sha256(part)
        if came != expected:
            raise FleetError(f"it has the SHA-256 {came}, expected is {expected}")
        part.chmod(0o755)
        part.replace(place)
    finally:
        part.unlink(missing_ok=True)
    return True
