"""A page in headless Chromium, driven over its own protocol."""

import asyncio
import contextlib
import json
import shutil
import subprocess
import tempfile
import urllib.request

from tornado.websocket import websocket_connect

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
PATIENCE = 30.0  # s, for a machine with other work


class Browser:
    """One tab: evaluates expressions, clicks, and keeps what the page complains about."""

    def __init__(self, connection):
        self.connection = connection
        self.number = 0
        self.complaints: list[str] = []
        self.requests: list[str] = []

    async def call(self, method, **parameters):
        """The answer to a command; events on the way are kept."""
        self.number += 1
        number = self.number
        message = {"id": number, "method": method, "params": parameters}
        await self.connection.write_message(json.dumps(message))
        while True:
            text = await asyncio.wait_for(self.connection.read_message(), PATIENCE)
            answer = json.loads(text)
            if answer.get("id") == number:
                assert "error" not in answer, answer
                return answer["result"]
            self._hear(answer.get("method"), answer.get("params", {}))

    def _hear(self, method, parameters):
        if method == "Runtime.exceptionThrown":
            details = parameters["exceptionDetails"]
            self.complaints.append(str(details.get("exception", details).get("description", details)))
        if method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "assert"):
            self.complaints.append(str([a.get("value", a) for a in parameters["args"]]))
        if method == "Log.entryAdded" and parameters["entry"]["level"] == "error":
            self.complaints.append(str(parameters["entry"]))
        if method == "Network.requestWillBeSent":
            self.requests.append(parameters["request"]["url"])

    async def close(self):
        """End the connection; its answer is waited for, or it would count as left open."""
        self.connection.close()
        while await asyncio.wait_for(self.connection.read_message(), PATIENCE) is not None:
            pass

    async def evaluate(self, expression):
        """Value of a JavaScript expression."""
        answer = await self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    async def until(self, expression):
        """Wait until an expression is true."""
        for _ in range(int(PATIENCE / 0.1)):
            if await self.evaluate(expression):
                return
            await asyncio.sleep(0.1)
        raise TimeoutError(f"never true: {expression}; {self.complaints}")

    async def drag(self, begin, end):
        """Press the left button at a place of the window [px], move, and release it at another."""
        held = {"button": "left", "clickCount": 1}
        half = [(a + b) / 2 for a, b in zip(begin, end, strict=True)]
        for kind, (x, y), button in (
            ("mouseMoved", begin, {}),
            ("mousePressed", begin, held),
            ("mouseMoved", half, {"button": "left", "buttons": 1}),
            ("mouseMoved", end, {"button": "left", "buttons": 1}),
            ("mouseReleased", end, held),
        ):
            if begin != end or kind != "mouseMoved" or not button:
                await self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, **button)

    async def click(self, at):
        """Press and release the left button at a place of the window [px]."""
        await self.drag(at, at)


def connected(port):
    """Address of the only tab."""
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/json/list", timeout=PATIENCE) as answer:
        (tab,) = [tab for tab in json.load(answer) if tab["type"] == "page"]
    return tab["webSocketDebuggerUrl"]


@contextlib.asynccontextmanager
async def open_page(url):
    """The page at `url` in a browser of its own, which is ended with the block."""
    assert PROGRAM is not None
    with tempfile.TemporaryDirectory() as profile:
        process = await asyncio.create_subprocess_exec(
            PROGRAM, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0",
            "--disable-background-networking", "--window-size=1300,1000", f"--user-data-dir={profile}",
            "about:blank", stderr=subprocess.PIPE, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        try:
            port = None
            while port is None:
                line = (await asyncio.wait_for(process.stderr.readline(), PATIENCE)).decode()
                assert line, "Chromium ended"
                if "DevTools listening on ws://" in line:
                    port = int(line.split("://")[1].split("/")[0].rsplit(":", 1)[1])
            address = await asyncio.to_thread(connected, port)
            browser = Browser(await websocket_connect(address, max_message_size=2**28))
            try:
                for domain in ("Runtime", "Log", "Network", "Page"):
                    await browser.call(f"{domain}.enable")
                await browser.call("Page.navigate", url=url)
                yield browser
            finally:
                await browser.close()
        finally:
            if process.returncode is None:
                process.terminate()
            await process.wait()
