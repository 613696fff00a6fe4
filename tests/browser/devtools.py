"""As much of a browser as the tests need: Chromium without a window, driven by its DevTools protocol."""

import asyncio
import base64
import contextlib
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

import websockets

NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome"]


def installed():
    """The path of a browser, or None. `BIKEBOT_BROWSER` names another."""
    own = os.environ.get("BIKEBOT_BROWSER")
    return own or next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One page of a browser. Everything it complains of or asks for is kept in `events`."""

    def __init__(self, program):
        self.program = program
        self.events = []
        self.waiting = {}
        self.last = 0
        self.session = None

    async def __aenter__(self):
        self.folder = tempfile.mkdtemp(prefix="bikebot-browser-")
        self.process = subprocess.Popen(
            [self.program, "--headless=new", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run",
             "--disable-background-networking", "--remote-debugging-port=0", f"--user-data-dir={self.folder}", "about:blank"],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        # It writes its port there once it listens.
        note = pathlib.Path(self.folder, "DevToolsActivePort")
        for _ in range(600):
            if note.exists() and len(note.read_text().split("\n")) >= 2:
                break
            if self.process.poll() is not None:
                raise RuntimeError(f"{self.program} ended with {self.process.returncode}")
            await asyncio.sleep(0.1)
        port, path = note.read_text().split("\n")[:2]
        self.socket = await websockets.connect(f"ws://127.0.0.1:{port}{path}", max_size=None)
        self.reader = asyncio.create_task(self._read())
        target = await self.call("Target.createTarget", url="about:blank")
        attached = await self.call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self.session = attached["sessionId"]
        for domain in ["Page", "Runtime", "Network", "Log"]:
            await self.call(f"{domain}.enable")
        return self

    async def __aexit__(self, *_):
        self.reader.cancel()
        with contextlib.suppress(Exception):
            await self.socket.close()
        self.process.terminate()
        self.process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)

    async def _read(self):
        async for text in self.socket:
            message = json.loads(text)
            if "id" in message:
                self.waiting.pop(message["id"]).set_result(message)
            else:
                self.events.append(message)

    async def call(self, method, **parameters):
        self.last += 1
        answer = asyncio.get_running_loop().create_future()
        self.waiting[self.last] = answer
        message = {"id": self.last, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        await self.socket.send(json.dumps(message))
        answer = await asyncio.wait_for(answer, 60)
        if "error" in answer:
            raise RuntimeError(f"{method}: {answer['error']}")
        return answer["result"]

    async def run(self, script):
        """The value of an expression in the page."""
        answer = await self.call("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in answer:
            raise RuntimeError(f"{script}: {answer['exceptionDetails']}")
        return answer["result"].get("value")

    async def open(self, path, width=1280, height=900, scheme="light", ready="!!window.bikebot"):
        """Opens a file, and waits until its script has drawn it."""
        await self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                        mobile=width < 600)
        await self.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        await self.call("Page.navigate", url="about:blank")
        self.events.clear()
        await self.call("Page.navigate", url=pathlib.Path(path).absolute().as_uri())
        for _ in range(400):
            if await self.run(f"document.readyState === 'complete' && {ready}"):
                break
            await asyncio.sleep(0.05)
        await self.settle()

    async def settle(self):
        """Two frames later."""
        await self.run("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")

    async def mouse(self, kind, x, y):
        pressed = {"mousePressed": {"button": "left", "clickCount": 1, "buttons": 1},
                   "mouseReleased": {"button": "left", "clickCount": 1}}
        await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **pressed.get(kind, {}))

    async def click(self, x, y):
        for kind in ["mouseMoved", "mousePressed", "mouseReleased"]:
            await self.mouse(kind, x, y)
        await self.settle()

    async def key(self, key, code=None, text=None):
        for kind in ["keyDown", "keyUp"]:
            more = {"text": text} if text and kind == "keyDown" else {}
            await self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code or key, **more)
        await self.settle()

    async def box(self, selector):
        """Left, top, width and height of an element, brought into view."""
        await self.run(f"document.querySelector({selector!r}).scrollIntoView({{block: 'center', behavior: 'instant'}})")
        await self.settle()
        return await self.run(
            f"(() => {{ const b = document.querySelector({selector!r}).getBoundingClientRect();"
            " return [b.left, b.top, b.width, b.height]; })()")

    def complaints(self):
        """What went wrong in the page."""
        said = []
        for event in self.events:
            method, data = event["method"], event["params"]
            if method in ("Runtime.exceptionThrown", "Log.entryAdded"):
                said.append(json.dumps(data)[:400])
            if method == "Runtime.consoleAPICalled" and data["type"] in ("error", "warning", "assert"):
                said.append(json.dumps(data)[:400])
        return said

    def requests(self):
        """What the page asked for, but for itself and what it carries."""
        urls = [event["params"]["request"]["url"] for event in self.events if event["method"] == "Network.requestWillBeSent"]
        return [url for url in urls[1:] if not url.startswith("data:")]

    async def picture(self, path, height=None, width=None):
        if height:
            await self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
            await self.settle()
        shot = await self.call("Page.captureScreenshot", format="png")
        pathlib.Path(path).write_bytes(base64.b64decode(shot["data"]))
