"""Headless Chromium for tests: pages from files, keys and clicks, scripts, and whatever the page complained about."""

import base64
import contextlib
import fcntl
import json
import os
import re
import select
import shutil
import subprocess
import time

import pytest

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Without a browser tests are skipped, except where .ci/run can install one.
needs_browser = pytest.mark.skipif(not CHROMIUM and "BROWSER_NEEDED" not in os.environ, reason="no Chromium here")
# Elements with words smaller than 13 pixels.
SMALL_WORDS = (
    "[...document.querySelectorAll('main *')].filter(e => e.textContent.trim() && "
    "parseFloat(getComputedStyle(e).fontSize) < 13).map(e => e.outerHTML)"
)


class Browser:
    """One page, driven over DevTools' pipe: messages of JSON that end with a zero byte."""

    def __init__(self, profile, *, width=1280, height=800):
        assert CHROMIUM, "no Chromium: BROWSER_NEEDED is set, so install one"
        ours, theirs = [], []
        for i in range(2):
            pair = [_high(end) for end in os.pipe()]
            theirs.append(pair[i])
            ours.append(pair[1 - i])
        self._write, self._read = ours
        command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"]
        command += [f"--user-data-dir={profile}", f"--window-size={width},{height}", "--remote-debugging-pipe"]
        shell = f'exec "$@" 3<&{theirs[0]} 4>&{theirs[1]}'
        self._process = subprocess.Popen(
            ["bash", "-c", shell, "bash", *command, "about:blank"],
            pass_fds=theirs,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        for end in theirs:
            os.close(end)
        self._number, self._buffer, self._session = 0, b"", None
        self.complaints, self.requests = [], []
        targets = self._call("Target.getTargets")["targetInfos"]
        page = next(t["targetId"] for t in targets if t["type"] == "page")
        self._session = self._call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self._call(f"{domain}.enable")
        self.resize(width, height)

    def resize(self, width, height):
        """Give the window a size [px]."""
        size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self._call("Emulation.setDeviceMetricsOverride", **size)

    def open(self, path):
        """Load a file, and wait until it is."""
        self._call("Page.navigate", url=path.as_uri())
        self.until("document.readyState === 'complete' && location.protocol === 'file:'")

    def run(self, script):
        """The value of an expression; promises are waited for."""
        told = self._call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in told, told["exceptionDetails"]
        return told["result"].get("value")

    def until(self, script, seconds=20.0):
        """Wait until an expression is true."""
        end = time.monotonic() + seconds
        while not self.run(script):
            assert time.monotonic() < end, f"never: {script}"
            time.sleep(0.02)

    def press(self, key, text=None):
        """A key, as a person presses it; `text` is what it types."""
        code = {"Tab": 9, "Enter": 13, " ": 32, "End": 35, "Home": 36, "ArrowLeft": 37, "ArrowRight": 39}.get(key, 0)
        typed = {"text": text} if text else {}
        common = {"key": key, "windowsVirtualKeyCode": code or ord(key.upper())}
        self._call("Input.dispatchKeyEvent", type="keyDown", **common, **typed)
        self._call("Input.dispatchKeyEvent", type="keyUp", **common)

    def point(self, x, y, *, click=False):
        """Move the pointer to a place of the window [px], and click there."""
        self._call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
        for kind in ("mousePressed", "mouseReleased") if click else ():
            self._call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def show_as(self, media):
        """Style the page for "screen" or "print"."""
        self._call("Emulation.setEmulatedMedia", media=media)

    def print(self):
        """Number of sheets of A4 that the page takes."""
        data = base64.b64decode(self._call("Page.printToPDF", paperWidth=8.27, paperHeight=11.69)["data"])
        return len(re.findall(rb"/Type\s*/Page\b", data))

    def requests_elsewhere(self):
        """Beginnings of the addresses that were asked for, data aside."""
        return [url for url in self.requests if not url.startswith("data:")]

    def close(self):
        """End the browser."""
        with contextlib.suppress(OSError, AssertionError):
            self._session = None
            self._call("Browser.close")
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._read)
        os.close(self._write)

    def __enter__(self):
        return self

    def __exit__(self, *error):
        self.close()

    def _call(self, method, **params):
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self._write, data) :]
        while True:
            told = self._message()
            if told.get("id") == self._number:
                assert "error" not in told, told["error"]
                return told["result"]
            self._note(told)

    def _message(self):
        while b"\0" not in self._buffer:
            assert select.select([self._read], [], [], 30)[0], "the browser is silent"
            chunk = os.read(self._read, 1 << 20)
            assert chunk, "the browser has ended"
            self._buffer += chunk
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)

    def _note(self, told):
        params = told.get("params", {})
        if told.get("method") in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled", "Log.entryAdded"):
            self.complaints.append(params)
        elif told.get("method") == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"][:100])


def _high(end):
    """The same end of a pipe under a number that no redirection of the shell takes away."""
    high = fcntl.fcntl(end, fcntl.F_DUPFD, 10)
    os.close(end)
    return high
