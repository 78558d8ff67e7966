"""Earlier names of verbs and options are translated, with the present name of each."""

from __future__ import annotations

import pytest

from dogshape.cli.renamed import current_words
from tests.conftest import Call


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("study mq200 --out x", "search mq200 --out x"),
        ("gap mq200_stand --json", "diagnose mq200_stand --json"),
        ("gap plan mq200 --shifts 40", "plan-shifts mq200 --shifts 40"),
        ("gap update results/gap new.csv", "update-diagnosis results/gap new.csv"),
        ("gap ./plan", "diagnose ./plan"),
        ("shift s --relative-angle-deg=3 --html a.html", "shift s --angle-deg=3 --report a.html"),
        ("strength mq200 --no-simulation", "strength mq200 --no-simulate"),
        ("expect mq200 --keep old", "expect mq200 --journal old"),
        ("strength mq200 --keep=old", "strength mq200 --journal=old"),
        ("validate stand --keep old", "validate stand --journal old"),
        ("check mq200 --designs d.csv --json", "predict mq200 --json d.csv"),
        ("check --designs=d.csv mq200 --out o.csv", "predict mq200 --out o.csv d.csv"),
        ("expect s.toml --draws d.csv --angles 4", "expect-draws s.toml --angles 4 d.csv"),
    ],
)  # fmt: skip
def test_an_earlier_word_is_the_present_one(old: str, new: str) -> None:
    words, renamed = current_words(old.split())
    assert words == new.split()
    assert renamed
    assert current_words(words) == (words, {})


@pytest.mark.parametrize(
    "line",
    ["init study --out x", "check mq200 --designs", "fit study", "", "diagnose m.csv --keep row=*"],
)
def test_other_words_stay(line: str) -> None:
    assert current_words(line.split()) == (line.split(), {})


def test_a_terminal_shows_the_present_name(dogshape: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    assert dogshape("strength", "mq200_paper", "--no-simulation").err == ""
    monkeypatch.setattr("dogshape.cli.app._shows_hints", lambda: True)
    shown = dogshape("strength", "mq200_paper", "--no-simulation").err
    assert shown == "hint: --no-simulation is now --no-simulate\n"
