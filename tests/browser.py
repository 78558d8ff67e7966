"""Opening a page in headless Chromium, and asking it what it shows."""

from __future__ import annotations

import html
import re
import shutil
import subprocess
from pathlib import Path

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
