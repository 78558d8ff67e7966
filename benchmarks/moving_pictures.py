"""Draw the moving pictures of README.md: one shift, and the live page while a dog is changed.

    python -m benchmarks.moving_pictures docs

Writes ``shift.webp`` and ``live.webp``, with the still picture ``shift.png``; it needs Chromium and
Pillow.
"""

from __future__ import annotations

import base64
import io
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

import numpy as np
from PIL import Image

import dogshape as ds
from dogshape.app.live_page import open_live_page
from dogshape.app.server import start_server
from tests.browser import WITH_WEBGL, Chromium

#: The shift of the moving picture, with the prototype of the study.
SHIFT_STUDY = "mq200_paper"
SHIFT = {"mismatch_rpm": 50, "force_N": 469, "angle_deg": 10}
#: The design whose page README.md shows.
README_STUDY = "mq200"
README_DESIGN = {
    "count": 27,
    "chamfer_deg": 12.5,
    "traction_deg": 20,
    "braking_deg": 22,
    "height_mm": 2.6,
}
LIVE_STUDY = "mq200_paper"
#: Sliders that move one after the other, from the prototype to the best dog of the study.
LIVE_CHANGES = (
    ("dog.height_mm", 3.563),
    ("dog.count", 20),
    ("dog.traction_deg", 6.92),
    ("dog.braking_deg", 19.45),
    ("dog.count", 29),
    ("dog.chamfer_deg", 12.0),
    ("dog.chamfer_deg", 17.36),
)
README_SHARE = 0.75  #: of the shift time, in the still picture
SHIFT_FRAMES = 32
FRAME_MS = 110
PREDICTED_MS = 700  #: of a frame of the live page before its simulation
SIMULATED_MS = 1000  #: of a frame of the live page after its simulation
LAST_MS = 2500
MAX_BYTES = 400_000
QUALITIES = (70, 60, 50, 40, 30)  #: of lossy WebP, best first
SHIFT_WINDOW = (1260, 830)
MOVING_HEIGHT = 586  #: of the moving picture, down to the curve of the displacement, px of the page
LIVE_WINDOW = (1180, 740)
SCALE = 0.66  #: px of a picture over px of its page
SIMULATED = "!['', '…'].includes(document.querySelector('#simulated b')?.textContent ?? '')"


@dataclass(frozen=True)
class Frame:
    """A picture and how long it stands, ms."""

    picture: Image.Image
    duration: int


@contextmanager
def open_browser(window: tuple[int, int]) -> Iterator[Chromium]:
    """Open a browser whose window has the size ``window``, px."""
    size = f"{window[0]},{window[1]}"
    with tempfile.TemporaryDirectory() as profile, Chromium(Path(profile), size, WITH_WEBGL) as it:
        it.call("Page.enable")
        metrics = {"width": window[0], "height": window[1], "mobile": False}
        it.call("Emulation.setDeviceMetricsOverride", deviceScaleFactor=SCALE, **metrics)
        yield it


def photograph(browser: Chromium, size: tuple[int, int]) -> Image.Image:
    """Take a picture of the page that is open, from its corner to the size, px."""
    clip = {"x": 0, "y": 0, "width": size[0], "height": size[1], "scale": 1}
    shot = browser.call("Page.captureScreenshot", format="png", clip=clip)
    return Image.open(io.BytesIO(base64.b64decode(shot["data"]))).convert("RGB")


def shift_frames(study: ds.Study, height: int, shares: Iterable[float]) -> list[Frame]:
    """Photograph the page of the shift down to a height, px, at shares of its time."""
    frames = []
    with tempfile.TemporaryDirectory() as folder, open_browser(SHIFT_WINDOW) as browser:
        page = Path(folder) / "shift.html"
        size = (SHIFT_WINDOW[0], height)
        study.shift(**SHIFT).report(page)
        browser.call("Page.navigate", url=page.as_uri())
        browser.wait("document.readyState === 'complete' && document.querySelector('.trace')")
        for share in shares:
            browser.ask(
                "(() => { const bar = document.getElementById('scrub');"
                f" bar.value = {share} * bar.max; bar.oninput(); }})()"
            )
            browser.call(
                "Runtime.evaluate",
                expression="new Promise(done => setTimeout(done, 150))",
                awaitPromise=True,
            )
            frames.append(Frame(photograph(browser, size), FRAME_MS))
    frames[-1] = Frame(frames[-1].picture, LAST_MS)
    return frames


def live_frames() -> list[Frame]:
    """Photograph the live page while the sliders of a dog move."""
    server = start_server(open_live_page(ds.Study(LIVE_STUDY)), port=0)
    thread = Thread(target=server.serve_forever)
    thread.start()
    frames = []
    try:
        with open_browser(LIVE_WINDOW) as browser:
            browser.call("Page.navigate", url=f"http://127.0.0.1:{server.port}/")
            browser.wait(SIMULATED, 120)
            frames.append(Frame(photograph(browser, LIVE_WINDOW), SIMULATED_MS))
            for key, value in LIVE_CHANGES:
                _move_slider(browser, key, value)
                frames.append(Frame(photograph(browser, LIVE_WINDOW), PREDICTED_MS))
                browser.wait(SIMULATED, 120)
                frames.append(Frame(photograph(browser, LIVE_WINDOW), SIMULATED_MS))
    finally:
        server.shutdown()
        thread.join()
        server.server_close()
    frames[-1] = Frame(frames[-1].picture, LAST_MS)
    return frames


def _move_slider(browser: Chromium, key: str, value: float) -> None:
    """Set a slider of the live page and wait for the prediction."""
    time = "document.querySelector('#predicted b')?.dataset.exact"
    earlier_time = browser.ask(time)
    slider = f"{{number: '{key}', kind: 'slider'}}"
    browser.ask(f"dash_clientside.set_props({slider}, {{value: {value}}})")
    browser.wait(f"({time} ?? '{earlier_time}') !== '{earlier_time}'", 60)


def write_webp(frames: Sequence[Frame], path: Path) -> None:
    """Write frames as a moving picture that repeats, in the best quality within ``MAX_BYTES``.

    Raises
    ------
    ValueError : the file is larger in every quality.
    """
    first, *others = frames
    for quality in QUALITIES:
        first.picture.save(
            path,
            save_all=True,
            append_images=[frame.picture for frame in others],
            duration=[frame.duration for frame in frames],
            loop=0,
            quality=quality,
            method=4,
        )
        size = path.stat().st_size
        if size <= MAX_BYTES:
            return
    raise ValueError(f"{path} has {size} bytes, more than {MAX_BYTES}; take fewer frames")


def main(folder: Path) -> None:
    """Write the pictures into a folder."""
    design = ds.Study(README_STUDY, **README_DESIGN)
    (still,) = shift_frames(design, SHIFT_WINDOW[1], [README_SHARE])
    still.picture.save(folder / "shift.png", optimize=True)
    shares = np.linspace(0.0, 1.0, SHIFT_FRAMES)
    frames = shift_frames(ds.Study(SHIFT_STUDY), MOVING_HEIGHT, shares)
    write_webp(frames, folder / "shift.webp")
    write_webp(live_frames(), folder / "live.webp")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
