# SPDX-License-Identifier: GPL-3.0-or-later
"""A headless Chromium that is asked through its debugging pipe: what a page shows, says and fetches.

The pipe (file descriptors 3 and 4, JSON ended by a zero byte) needs no port and nothing beside the standard library.
"""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

HOW_TO_INSTALL = "no Chromium on this machine; on Debian: apt-get install chromium"
SECONDS = 60.0
# The browser itself must ask nobody for anything, so that what is asked for is the page's doing.
DISABLED = ("gpu", "dev-shm-usage", "background-networking", "component-update", "extensions", "sync")
OPTIONS = [
    *("--headless=new", "--remote-debugging-pipe", "--no-first-run", "--no-default-browser-check"),
    *(f"--disable-{part}" for part in DISABLED),
    "--host-resolver-rules=MAP * ~NOTFOUND",
]


def found() -> str | None:
    return shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


def sandbox() -> list[str]:
    """A namespace sandbox is not to be had as root, nor in most containers; what is opened are files of our own."""
    return ["--no-sandbox"] if os.geteuid() == 0 else []


class Chromium:
    """One browser with one tab. `console`, `exceptions` and `requests` are what the pages did since the last `open`."""

    def __init__(self, program: str, profile: Path) -> None:
        command_read, self._commands = os.pipe()
        self._answers, answer_write = os.pipe()
        self._log = (profile.parent / "chromium.log").open("wb")
        wrapper = 'exec 3<&"$1" 4>&"$2"; shift 2; exec "$@"'  # the numbers that the browser expects
        self._process = subprocess.Popen(  # noqa: S603 - a command of our own
            ["/bin/bash", "-c", wrapper, "bash", str(command_read), str(answer_write),
             program, *OPTIONS, *sandbox(), f"--user-data-dir={profile}", "about:blank"],
            stdin=subprocess.DEVNULL, stdout=self._log, stderr=self._log, pass_fds=(command_read, answer_write),
        )  # fmt: skip
        os.close(command_read)
        os.close(answer_write)
        self._number, self._buffer, self._session = 0, b"", ""
        self.console: list[str] = []
        self.requests: list[str] = []
        self._events: list[str] = []
        self._attach()

    def _attach(self) -> None:
        target = self.ask("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.ask(f"{domain}.enable")

    def close(self) -> None:
        try:
            self._session = ""
            self.ask("Browser.close")
            self._process.wait(timeout=10)
        except (OSError, TimeoutError, subprocess.TimeoutExpired):
            self._process.kill()
            self._process.wait()
        for descriptor in (self._commands, self._answers):
            os.close(descriptor)
        self._log.close()

    # --- the pipe ---------------------------------------------------------------------------------------------------

    def ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._commands, json.dumps(message).encode() + b"\0")
        deadline = time.monotonic() + SECONDS
        while True:
            answer = self._next(deadline)
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']['message']}")
                return dict(answer["result"])

    def _next(self, deadline: float) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            if not select.select([self._answers], [], [], max(deadline - time.monotonic(), 0))[0]:
                raise TimeoutError("Chromium does not answer")
            chunk = os.read(self._answers, 1 << 20)
            if not chunk:
                raise OSError(f"Chromium has ended: see {self._log.name}")
            self._buffer += chunk
        text, _zero, self._buffer = self._buffer.partition(b"\0")
        message: dict[str, Any] = json.loads(text)
        self._note(message)
        return message

    def _note(self, message: dict[str, Any]) -> None:
        method, params = message.get("method", ""), message.get("params") or {}
        self._events.append(method)
        if method == "Runtime.consoleAPICalled":
            self.console.append(f"{params['type']}: {params['args']}")
        elif method == "Runtime.exceptionThrown":
            self.console.append(f"exception: {params['exceptionDetails'].get('text')}")
        elif method == "Log.entryAdded":
            self.console.append(f"{params['entry']['level']}: {params['entry']['text']}")
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    # --- the page ---------------------------------------------------------------------------------------------------

    def open(self, file: Path, width: int, height: int = 800, dark: bool = False) -> None:
        """Load the file in a window of that size. A narrow one is a phone: touch, and the page's own viewport."""
        self.ask("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                 mobile=width < 600)  # fmt: skip
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.ask("Emulation.setEmulatedMedia", features=[scheme])
        self.ask("Page.navigate", url="about:blank")
        self.console, self.requests, self._events = [], [], []
        self.ask("Page.navigate", url=file.as_uri())
        deadline = time.monotonic() + SECONDS
        while "Page.loadEventFired" not in self._events:
            self._next(deadline)
        self.evaluate("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")

    def evaluate(self, expression: str) -> Any:
        answer = self.ask("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(str(answer["exceptionDetails"]))
        return answer["result"].get("value")

    def screenshot(self, file: Path, above: str = "") -> None:
        """The whole page, however long; or what stands above an element."""
        part: dict[str, Any] = {}
        if above:
            width = self.evaluate("document.documentElement.clientWidth")
            height = self.evaluate(f"document.querySelector({above!r}).getBoundingClientRect().top")
            part = {"clip": {"x": 0, "y": 0, "width": width, "height": height, "scale": 1}}
        answer = self.ask("Page.captureScreenshot", format="png", captureBeyondViewport=True, **part)
        file.write_bytes(base64.b64decode(answer["data"]))
