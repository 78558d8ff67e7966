"""Questions of a new study, answered all at once; and the page that asks them."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

import dogshape as ds
from dogshape.app.live_content import layout
from dogshape.app.questions_content import SYMBOLS, command_text, part_fields, state_text
from dogshape.app.questions_page import FOLDER_NAME
from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.drafts.draft_keys import PARTS
from dogshape.pipeline.drafts.questionnaire import assign_sentences, read_questionnaire
from dogshape.pipeline.drafts.study_folder import value_of, write_study
from dogshape.sim.errors import InputError
from tests.conftest import Call

SKETCH = Path(__file__).parents[2] / "pipeline" / "reports" / "templates" / "symbols.svg"


def test_answers_are_read_as_people_write_them() -> None:
    texts = {"dog.traction_deg": "20 deg", "dog.braking_deg": "\N{MINUS SIGN}3\N{DEGREE SIGN}"}
    texts |= {"dog.height_mm": " 5,5 ", "load.torque_Nm": "1.5 kN m", "material.set": "20MnCr5"}
    questionnaire = read_questionnaire("amt", texts)
    assert questionnaire.values == {
        "dog.traction_deg": 20.0, "dog.braking_deg": -3.0, "dog.height_mm": 5.5,
        "load.torque_Nm": 1500.0, "material.set": "20MnCr5",
    }  # fmt: skip
    assert questionnaire.is_valid
    assert questionnaire.study is not None
    assert questionnaire.study.clutch.dog.height == pytest.approx(5.5e-3)
    assert state_text(questionnaire).startswith("values of yours: 5; of 'amt' or")


@pytest.mark.parametrize(
    ("key", "text", "value"),
    [
        ("actuation.area_cm2", "1250 mm2", 12.5),
        ("actuation.area_cm2", "600 + 650 mm\N{SUPERSCRIPT TWO}", 12.5),
        ("actuation.area_cm2", "6,0 cm2 + 650 mm2", 12.5),
        ("actuation.conductance_dm3_s_bar", "8 mm\N{SUPERSCRIPT TWO}", 1.6),
        ("actuation.conductance_dm3_s_bar", "1.6 dm3/(s bar)", 1.6),
        ("actuation.conductance_dm3_s_bar", "96 l/(min bar)", 1.6),
        ("actuation.flow_l_min", "0.2 l/s", 12.0),
    ],
)
def test_areas_and_valves_are_read_as_people_write_them(key: str, text: str, value: float) -> None:
    assert value_of(key, text, default=1.0, answers={}) == pytest.approx(value)


def test_an_area_is_one_number_or_a_sum() -> None:
    with pytest.raises(InputError, match="give one number, or a sum such as 6"):
        value_of("actuation.area_cm2", "6 7 + 8", default=1.0, answers={})


def test_typed_defaults_are_the_users_own(tmp_path: Path) -> None:
    """A typed default of a key that the study lacks, such as a latch, stays absent."""
    texts = {"dog.count": "15", "load.torque_Nm": "200 N m", "dog.mount": "face"}
    questionnaire = read_questionnaire("mq200", texts)
    assert questionnaire.is_valid
    assert questionnaire.values == {"dog.count": 15, "load.torque_Nm": 200.0}
    assert state_text(questionnaire).startswith("values of yours: 2; of 'mq200' or")
    assert "--set dog.count=15 --set load.torque_Nm=200" in command_text(questionnaire, "own")
    written = write_study(tmp_path / "own", "mq200", questionnaire.values)
    sentences = " ".join(written.assumed)
    assert "dog.height_mm = 3.7" in sentences
    assert "dog.count" not in sentences
    assert "load.torque_Nm" not in sentences


def test_every_wrong_answer_has_its_sentence_at_once() -> None:
    """Unreadable ones, those that the file refuses, and those that a later check refuses."""
    texts = {"dog.count": "0", "load.torque_Nm": "3,200", "dog.outer_diameter_mm": "40"}
    texts |= {"operating.force_N": "5 kN", "dog.mount": "cone", "dog.braking_deg": "5,5"}
    questionnaire = read_questionnaire("mq200", texts)
    beginnings = {
        "dog.count": "dog.count is 0, but it must lie between 2 and 1000",
        "load.torque_Nm": "3,200 may be 3200 or 3.2; write it without the comma",
        "dog.outer_diameter_mm": "dog.inner_diameter_mm is 44 mm, but it must be below",
        "dog.inner_diameter_mm": "dog.inner_diameter_mm is 44 mm, but it must be below",
        "actuation.force_N": "shift force is 5000 N, but the rise times of the study cover",
        "actuation.rise_s": "shift force is 5000 N, but the rise times of the study cover",
        "dog.mount": "give one of face, sleeve",
    }
    assert questionnaire.faults.keys() == beginnings.keys()
    for key, beginning in beginnings.items():
        assert questionnaire.faults[key].startswith(beginning)
    assert not questionnaire.is_valid
    assert state_text(questionnaire) == "7 answers are wrong"
    assert command_text(questionnaire, "mine") == ""
    assert repr(part_fields(questionnaire, texts)).count("number answer wrong") == 7


def test_a_shape_that_no_single_answer_spoils_is_refused_as_a_whole() -> None:
    texts = {"dog.height_mm": "9", "dog.traction_deg": "50"}
    questionnaire = read_questionnaire("mq200", texts)
    assert questionnaire.faults == {}
    assert questionnaire.refusal.startswith("tip width at the inner radius is -2.57334 mm, but")
    assert not questionnaire.is_valid


def test_answers_decide_later_questions() -> None:
    texts = {
        "actuation.kind": "spring",
        "dog.chamfer_back_deg": "8",
        "dog.outer_diameter_mm": "104",
    }
    texts |= {"dog.inner_diameter_mm": "88"}
    plain = read_questionnaire("mq200", {})
    questionnaire = read_questionnaire("mq200", texts)
    added = {"actuation.preload_N", "actuation.rate_N_mm", "dog.crest"}
    assert added <= questionnaire.questions.keys() - plain.questions.keys()
    # The height keeps its ratio to the pitch.
    assert (plain.defaults["dog.height_mm"], questionnaire.defaults["dog.height_mm"]) == (3.7, 7.4)


def test_a_remedy_names_no_wrong_answer() -> None:
    sentences, others = assign_sentences(
        "the study s: 2 mistakes\n- dog.count is 0, but it must be 2; change dog.height_mm\n- no",
        ["dog.count", "dog.height_mm"],
    )
    assert (list(sentences.values()), others) == ([["dog.count"]], "no")


def test_page_and_command_write_the_same_study(dogshape: Call) -> None:
    """The page prints the command of its answers."""
    texts = {"dog.count": "20", "operating.mismatch_rpm": "-60 to 60", "dog.backlash_mm": "1 deg"}
    questionnaire = read_questionnaire("mq200", texts)
    write_study(Path("page"), "mq200", questionnaire.values)
    words = command_text(questionnaire, "command").split("'")
    quoted = [part if index % 2 else part.split() for index, part in enumerate(words)]
    flat = [word for part in quoted for word in ([part] if isinstance(part, str) else part)]
    assert flat[:2] == ["dogshape", "init"]
    assert dogshape(*flat[1:]).status == 0
    assert load_study("page").physics_hash == load_study("command").physics_hash


def test_the_sketch_has_the_symbols_of_the_questions() -> None:
    root = ElementTree.fromstring(SKETCH.read_text("utf-8"))
    words = " ".join(text.text or "" for text in root.iter("{http://www.w3.org/2000/svg}text"))
    assert set(SYMBOLS.values()) <= set(words.split())
    assert SYMBOLS.keys() <= {key for part in PARTS.values() for key in part}


@pytest.mark.parametrize("name", ["", "..", ".hidden", "/tmp/mine", "a/b", "a\\b", "my clutch"])
def test_the_page_writes_into_its_own_folder_alone(name: str) -> None:
    assert not FOLDER_NAME.fullmatch(name)
    assert FOLDER_NAME.fullmatch("my_clutch-2.0")


def test_remarks_stand_behind_one_line() -> None:
    config = ds.Study("mq200").config
    page = repr(layout(config, [], None, ["mine is written", "assumed: much"]))
    assert page.index("Summary('mine is written')") < page.index("P('assumed: much')")
    assert repr(layout(config, [], None)).count("Details(") == page.count("Details(") - 1


def test_settings_without_a_study_are_refused(dogshape: Call) -> None:
    said = dogshape("app", "--set", "dog.count=18")
    assert said.status == 2
    assert said.sentence.endswith("name one, or answer the questions of the page")
