"""A study begun on the page of ``dogshape app``, through HTTP, and its live page."""

from __future__ import annotations

import json
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from dogshape.app.questions_page import PATH, NewStudy
from dogshape.app.server import start_server
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.drafts.questionnaire import read_questionnaire
from tests.conftest import Call

#: Texts of a data sheet, and the same as settings of the command line.
TEXTS = {"dog.traction_deg": "20 deg", "dog.braking_deg": "-3°", "dog.height_mm": "5,5"}
SETTINGS = ["dog.traction_deg=20.0", "dog.braking_deg=-3.0", "dog.height_mm=5.5"]


@pytest.fixture
def address(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Address of the page of a new study, which writes into a temporary folder."""
    monkeypatch.chdir(tmp_path)
    server = start_server(NewStudy(), 0)
    thread = Thread(target=server.serve_forever)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.port}"
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


def _get(url: str) -> Any:
    with urllib.request.urlopen(url, timeout=300) as answer:
        return json.loads(answer.read())


def _send(url: str, body: Any) -> Any:
    data = json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"Content-Type": "application/json"})
    with urllib.request.urlopen(request, timeout=300) as answer:
        return json.loads(answer.read() or b'{"response": {}}')


def _places(texts: dict[str, str], origin: str, folder: str) -> list[Any]:
    """List the fields of the page with their contents, as a browser sends them."""
    keys = read_questionnaire(origin, texts).questions
    answers = [
        {"id": {"answer": key}, "property": "value", "value": texts.get(key, "")} for key in keys
    ]
    return [
        {"id": "kind", "property": "value", "value": origin},
        {"id": "folder", "property": "value", "value": folder},
        answers,
    ]


def _call(
    address: str, texts: dict[str, str], *, folder: str, write: bool, shown: str = "amt"
) -> dict[str, Any]:
    """Answer the questions for ``amt``, or press the button; return changes of the page by place.

    The page has the questions of the kind ``shown``.
    """
    trigger = "write" if write else "kind"
    callback = next(
        callback
        for callback in _get(f"{address}{PATH}_dash-dependencies")
        if callback["inputs"][0]["id"] == trigger
    )
    places = _places(texts, shown, folder)
    places[0]["value"] = "amt"
    outputs = callback["output"].strip(".").split("...")
    button = [{"id": "write", "property": "n_clicks", "value": 1}]
    body = {
        "output": callback["output"],
        "outputs": [_output(place, places[2]) for place in outputs],
        "inputs": button if write else places,
        "state": places if write else [],
        "changedPropIds": ["write.n_clicks" if write else "kind.value"],
    }
    changes: dict[str, Any] = _send(f"{address}{PATH}_dash-update-component", body)["response"]
    return changes


def _output(place: str, answers: list[dict[str, Any]]) -> Any:
    """Name an output of a callback: one component, or a component of each question."""
    name, _, part = place.rpartition(".")
    if not name.startswith("{"):
        return {"id": name, "property": part}
    kind = next(iter(json.loads(name)))
    return [{"id": {kind: answer["id"]["answer"]}, "property": part} for answer in answers]


def test_a_data_sheet_becomes_a_study_and_its_live_page(address: str, dogshape: Call) -> None:
    assert _address(address) == f"{address}{PATH}"
    assert "symbols" in json.dumps(_get(f"{address}{PATH}_dash-layout")).lower()
    # Another kind has other questions.
    changes = _call(address, {}, folder="mine", write=False, shown="mq200")
    assert "manufacturing.rim_mm" in json.dumps(changes["questions"]["children"])
    # Every wrong answer is marked, and nothing is written.
    wrong = TEXTS | {"dog.count": "0", "load.torque_Nm": "3,200"}
    changes = _call(address, wrong, folder="mine", write=False)
    faults = {key: part["children"] for key, part in changes.items() if '"fault"' in key}
    marked = {json.loads(key)["fault"] for key, sentence in faults.items() if sentence}
    assert marked == {"dog.count", "load.torque_Nm"}
    assert changes["state"]["children"] == "2 answers are wrong"
    assert _call(address, wrong, folder="mine", write=True) == {}
    assert not Path("mine").exists()
    # Another folder than one in that of the program is refused.
    changes = _call(address, TEXTS, folder="../mine", write=True)
    assert changes["folder-fault"]["children"].startswith("the folder is '../mine', but")
    assert _call(address, TEXTS, folder="mine", write=True)["written"]["data"] == "mine"
    # The same study as by the command line.
    options = [word for setting in SETTINGS for word in ("--set", setting)]
    said = dogshape("init", "study", "--out", "typed", "--like", "amt", "--yes", *options)
    assert said.status == 0, said.err
    assert load_study("mine").physics_hash == load_study("typed").physics_hash
    # The address is that of its live page now.
    page = json.dumps(_get(f"{address}/_dash-layout"))
    assert '"mine: live"' in page
    assert "mine/study.toml is written from the study 'amt'" in page


def test_an_open_tab_of_the_questions_leads_to_the_written_study(address: str) -> None:
    """Its answers are still read, and its button writes no second study."""
    assert _call(address, TEXTS, folder="mine", write=True)["written"]["data"] == "mine"
    for texts in (TEXTS, TEXTS | {"dog.count": "0"}):
        changes = _call(address, texts, folder="second", write=True)
        assert changes["written"]["data"] == ""
        note = json.dumps(changes["folder-fault"]["children"])
        assert "this server has written the study 'mine'" in note
        assert '"href": "/"' in note
    changes = _call(address, TEXTS | {"dog.count": "0"}, folder="second", write=False)
    assert changes["state"]["children"] == "1 answer is wrong"
    assert not Path("second").exists()
    assert _address(f"{address}{PATH}") == f"{address}/"


def _address(url: str) -> str:
    """Follow an address to that of its page."""
    with urllib.request.urlopen(url, timeout=300) as answer:
        return str(answer.url)


def _status(request: urllib.request.Request) -> int:
    try:
        with urllib.request.urlopen(request, timeout=300) as answer:
            status: int = answer.status
            return status
    except urllib.error.HTTPError as error:
        with error:
            return error.code


def test_a_page_elsewhere_writes_nothing(address: str) -> None:
    """Its forms are no JSON, and its name is not that of this machine."""
    body = json.dumps({"output": "x", "inputs": [], "changedPropIds": []}).encode()
    url = f"{address}{PATH}_dash-update-component"
    for kind in ("text/plain", "application/x-www-form-urlencoded"):
        assert _status(urllib.request.Request(url, body, {"Content-Type": kind})) == 415
    hosts = {"elsewhere.example": 400, "127.0.0.1": 200}
    for host, status in hosts.items():
        assert _status(urllib.request.Request(address, headers={"Host": host})) == status
