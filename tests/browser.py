"""Opening a page in headless Chromium, and asking it what it shows."""

from __future__ import annotations

import html
import json
import os
import re
import shlex
import shutil
import subprocess
import time
from pathlib import Path
from typing import Any

from tests.conftest import needed

CHROMIUM = shutil.which("chromium")

#: Put into a page: its errors, its loads, its overflow and what its figures drew.
PROBE = """
<script>
const said = document.body.dataset;
window.addEventListener("error", e => said.error = e.message);
console.error = (...words) => said.error = words.join(" ");
window.addEventListener("load", () => setTimeout(() => {
  const figures = [...document.querySelectorAll(".js-plotly-plot")];
  said.figures = figures.length;
  said.drawn = figures.filter(f => f.querySelector(".trace, .hm")).length;
  said.wide = document.documentElement.scrollWidth > window.innerWidth;
  said.high = document.documentElement.scrollHeight > window.innerHeight;
  const loads = performance.getEntriesByType("resource").map(r => r.name);
  said.loads = loads.filter(name => name.startsWith("http")).length;
  if (window.probe) probe(said);
}, 800));
</script>
"""

#: Put into a report: words that its figures cut off, on the screen and as on paper, and its table.
REPORT_PROBE = """
<script>
function cut() {
  const found = [];
  for (const figure of document.querySelectorAll(".js-plotly-plot")) {
    const frame = figure.querySelector(".main-svg").getBoundingClientRect();
    for (const text of figure.querySelectorAll("text")) {
      const box = text.getBoundingClientRect();
      if (box.width && (box.left < frame.left - 2 || box.right > frame.right + 2
          || box.top < frame.top - 2 || box.bottom > frame.bottom + 2))
        found.push(figure.id + ": " + text.textContent);
    }
  }
  return found;
}
function probe(said) {
  said.ids = [...document.querySelectorAll(".js-plotly-plot")].map(f => f.id).join(" ");
  said.cut = JSON.stringify(cut());
  said.csv = document.querySelector('a[download$=".csv"]')?.href ?? "";
  const links = [...document.querySelectorAll('a[href^="shifts/"]')];
  said.links = JSON.stringify(links.map(link => link.getAttribute("href")));
  fit(true);
  setTimeout(() => {
    said.paper = JSON.stringify(cut());
    said.widths = [...document.querySelectorAll(".js-plotly-plot")]
      .map(f => f.querySelector(".main-svg").getBoundingClientRect().width).join(" ");
  }, 500);
}
</script>
"""

#: Drawn in software with and without WebGL.
WITH_WEBGL = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader")
WITHOUT_WEBGL = ("--disable-3d-apis",)


def print_pdf(page: Path, tmp_path: Path) -> bytes:
    """Print a page as PDF without a screen and return the file."""
    needed(CHROMIUM is not None, "chromium")
    assert CHROMIUM is not None
    path = tmp_path / "printed.pdf"
    command = [
        CHROMIUM, "--headless", "--no-sandbox", *WITHOUT_WEBGL, "--no-first-run",
        "--disable-background-networking", f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=6000", "--no-pdf-header-footer", f"--print-to-pdf={path}",
        page.as_uri(),
    ]  # fmt: skip
    subprocess.run(command, capture_output=True, timeout=120, check=True)
    return path.read_bytes()


def look(
    page: Path,
    tmp_path: Path,
    probe: str = PROBE,
    graphics: tuple[str, ...] = WITHOUT_WEBGL,
    window: str = "1150,900",
) -> dict[str, str]:
    """Open a page without a network and return what the probe found."""
    needed(CHROMIUM is not None, "chromium")
    assert CHROMIUM is not None
    probed = tmp_path / "probed.html"
    probed.write_text(page.read_text().replace("<body>", f"<body>{probe}", 1))
    command = [
        CHROMIUM, "--headless", "--no-sandbox", *graphics, "--disable-quic",
        "--no-first-run", "--disable-background-networking", "--disable-component-update",
        "--disable-sync", f"--user-data-dir={tmp_path / 'profile'}", f"--window-size={window}",
        "--hide-scrollbars", "--virtual-time-budget=6000", "--dump-dom", probed.as_uri(),
    ]  # fmt: skip
    dom = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout
    body = re.search(r"<body([^>]*)>", dom)
    assert body is not None
    found = dict(re.findall(r'data-(\w+)="([^"]*)"', body.group(1)))
    return {key: html.unescape(value) for key, value in found.items()} | {"dom": dom}


class Chromium:
    """A browser that a test drives over its debugging pipe; use it as a context."""

    def __init__(self, profile: Path, window: str = "1280,1000") -> None:
        needed(CHROMIUM is not None, "chromium")
        ours, theirs = os.pipe(), os.pipe()
        command = shlex.join([
            CHROMIUM or "", "--headless", "--no-sandbox", *WITHOUT_WEBGL, "--no-first-run",
            "--disable-background-networking", f"--user-data-dir={profile}",
            f"--window-size={window}", "--hide-scrollbars", "--remote-debugging-pipe",
        ])  # fmt: skip
        # Chromium reads descriptor 3 and writes 4.
        shell = f"exec {command} 3<&{ours[0]} 4>&{theirs[1]}"
        self._process = subprocess.Popen(
            ["bash", "-c", shell], pass_fds=(ours[0], theirs[1]), stderr=subprocess.DEVNULL
        )
        os.close(ours[0])
        os.close(theirs[1])
        self._to, self._from = os.fdopen(ours[1], "wb"), os.fdopen(theirs[0], "rb")
        self._count, self._session, self._left = 0, {}, b""
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        found = self.call("Target.attachToTarget", targetId=target, flatten=True)
        self._session = {"sessionId": found["sessionId"]}

    def call(self, method: str, **arguments: Any) -> Any:
        """Call a method of the protocol; give its result."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": arguments, **self._session}
        self._to.write(json.dumps(message).encode() + b"\0")
        self._to.flush()
        while True:
            while b"\0" not in self._left:
                if not (more := self._from.read1(65536)):
                    raise RuntimeError("Chromium has ended")
                self._left += more
            text, _, self._left = self._left.partition(b"\0")
            answer = json.loads(text)
            if answer.get("id") == self._count:
                return answer["result"]

    def ask(self, expression: str) -> Any:
        """Evaluate an expression of the page."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True)
        return found["result"].get("value")

    def wait(self, expression: str, seconds: float = 60.0) -> None:
        """Wait until an expression of the page is true."""
        end = time.monotonic() + seconds
        while not self.ask(f"Boolean({expression})"):
            assert time.monotonic() < end, f"{expression} is not true in {seconds} s"
            time.sleep(0.05)

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *_: object) -> None:
        self._to.close()
        self._from.close()
        self._process.terminate()
        self._process.wait(timeout=30)
