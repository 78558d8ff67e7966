"""The live page in Chromium: the figures of the command line, its fields, files and server."""

from __future__ import annotations

import shlex
import signal
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

import dogshape as ds
from dogshape.app.live_callbacks import build_app
from dogshape.app.live_page import LivePage, open_live_page
from dogshape.app.server import start_server
from tests.browser import FAULTS, Chromium
from tests.conftest import Call, set_options
from tests.server import command_of, start_command

#: A strike, a spectrum and a scatter of the dogs, at two operating points.
SETS = [
    "operating.mismatch_rpm=[50, 149]", "operating.force_N=[469.0]",
    "strike.ring_inertia_kgm2=0.0003", "strike.input_stiffness_Nm_rad=8000",
    "strike.mismatch_rpm=[100.0, -60.0]", "strike.backlash_deg=0.5",
    "expectation.angles=16",
    "load.accuracy=6", "load.run_out_um=10", "load.spectrum=[[1.0, 1e4], [-0.4, 1e5]]",
]  # fmt: skip
OPTIONS = set_options(SETS)
SIMULATED = "!['', '…'].includes(document.querySelector('#simulated b')?.textContent ?? '')"
FIELD = "document.querySelector('aside .number input')"


@pytest.fixture(scope="module")
def live_page() -> LivePage:
    """The paper's study with everything that is judged; few shifts make a time."""
    return open_live_page(ds.Study("mq200_paper", SETS))


@pytest.fixture(scope="module")
def page(live_page: LivePage, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Chromium]:
    """The page of the study in a browser."""
    server = start_server(live_page, 0)
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        with Chromium(tmp_path_factory.mktemp("profile")) as browser:
            browser.call("Page.enable")
            browser.call("Page.addScriptToEvaluateOnNewDocument", source=FAULTS)
            browser.call("Page.navigate", url=f"http://127.0.0.1:{server.port}/")
            browser.wait(SIMULATED, 120)
            yield browser
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


#: Texts of designs: at all points, at one, with other frictions, load, material, limits and
#: actuator, and one that is refused; each with the settings of the command line.
QUESTIONS: tuple[tuple[dict[str, str], list[str]], ...] = (
    (
        {"dog.chamfer_deg": "11,25 deg", "dog.count": "18"},
        ["dog.chamfer_deg=11.25", "dog.count=18"],
    ),
    (
        {"dog.height_mm": "3.1", "mismatch_rpm": "45", "force_N": "0.3 kN"},
        ["dog.height_mm=3.1"],
    ),
    (
        {"dog.traction_deg": "10", "load.friction_release": "0.13", "load.friction_hold": "0.02"},
        ["dog.traction_deg=10.0", "load.friction_release=0.13", "load.friction_hold=0.02"],
    ),
    (
        {"load.torque_Nm": "0,21 kN m", "material.set": "20MnCr5", "load.safety": "1,1"},
        ["load.torque_Nm=210.0", "load.safety=1.1", 'material.set="20MnCr5"'],
    ),
    ({"contact.static_friction": "0.15"}, ["contact.static_friction=0.15"]),
    (
        {"actuation.kind": "spring", "actuation.preload_N": "350", "dog.chamfer_deg": "10"},
        [
            "dog.chamfer_deg=10.0",
            'actuation.kind="spring"',
            "actuation.preload_N=350.0",
            "actuation.rate_N_mm=20.0",
            "operating.force_N=[350.0]",
        ],
    ),
    ({"load.friction_hold": "0.5"}, ["load.friction_hold=0.5"]),
)
ASKED_KEYS = {key for texts, _ in QUESTIONS for key in texts}
#: Texts of a question whose physics are not those of the surrogate.
BEYOND = ("contact.static_friction", "actuation.kind")


def _ask(page: Chromium, live_page: LivePage, texts: dict[str, str]) -> None:
    """Put texts into the fields, the others at their start."""
    place = "one" if "force_N" in texts else "all"
    page.ask(f"dash_clientside.set_props('where', {{value: '{place}'}})")
    for field in live_page.fields:
        if field.ends is None and field.key not in ASKED_KEYS:
            continue
        kind = "text" if field.ends is None else "field"
        name = f"{{number: '{field.key}', kind: '{kind}'}}"
        text = texts.get(field.key, field.text)
        page.ask(f"dash_clientside.set_props({name}, {{value: '{text}'}})")


def _options(texts: dict[str, str], settings: list[str]) -> list[str]:
    """Write a question as options of the command line."""
    place = ["--mismatch-rpm", "45", "--force-N", "300"] if "force_N" in texts else []
    return [*set_options(settings), *place]


def _exact(page: Chromium, selector: str) -> list[float]:
    """Read a time with its interval in full; empty without one."""
    text = page.ask(f"document.querySelector({selector!r})?.dataset.exact ?? ''")
    return [float(word) for word in text.split()]


def _seen(page: Chromium) -> dict[str, Any]:
    """Read times and margins of the page in full."""
    rows = page.ask(
        "[...document.querySelectorAll('[data-check]')]"
        ".map(row => [row.dataset.check, Number(row.dataset.margin)])"
    )
    times = {name: _exact(page, f"#{name} b") for name in ("predicted", "simulated")}
    return {**times, "margins": dict(rows)}


def _times(record: dict[str, Any] | None) -> list[float]:
    times = [(record or {}).get(key) for key in ("expected_shift_time_s", "low_s", "high_s")]
    return [time for time in times if time is not None]


def test_the_page_has_the_figures_of_the_command_line(
    page: Chromium, live_page: LivePage, dogshape: Call
) -> None:
    """A time beyond the surrogate is that of the button, and the own dog stands beside it."""
    compared = 0
    for texts, settings in QUESTIONS:
        options = _options(texts, settings)
        said = dogshape("check", "mq200_paper", *OPTIONS, *options, "--json")
        _ask(page, live_page, texts)
        if said.status == 2:
            sentence = said.sentence.removeprefix("dogshape: ")
            page.wait(f"document.body.textContent.includes({sentence!r})")
            assert page.ask("document.querySelectorAll('.number.wrong').length") == 2
            assert _seen(page)["predicted"] == _seen(page)["simulated"] == []
            continue
        words = shlex.join(["dogshape", "check", "mq200_paper", *options])
        found = "document.querySelector('#command').textContent"
        page.wait(f"{found}.split(' ').sort().join() === {sorted(words.split(' '))!r}.join()", 120)
        if set(texts) & set(BEYOND):
            page.wait("!document.querySelector('#simulate').hidden")
            assert _seen(page)["predicted"] == _seen(page)["simulated"] == []
            note = "document.querySelector('#predicted').textContent"
            assert "must be simulated" in page.ask(note)
            page.ask("document.querySelector('#simulate').click()")
            page.wait("document.querySelector('#simulate').hidden", 120)
        page.wait(f"{SIMULATED} && document.querySelector('#simulated b').dataset.exact", 120)
        seen, known = _seen(page), said.json
        assert seen["predicted"] == pytest.approx(_times(known["predicted"]), rel=1e-9)
        assert seen["simulated"] == pytest.approx(_times(known), rel=1e-9)
        margins = {check["name"]: check["margin"] for check in known["checks"]}
        assert seen["margins"] == pytest.approx(margins, rel=1e-9)
        compared += "edge_bedding_impact" in margins
        _compare_own_dog(page, dogshape, texts, settings)
    assert compared == 6
    assert page.ask("faults.join('; ')") == ""


def _compare_own_dog(
    page: Chromium, dogshape: Call, texts: dict[str, str], settings: list[str]
) -> None:
    """Compare the simulated time of the own dog with that of the command line."""
    own_settings = [setting for setting in settings if not setting.startswith("dog.")]
    row = "#beside tr.answer:nth-last-child(3) td"
    if own_settings == settings:
        assert page.ask(f"document.querySelectorAll({row!r}).length") == 2
        return
    page.wait(f"document.querySelector('{row}:nth-child(2)').dataset.exact", 120)
    said = dogshape("check", "mq200_paper", *OPTIONS, *_options(texts, own_settings), "--json")
    assert _exact(page, f"{row}:nth-child(2)") == pytest.approx(_times(said.json), rel=1e-9)


def test_print_begins_with_the_answers(page: Chromium, live_page: LivePage) -> None:
    """Headline, verdict, picture and numbers in this order; no sliders and no buttons."""
    _ask(page, live_page, {"dog.chamfer_deg": "11"})
    page.wait("document.querySelector('#command').textContent.endsWith('dog.chamfer_deg=11.0')")
    page.wait("document.querySelector('#headline').textContent.includes('simulated')", 120)
    page.call("Emulation.setEmulatedMedia", media="print")
    try:
        order = ["#headline", "#verdict", "#section", ".cards", "#beside", "#checks", "#command"]
        tops = page.ask(
            f"{order!r}.map(name => document.querySelector(name).getBoundingClientRect())"
            ".filter(box => box.height > 0).map(box => box.top)"
        )
        assert len(tops) == len(order)
        assert tops == sorted(tops)
        hidden = ["aside", "button", ".dash-slider-root", "#front", "#files"]
        heights = f"{hidden!r}.map(name => document.querySelector(name).offsetHeight ?? 0)"
        assert page.ask(heights) == [0] * len(hidden)
        assert page.ask("document.querySelector('#headline').textContent").startswith("Shift time ")
    finally:
        page.call("Emulation.setEmulatedMedia", media="")
    assert page.print_pdf().startswith(b"%PDF")


def test_fields_sliders_and_designs_move_together(page: Chromium, live_page: LivePage) -> None:
    _ask(page, live_page, {})
    page.wait("document.querySelector('#command').textContent === 'dogshape check mq200_paper'")
    page.ask(f"{FIELD}.focus(); {FIELD}.select()")
    page.call("Input.insertText", text="abc")
    page.wait("document.querySelector('.number.wrong p').textContent === \"'abc' is no number\"")
    assert page.ask("document.querySelector('#answer').className") == "stale"
    thumb = "document.querySelector('.dash-slider-thumb')"
    box = f"{thumb}.getBoundingClientRect()"
    x, y = page.ask(f"(() => {{ const box = {box}; return [box.x + 8, box.y + 8]; }})()")
    mouse = {"y": y, "button": "left", "clickCount": 1}
    page.call("Input.dispatchMouseEvent", type="mousePressed", x=x, buttons=1, **mouse)
    page.call("Input.dispatchMouseEvent", type="mouseMoved", x=x + 40, buttons=1, **mouse)
    page.wait(f"Number({thumb}.ariaValueNow) > 9")
    page.call("Input.dispatchMouseEvent", type="mouseReleased", x=x + 40, **mouse)
    page.wait(f"Number({FIELD}.value) > 9")
    page.wait("document.querySelector('#answer').className === ''")
    trial, design = next(iter(live_page.searched_designs.items()))
    page.ask(
        f"dash_clientside.set_props('front', {{clickData: {{points: [{{customdata: {trial}}}]}}}})"
    )
    chamfer = f"{design.value('chamfer_deg'):.6g}"
    page.wait(f"{FIELD}.value === '{chamfer}'")
    assert page.ask("document.documentElement.scrollWidth <= window.innerWidth")
    loads = "performance.getEntriesByType('resource').map(one => new URL(one.name).hostname)"
    assert set(page.ask(loads)) <= {"127.0.0.1", ""}
    assert page.ask("faults.join('; ')") == ""


def test_files_of_a_design_are_written(live_page: LivePage) -> None:
    client = build_app(live_page).server.test_client()
    texts = live_page.start_texts() | {"dog.chamfer_deg": "11"}
    for name, part in {
        "shift.html": b"<canvas", "dog.svg": b"chamfer \xce\xb1 11.00", "sheet.html": b"a reason",
        "rings.step": b"ISO-10303-21", "study.toml": b"chamfer_deg = 11.0",
    }.items():  # fmt: skip
        found = client.get(f"/file/{name}", query_string=texts | {"why": "a reason"})
        assert found.status_code == 200, found.text
        assert part in found.data
    wrong = client.get("/file/dog.svg", query_string=texts | {"dog.height_mm": "0"})
    assert (wrong.status_code, "dog.height_mm" in wrong.text) == (400, True)
    assert client.get("/file/other").status_code == 404
    assert client.get("/", headers={"Host": "elsewhere.example"}).status_code == 400


def test_the_verb_serves_until_it_is_stopped(dogshape: Call, tmp_path: Path) -> None:
    with start_command(
        command_of("app", "mq200_paper", "--no-browser", "--port", "0"), tmp_path
    ) as process:
        try:
            assert process.stderr is not None
            address = process.stderr.readline().split()[0]
            port = int(address.removeprefix("http://127.0.0.1:").strip("/"))
            said = dogshape("app", "mq200_paper", "--no-browser", "--port", port)
            taken = f"port {port} cannot be taken (Address already in use)"
            assert (said.status, said.sentence) == (
                2, f"dogshape: {taken}; give another with --port"
            )  # fmt: skip
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 130
        assert process.stderr.read() == "dogshape: stopped\n"
