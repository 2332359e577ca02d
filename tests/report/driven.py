"""A page driven in a real browser as a reader does it: an address with a fragment, and keys."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.request import urlopen

from websockets.sync.client import ClientConnection, connect

from report.chromium import browser


class Driven:
    """One tab."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._asked = 0

    def _ask(self, method: str, **params: Any) -> dict[str, Any]:
        self._asked += 1
        self._socket.send(json.dumps({"id": self._asked, "method": method, "params": params}))
        while True:
            answer: dict[str, Any] = json.loads(self._socket.recv(timeout=30))
            if answer.get("id") == self._asked:
                assert "error" not in answer, answer
                return answer

    def open(self, page: Path, fragment: str = "") -> None:
        """Go there, and wait until it is laid out."""
        self._ask("Page.navigate", url="about:blank")
        self._ask("Page.navigate", url=page.as_uri() + (f"#{fragment}" if fragment else ""))
        for _ in range(100):
            if self.value("document.readyState === 'complete' && location.protocol === 'file:'"):
                return
            time.sleep(0.05)
        raise AssertionError(f"{page} was not loaded")

    def value(self, script: str) -> Any:
        return self._ask("Runtime.evaluate", expression=script, returnByValue=True)["result"]["result"].get("value")

    def frames(self, count: int) -> None:
        """Wait until so many frames were drawn."""
        step = "(n) => n ? requestAnimationFrame(() => step(n - 1)) : done()"
        script = f"new Promise((done) => {{ const step = {step}; step({count}) }})"
        self._ask("Runtime.evaluate", expression=script, awaitPromise=True)

    def press(self, key: str) -> None:
        code, text = {"Tab": (9, ""), "Enter": (13, "\r"), " ": (32, " ")}[key]
        told = {"key": key, "code": "Space" if key == " " else key, "windowsVirtualKeyCode": code}
        self._ask("Input.dispatchKeyEvent", type="keyDown", text=text, **told)
        self._ask("Input.dispatchKeyEvent", type="keyUp", **told)


@contextmanager
def driven(folder: Path) -> Iterator[Driven]:
    """A browser with one tab."""
    profile = folder / "driven"
    command = [browser(), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}"]
    command += ["--remote-debugging-port=0", "--window-size=1400,1000", "about:blank"]
    running = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        said = profile / "DevToolsActivePort"
        for _ in range(300):
            if said.is_file() and said.read_text().count("\n"):
                break
            time.sleep(0.1)
        port = said.read_text().splitlines()[0]
        with urlopen(f"http://127.0.0.1:{port}/json/list", timeout=30) as answer:
            tab = next(found for found in json.load(answer) if found["type"] == "page")
        with connect(tab["webSocketDebuggerUrl"], max_size=None) as socket:
            yield Driven(socket)
    finally:
        running.terminate()
        running.wait(20)
