"""Headless Chromium over its debugging pipe: content and print of a page."""

from __future__ import annotations

import base64
import json
import os
import shlex
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

from tests.conftest import require_program

CHROMIUM = shutil.which("chromium")
#: Drawn in software with and without WebGL.
WITH_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WITHOUT_WEBGL = ("--disable-3d-apis",)

#: Before a page: its errors are kept.
FAULTS = """
window.faults = [];
addEventListener("error", event => faults.push(event.message));
console.error = (...words) => faults.push(words.join(" "));
"""
#: What a page shows: errors, loads, overflow, figures, and words and curves that those cut off.
STATE = """(() => {
  const figures = [...document.querySelectorAll(".js-plotly-plot")], cut = [];
  for (const figure of figures) {
    const frame = figure.querySelector(".main-svg").getBoundingClientRect();
    for (const text of figure.querySelectorAll("text")) {
      const box = text.getBoundingClientRect();
      if (box.width && (box.left < frame.left - 2 || box.right > frame.right + 2
          || box.top < frame.top - 2 || box.bottom > frame.bottom + 2))
        cut.push(figure.id + ": " + text.textContent);
    }
    for (const {plot, xaxis, yaxis} of Object.values(figure._fullLayout._plots))
      for (const mark of plot.node().querySelectorAll(".errorbar path, .js-line")) {
        const box = mark.getBoundingClientRect();
        const left = frame.left + xaxis._offset, top = frame.top + yaxis._offset;
        if (box.left < left - 2 || box.right > left + xaxis._length + 2
            || box.top < top - 2 || box.bottom > top + yaxis._length + 2)
          cut.push(figure.id + ": " + mark.getAttribute("class"));
      }
  }
  const root = document.documentElement;
  return {
    faults, cut, figures: figures.map(f => f.id),
    drawn: figures.filter(f => f.querySelector(".trace, .hm")).map(f => f.id),
    widths: figures.map(f => f.querySelector(".main-svg").getBoundingClientRect().width),
    wide: root.scrollWidth > innerWidth, high: root.scrollHeight > innerHeight,
    loads: performance.getEntriesByType("resource").filter(r => r.name.startsWith("http")).length,
  };
})()"""


class Chromium:
    """A browser without a network; use it as a context."""

    def __init__(
        self, profile: Path, window: str = "1280,1000", graphics: tuple[str, ...] = WITHOUT_WEBGL
    ) -> None:
        require_program(CHROMIUM is not None, "chromium")
        input_pipe = os.pipe()
        output_pipe = os.pipe()
        command = shlex.join(
            [
                CHROMIUM or "",
                "--headless",
                "--no-sandbox",
                *graphics,
                "--no-first-run",
                "--disable-background-networking",
                f"--user-data-dir={profile}",
                f"--window-size={window}",
                "--hide-scrollbars",
                "--remote-debugging-pipe",
            ]
        )
        # Chromium reads descriptor 3 and writes 4.
        shell = f"exec {command} 3<&{input_pipe[0]} 4>&{output_pipe[1]}"
        self._process = subprocess.Popen(
            ["bash", "-c", shell],
            pass_fds=(input_pipe[0], output_pipe[1]),
            stderr=subprocess.DEVNULL,
        )
        os.close(input_pipe[0])
        os.close(output_pipe[1])
        self._to = os.fdopen(input_pipe[1], "wb")
        self._from = os.fdopen(output_pipe[0], "rb")
        self._count = 0
        self._session = {}
        self._buffer = b""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        attached = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = {"sessionId": attached["sessionId"]}

    def call(self, method: str, **arguments: Any) -> Any:
        """Call a method of the protocol; return its result."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": arguments, **self._session}
        self._to.write(json.dumps(message).encode() + b"\0")
        self._to.flush()
        while True:
            while b"\0" not in self._buffer:
                data = self._from.read1(65536)
                if not data:
                    raise RuntimeError("Chromium has ended")
                self._buffer += data
            text, _, self._buffer = self._buffer.partition(b"\0")
            answer = json.loads(text)
            if answer.get("id") == self._count:
                return answer["result"]

    def ask(self, expression: str) -> Any:
        """Evaluate an expression of the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return answer["result"].get("value")

    def wait(self, expression: str, seconds: float = 60.0) -> None:
        """Wait until an expression of the page is true."""
        end = time.monotonic() + seconds
        while not self.ask(f"Boolean({expression})"):
            assert time.monotonic() < end, f"{expression} is not true in {seconds} s"
            time.sleep(0.05)

    def look(self, page: Path) -> dict[str, Any]:
        """Open a file; return its ``STATE`` once its figures are drawn."""
        self.call("Page.enable")
        self.call("Page.addScriptToEvaluateOnNewDocument", source=FAULTS)
        self.call("Page.navigate", url=page.as_uri())
        self.wait(f"location.href === '{page.as_uri()}' && document.readyState === 'complete'")
        drawn = "document.documentElement.dataset.state === 'drawn'"
        self.wait(f"!document.querySelector('script[type=module]') || {drawn}")
        return dict(self.ask(STATE))

    def look_at_report(self, page: Path) -> None:
        """Open a report; its figures must draw and fit, on the screen and as wide as A4."""
        for paper in ("false", "true"):
            state = self.look(page) if paper == "false" else self.ask(f"fit({paper}) ?? {STATE}")
            assert (state["faults"], state["cut"], state["loads"]) == ([], [], 0)
            assert state["figures"] == state["drawn"]
            assert not state["wide"]
        # A4 less its margins of 12 mm is 703 px wide.
        assert set(state["widths"]) == {700.0}

    def print_pdf(self) -> bytes:
        """Print the page that is open."""
        printed = self.call("Page.printToPDF", preferCSSPageSize=True, printBackground=True)
        return base64.b64decode(printed["data"])

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *_: object) -> None:
        self._to.close()
        self._from.close()
        self._process.terminate()
        self._process.wait(timeout=30)
