"""Words, tables, figures, shifts and stored parts of the report; its table of alternatives."""

from __future__ import annotations

import json
import shlex
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.record import Bad, Table
from dogshape.pipeline.reports import single_shifts, surrogate_findings
from dogshape.pipeline.reports.charts import assumptions_figure, front_figure, shiftability_figure
from dogshape.pipeline.reports.data_sheet import command_of, words_of
from dogshape.pipeline.reports.design_record import searched_sheet
from dogshape.pipeline.reports.designs import designs_frame, goals_of
from dogshape.pipeline.reports.headline import headline
from dogshape.pipeline.reports.result_figures import times_figure
from dogshape.pipeline.reports.single_shifts import drawn_variant, replays_of, write_replays
from dogshape.pipeline.reports.study_page import point_parts
from dogshape.pipeline.reports.study_summary import alternatives_tables, facts_of, summary_tables
from dogshape.pipeline.reports.surrogate_findings import (
    FACTORS,
    TOLERANCES,
    Effects,
    LimitPrice,
    learn_effects,
    prices,
    prices_table,
    stored_effects,
)
from dogshape.pipeline.reports.text import minus, with_error
from dogshape.pipeline.search.study_record import Confirmation, DesignRow
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.store.check_records import HingeRow
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.store.result_records import PointRow
from dogshape.pipeline.train.training_rows import stored_surrogate
from dogshape.sim.elementwise import Array
from dogshape.sim.shift.geometry import FLANKS
from dogshape.sim.strength.locking import locking_checks, locking_friction
from dogshape.study import Study
from dogshape.surrogate.store import save
from tests.search_results import (
    LENGTH,
    TIME,
    VARIABLES,
    Row,
    bundled_result,
    check,
    design,
    point,
    record_of,
    shift,
)


def _headline(result: Row) -> str:
    return headline(record_of(result))


def _facts(study: Setup, result: Row) -> dict[str, str]:
    return dict(facts_of(study, record_of(result)))


def test_every_simulated_design_is_in_the_table(result: Row) -> None:
    result["trials"][2]["time_within_tolerances"] = {
        "worst_case_s": 0.002,
        "root_sum_square_s": 0.001,
        "by_dimension_s": {},
    }
    record = record_of(result)
    table = designs_frame(record, VARIABLES, record.trials[:5])
    assert table["trial"].tolist() == [0, 1, 2, 3, 4]
    assert table["on_front"].tolist() == [False, True, True, False, False]
    assert table["chosen"].tolist() == [False, False, True, False, False]
    assert table[TIME].tolist() == [0.1, 0.08, 0.07, 0.09, 0.06]
    assert table["margin_of_module"].tolist() == [0.5] * 5
    assert table["failed"].fillna("").tolist()[4] == "edge_bedding_impact"
    assert table["within_tolerances_worst_case_s"][2] == 0.002


@pytest.fixture
def few(study: Setup) -> Setup:
    """The study with the two variables of the search made by hand."""
    return replace(study, variables={name: study.variables[name] for name in VARIABLES})


def test_facts_are_marked_where_they_speak_against_a_design(few: Setup, result: Row) -> None:
    c = result["confirmation"]
    c["designs"][0] |= {"agrees": False, "errors_apart": 8.6}
    found = _facts(few, result)
    assert found["gain in the expected shift time"] == "20.0 ± 1.0 ms (20 %)"
    assert found["engaged at the first try"] == "32 of 32 shifts; own dog 24 of 32"
    assert found["operating points slower than the own dog"].startswith("1 of 2 (1 clearly)")
    assert [name for name, words in found.items() if isinstance(words, Bad)] == [
        "verdict on your own dog", "verdict on design 2",
        "operating points slower than the own dog",
        "search and new angles of design 2",
    ]  # fmt: skip
    result["best"] |= {"chamfer_deg": 0.0}
    assert "chamfer" in _facts(few, result)["at the end of the search range"]
    assert "gain of further designs" not in found
    result["remaining_gain"] = {"expected": 0.00112, "upper": 0.0031}
    words = "best found; the surrogate expects 1.1 ms more, with 95 % no more than 3.1 ms"
    assert _facts(few, result)["gain of further designs"] == words


def test_headline_is_the_time_of_the_chosen_design_and_the_prototype(result: Row) -> None:
    assert _headline(result) == (
        "Design 2: expected shift time 80.0 ± 0.6 ms instead of 100.0 ± 0.6 ms of your own dog."
    )
    assert "not confirmed" in headline(record_of(result, confirmation=None))
    for row in result["trials"]:
        row["margins"]["smallest_margin_worst"] = -0.02
    said = headline(record_of(result, best=None))
    assert "6 of 6 fail root fatigue at worst-case tolerances, the nearest of them by 2" in said
    name = "shift_time_quantile_s"
    result |= {"objectives": [TIME, name], "leading": name, "quantile": 0.9}
    c = result["confirmation"]
    for key, value in (("prototype", 0.2), ("best", 0.15)):
        c[key]["estimates"][name] = {"value": value, "standard_error": 0.002}
    c["gains"][name] = {"value": 0.05, "standard_error": 0.003}
    assert "90 % quantile of the shift time 150.0 ± 2.0 ms instead of 200.0" in headline(
        record_of(result)
    )
    c["gains"][name]["standard_error"] = 0.03
    assert "150.0 ± 2.0 ms, not clearly better than 200.0" in _headline(result)


def test_headline_says_by_what_a_faster_own_dog_fails(result: Row) -> None:
    c = result["confirmation"]
    c["prototype"]["checks"] = [check("pull_out_force", -1.13)]
    assert _headline(result) == (
        "Design 2: expected shift time 80.0 ± 0.6 ms; your own dog has 100.0 ± 0.6 ms, but fails "
        "pull out force (\N{MINUS SIGN}113 %)."
    )


def test_headline_has_the_state_of_the_verdict(few: Setup, result: Row) -> None:
    """A margin whose interval holds zero is not clear on the page, in the table and the figure."""
    c = result["confirmation"]
    unclear = check("face_pressure_impact", -0.02, margin_interval=[-0.08, 0.04])
    words = minus("not clear: face pressure impact (-2.0 %, 95 %: -8 % to 4.0 %)")
    c["prototype"]["checks"] = [unclear]
    assert _headline(result) == (
        "Design 2: expected shift time 80.0 ± 0.6 ms; your own dog has 100.0 ± 0.6 ms and is "
        f"{words}."
    )
    c["prototype"]["checks"], c["best"]["checks"] = [], [unclear]
    assert _headline(result) == (
        "Design 2: expected shift time 80.0 ± 0.6 ms instead of 100.0 ± 0.6 ms of your own dog. "
        f"Design 2 is {words}."
    )
    missing = [{"check": "flank_strike", "key": "strike.ring_inertia_kgm2"}]
    verdict = {"state": "not_judged", "line": "", "failed": [], "not_clear": [], "hangs_on": []}
    c["best"]["verdict"] = {**verdict, "not_judged": missing}
    assert _headline(result).endswith("of your own dog. Not judged: flank strike.")
    own = next(row for row in result["trials"] if row["prototype"])
    assert headline(record_of(result, best=own)) == (
        "Your own dog is the fastest: expected shift time 80.0 ± 0.6 ms. Not judged: flank strike."
    )
    (record,) = c["designs"]
    c["designs"] = [{"trial": 1, **c["best"], "checks": [unclear], "verdict": None}, record]
    assert _facts(few, result)["designs out at the new angles"] == f"design 1 is {words}"
    figure = front_figure(record_of(result), VARIABLES)
    assert [one.name for one in figure.data if "not clear" in (one.name or "")] == ["not clear"]
    assert not any("fails face" in text for one in figure.data for text in one.hovertext or ())


def test_a_share_has_an_interval_and_nothing_an_error_of_zero(result: Row) -> None:
    (goal,) = goals_of(record_of(result, objectives=["first_try_share"], leading="first_try_share"))
    assert goal.words(99.9, 0.1) == "99.9 (95 %: 99.63 to 100) %"
    assert goal.words(100.0, 0.0) == "100.0 %"
    assert with_error(12.0, 0.0) == "12.0"
    assert (with_error(12.0, 0.004), with_error(12.0, 0.03)) == ("12.000 ± 0.004", "12.00 ± 0.03")


def test_headline_of_an_own_dog_that_is_the_fastest(result: Row) -> None:
    own = next(row for row in result["trials"] if row["prototype"])
    result["confirmation"]["best"] = result["confirmation"]["prototype"]
    said = headline(record_of(result, best=own))
    assert said == ("Your own dog is the fastest that passes: expected shift time 100.0 ± 0.6 ms.")
    result["confirmation"]["best"]["checks"] = [check("edge_bedding_impact", -0.1)]
    assert "Your own dog fails edge bedding impact" in headline(record_of(result, best=own))


def test_page_without_a_passing_design_has_the_nearest_ones_and_the_checks(
    few: Setup, result: Row
) -> None:
    for row in result["trials"]:
        row["margins"] = {"module": 0.5, "root_stress": -0.1 * (1 + row["trial"])}
    result["trials"][5]["margins"] = {"module": -0.2, "root_stress": 0.3}
    hangs = {"hang_probability": 0.01, "hang_probability_low": 0.001, "hang_probability_high": 0.03}
    unclear = check("root_stress", -0.02, margin_interval=[-0.08, 0.04])
    again = {**result["confirmation"]["best"], "checks": [unclear], **hangs, "retries_s": None}
    result |= {"best": None, "front": [], "confirmation": None, "nearest": [{"trial": 2, **again}]}
    nearest, barriers, facts = summary_tables(few, record_of(result))
    verdict = nearest.heads.index("verdict")
    assert [row[0] for row in nearest.rows][-1] == "own dog"
    assert nearest.rows[0][verdict] == "fails root stress (\N{MINUS SIGN}20 %)"
    words = minus("not clear: root stress (-2.0 %, 95 %: -8 % to 4.0 %)")
    assert {row[0]: row[verdict] for row in nearest.rows}["2"] == words
    assert _headline(result).endswith(f" Design 2 is {words}.")
    assert [row[0] for row in facts.rows] == ["hangs, design 2", "shafts"]
    assert {row[0]: row[1:4] for row in barriers.rows} == {
        "root stress": ["5 of 6", "5", "\N{MINUS SIGN}2.0 %"],
        "module": ["1 of 6", "1", "\N{MINUS SIGN}20 %"],
    }


@pytest.mark.parametrize(("share", "keys"), [(0.0625, ("best", "prototype")), (0.25, ("best",))])
def test_what_does_not_engage_has_no_time_and_no_gain(
    few: Setup, result: Row, share: float, keys: tuple[str, ...]
) -> None:
    for row in (row for key in keys for row in result["confirmation"][key]["points"]):
        row["engaged"] = share
    result["confirmation"] |= {key: result["confirmation"][key] | {TIME: None} for key in keys}
    assert _headline(result) == f"Design 2 engages in {32 * share:.0f} of 32 shifts."
    assert not any("gain" in name or "slower" in name for name in _facts(few, result))


def test_designs_that_fail_at_the_new_angles_are_said(few: Setup, result: Row) -> None:
    failing = check("edge_bedding_impact", -0.1)
    c = result["confirmation"]
    (own,) = c["designs"]
    c["designs"] = [{"trial": 1, **c["best"], "checks": [failing]}, own]
    said = "designs out at the new angles"
    assert _facts(few, result)[said].startswith("design 1 fails edge bedding impact")
    c["best"]["checks"] = own["checks"] = [failing]
    found = _facts(few, result)
    assert found["verdict on design 2"].startswith("fails: edge bedding impact")
    said = "smallest margin of a landing, 95 % interval"
    assert found[said].startswith("\N{MINUS SIGN}10 % edge")
    assert "Design 2 fails edge bedding impact" in _headline(result)


def test_fastest_and_slowest_shift_of_a_design(
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A blocked shift is the slowest; what was repeated with finer steps counts once."""
    own, said = study.prototype, list[str]()
    shifts = (
        shift(study, own, 1.0, 0.05),
        shift(study, own, 2.0, None),
        shift(study, own, 3.0, 0.04, accuracy=1e-9),
        shift(study, own, 4.0, None, outcome="diverged"),
        shift(study, own | {"chamfer_deg": 9.0}, 1.0, 0.02),
    )
    folder = StudyFolder(tmp_path)
    lines = [json.dumps(one | {"landing_loads_N_mm": [0.0]}) + "\n" for one in shifts]
    folder.shifts.write_text("".join(lines))
    rows = [DesignRow(**design(0, 0.1, 8.0, **own))]
    fast, slow = replays_of(folder, study, rows)
    assert (fast.words, slow.words) == ("50.0 ms at 50 1/min, 469 N", "blocked at 50 1/min, 469 N")
    assert fast.path.startswith("shifts/own-dog-fastest-")
    assert replays_of(StudyFolder(tmp_path / "none"), study, rows) == []

    def fails(*_: Any) -> None:
        raise RuntimeError("no solution")

    monkeypatch.setattr(single_shifts, "_write_page", fails)
    write_replays(folder, study, [fast, slow], said.append)
    assert said[0].startswith("animation 1 of 2: own dog, fastest shift, 50.0 ms")
    assert said.count("no page of this shift: no solution") == 2


def test_a_page_shows_an_uncertain_shift_as_it_was_drawn(study: Setup) -> None:
    row, point = shift(study, study.prototype, 1.0, 0.05), study.points[0]
    certain = drawn_variant(row)
    assert certain.clutch(study.clutch) == study.clutch
    assert certain.point(point).profile.force == point.profile.force
    factors = {"friction_factor": 1.2, "force_factor": 0.9, "inertia_factor": 1.1}
    variant = drawn_variant(row | factors | {"drawn_force_rise_s": 0.2})
    assert variant.clutch(study.clutch).contact.static_friction == pytest.approx(
        1.2 * study.clutch.contact.static_friction
    )
    profile = variant.point(point).profile
    assert (profile.force, profile.rise) == (pytest.approx(0.9 * point.profile.force), 0.2)


@pytest.mark.parametrize(
    "changes",
    [
        [],
        ["search.trials=12", "operating.mismatch_rpm=[50, 149]", "contact.set=adams2019"],
        ["uncertain.friction_factor={distribution='uniform', low=0.7, high=1.3}"],
    ],
)
def test_command_runs_the_same_study_again(changes: list[str]) -> None:
    study = load_study("mq200_paper", changes)
    command = command_of(study, "search")
    assert command is not None
    assert command.startswith("dogshape search mq200_paper")
    overrides = [word for word in shlex.split(command)[3:] if word != "--set"]
    assert load_study("mq200_paper", overrides).config_hash == study.config_hash
    file = study.file.model_copy(update={"name": "elsewhere"})
    assert command_of(replace(study, file=file), "study") is None


def test_effects_are_of_the_surrogate_as_it_is_now(
    study: Setup, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, calls = StudyFolder(tmp_path), list[str]()
    learn_effects(folder, pytest.fail)
    assert stored_effects(folder) is None
    folder.open(study, resume=False)
    stored, _ = stored_surrogate(study, None)
    save(folder.surrogate, stored)
    effects = Effects(
        designs=3, outside_trained_range=0.0, mean_expected_shift_time_s=0.1, variables=[]
    )
    monkeypatch.setattr(surrogate_findings, "effects_of", lambda *_: effects)
    monkeypatch.setattr(surrogate_findings, "prices", lambda *_: [])
    learn_effects(folder, calls.append)
    learn_effects(folder, calls.append)
    assert len(calls) == 1
    stored_findings = stored_effects(folder)
    assert stored_findings is not None
    assert (stored_findings.effects, stored_findings.prices) == (effects, [])
    few = stored.validation.model_copy(update={"n": 7})
    save(folder.surrogate, replace(stored, validation=few))
    assert stored_effects(folder) is None


def test_front_shows_every_design_at_its_place_with_its_interval(result: Row) -> None:
    own, result["trials"][0][TIME] = {"value": 0.101, "standard_error": 0.002}, None
    result["confirmation"]["prototype"] |= {TIME: 0.101, "estimates": {TIME: own}}
    figure = front_figure(record_of(result), VARIABLES, LENGTH)
    found = {trace.name: trace for trace in figure.data}
    places = {k: list(zip(found[k].x, found[k].y, strict=True)) for k in found if k}
    assert places["chosen"] == [(pytest.approx(70.0), 7.0)]
    assert places["own dog"] == [(pytest.approx(101.0), 8.0)]
    assert places["fails when simulated"] == [(pytest.approx(60.0), 6.5)]
    bars = [found[kind].error_x.array[0] for kind in ("own dog", "chosen")]
    assert bars == pytest.approx([3.92, 1.96], rel=2e-2)  # Gamma distributed, nearly normal
    # What lies right of and above a design is beaten by it: first right, then down.
    (border,) = [trace for trace in figure.data if trace.line.shape == "hv"]
    assert list(border.x) == pytest.approx([70.0, 80.0])
    for words in ("design 1", "80.0 ± 1.0 ms", "number of dogs N: 16"):
        assert words in found["front"].hovertext[0]
    assert len({found[kind].marker.symbol for kind in places}) == len(places) == 5
    assert [(one.text, one.x) for one in figure.layout.annotations] == [("2", 70.0), ("1", 80.0)]


def test_numbers_of_near_designs_stand_apart(result: Row) -> None:
    near = [{**result["front"][1], "trial": 10 + n, TIME: 0.08 + 1e-5 * n} for n in range(4)]
    found = record_of(result, trials=[*result["trials"], *near], front=[*result["front"], *near])
    places = [(n.ax, n.ay) for n in front_figure(found, VARIABLES, LENGTH).layout.annotations]
    assert len(set(places[1:])) == 5


@pytest.mark.parametrize(
    ("angles", "spline"),
    [((8.0, 12.0, 22.0), 0.0), ((20.0, 7.0, 24.0), 0.06), ((15.0, 25.0, 9.0), 0.06)],
)
def test_a_surface_locks_just_above_its_friction(
    angles: tuple[float, float, float], spline: float
) -> None:
    """The checks of release pass a thousandth below, and the named one fails a thousandth above."""
    names = ("chamfer_deg", "traction_deg", "braking_deg")
    study = load_study("mq200_paper", [f"dog.{n}={v}" for n, v in zip(names, angles, strict=True)])
    dog = study.clutch.dog
    load = replace(study.limits.load, spline_friction=spline)
    friction, name = locking_friction(dog, load)

    def failed(factor: float) -> list[str]:
        checks = locking_checks(dog, replace(load, friction_release=factor * friction))
        return [c.name for c in checks if c.name.endswith("_release") and not c.passed]

    assert failed(0.999) == []
    assert failed(1.001) == [name]


def _by_trial(result: Row) -> dict[int, Row]:
    return {one["trial"]: one for one in result["confirmation"]["designs"]}


def _alternatives(study: Setup, result: Row) -> list[Table]:
    record = record_of(result)
    assert record.best is not None
    return alternatives_tables(study, record, record.best)


def test_the_table_has_the_designs_that_were_confirmed(study: Setup) -> None:
    result = bundled_result()
    (table, rest), confirmed = _alternatives(study, result), result["confirmation"]
    first, *others = sorted(
        (row["trial"] for row in result["front"]),
        key=lambda trial: (trial != confirmed["chosen"], _by_trial(result)[trial][TIME]),
    )
    assert [row[0] for row in table.rows] == [str(first), "own dog", *map(str, others)]
    assert len(table.heads) == 5
    assert list(rest.heads) == ["", *(row[0] for row in table.rows)]
    prototype = table.rows[1]
    row = {label: chosen for label, chosen, *_ in rest.rows}
    record = record_of(result)
    assert record.best is not None
    sheet = searched_sheet(study, record, record.best)
    worst = sheet.simulated.worst_against_prototype
    assert worst is not None
    assert row["worst point minus own dog, ms"].startswith(f"{1e3 * worst.difference_s:+.1f} ± ")
    words = words_of(sheet)
    assert words["locks above friction"].startswith(f"{sheet.locking_friction:.3f} (")
    assert "alone" not in words["locks above friction"]
    held_margins = {k: v for k, v in sheet.margins.items() if k.partition("_")[0] not in FLANKS}
    held = sheet.model_copy(update={"margins": held_margins, "locking_surface": "chamfer_release"})
    alone = "(chamfer alone; flanks need not release)"
    assert words_of(held)["locks above friction"] == f"{sheet.locking_friction:.3f} {alone}"
    assert prototype[2].startswith(f"+{1e3 * confirmed['gain_s']:.1f} ± ")
    assert table.looks == {0: "best", 1: "prototype"}


def test_what_fails_or_does_not_engage_is_no_alternative(study: Setup) -> None:
    record = bundled_result()
    fails, stuck = [row["trial"] for row in record["front"]][1:3]
    _by_trial(record)[fails]["checks"][0]["margin"] = -0.01
    _by_trial(record)[fails]["verdict"] = None  # of the checks alone
    points = _by_trial(record)[stuck]["points"]
    points[0]["engaged"] = 0.0
    _by_trial(record)[stuck][TIME] = None
    rows = {row[0]: row for row in _alternatives(study, record)[0].rows}
    assert str(fails) not in rows
    count = sum(p["n"] for p in points)
    engaged = sum(round(p["engaged"] * p["n"]) for p in points)
    assert f"engages in {engaged} of {count}" in rows[str(stuck)]
    assert rows[str(stuck)][2] == "-"


def test_worst_points_are_those_of_the_record(study: Setup) -> None:
    result = bundled_result()
    rows, trial = {row["trial"]: row for row in result["trials"]}, result["front"][1]["trial"]
    points = result["confirmation"]["prototype"]["points"]
    own = _by_trial(result)[trial]["points"]
    losses = [q["mean_s"] - p["mean_s"] for p, q in zip(points, own, strict=True)]
    record = record_of(result)
    worst = searched_sheet(study, record, record.trials[trial]).simulated.worst_against_prototype
    assert worst is not None
    assert worst.difference_s == pytest.approx(max(losses))
    other = next(t for t in rows if t and t not in _by_trial(result) and rows[t][TIME])
    searched = searched_sheet(study, record, record.trials[other])
    assert (searched.confirmed, searched.simulated.worst_against_prototype) == (False, None)


COUNTS = range(6, 37)


class Fewer:
    """A time that falls with the number of dogs: 1/N s."""

    def predict(self, designs: Array) -> tuple[Array, Array]:
        return 1.0 / designs[:, 0], np.zeros(len(designs))


def counted(*settings: str) -> Setup:
    """A study that searches the count alone, so that all designs can be looked at one by one."""
    whole = load_study("mq200_paper", ["dog.height_mm=2.5", "dog.chamfer_deg=10.0", *settings])
    return replace(whole, variables={"count": whole.variables["count"]})


def test_prices_are_those_of_every_design() -> None:
    study = counted()
    every = {n: design_of(study, {"count": n}).checks for n in COUNTS}
    known = 0
    for row in (row for row in prices(study, Fewer()) if row.name != TOLERANCES):
        for time, factor in zip((row.less_s, row.now_s, row.more_s), FACTORS, strict=True):
            limit = factor * row.limit
            kept = [
                n for n, checks in every.items()
                if checks and all(
                    c.passed if c.name != row.name
                    else c.value <= limit if c.rule.at_most else c.value >= limit
                    for c in checks
                )
            ]  # fmt: skip
            assert time == (pytest.approx(1.0 / max(kept)) if kept else None)
            known += bool(kept)
    assert known > 40


@pytest.mark.parametrize(
    ("settings", "cost"),
    [
        (["search.limits.smallest_margin_worst=0.0"], True),
        (["search.limits.smallest_margin_worst=0.0", "tolerance.root_radius_mm=0.0"], True),
        (["tolerance.contact_ratio=0.1"], False),
    ],
)
def test_tolerances_at_their_worst_are_a_limit_with_a_price(
    settings: list[str], cost: bool
) -> None:
    """With them as they are, and without any, as of every number of dogs one by one."""
    study = counted(*settings)
    exact = replace(study.limits, tolerances=study.limits.tolerances.without_sizes())

    def fastest(one: Setup) -> float:
        return 1.0 / max(n for n in COUNTS if design_of(one, {"count": n}).feasible)

    rows = {row.name: row for row in prices(study, Fewer())}
    row = rows[TOLERANCES]
    assert row.now_s == pytest.approx(fastest(study))
    assert row.without_s == pytest.approx(fastest(replace(study, limits=exact)))
    assert prices_table([row]).rows[0][0].startswith("no limit") != cost
    assert all(price.now_s == row.now_s for price in rows.values())


def test_limits_without_a_source_come_first() -> None:
    times = {"less_s": 0.05, "now_s": 0.06, "more_s": 0.07, "without_s": 0.01}
    dear = {name: 1e-3 * price for name, price in times.items()}
    rows = [
        LimitPrice(name=name, key="k", unit="", limit=1.0, at_most=False, **cost)
        for name, cost in (
            ("root_fatigue", times), ("slot_width", dear), ("contact_ratio", times),
            ("slower_than_reference_s", times),
        )
    ]  # fmt: skip
    table = prices_table(rows)
    names = [row[0].removesuffix(" k") for row in table.rows]
    assert names[:2] == ["limits without a source, assumed", "contact ratio"]
    assert names[2:] == ["other limits", "root fatigue", "time lost on the reference"]
    assert table.looks == {0: "group", 2: "group"}


def test_entries_of_both_designs_stand_beside_their_closed_form(result: Row) -> None:
    """And limit engagement speeds; of an earlier result, without either, there is no table."""
    study = load_study("motorcycle")
    own = Study("motorcycle").expect(angles=3, jobs=1).record.to_dict()
    best = DesignRow(**design(1, 0.1, 8.0, count=6))

    def parts() -> list[Any]:
        confirmed = {**own, "estimates": {}, "checks": []}
        confirmation = Confirmation(
            **{**result["confirmation"], "prototype": confirmed, "best": confirmed}
        )
        return point_parts(study, best, confirmation)

    notes = [part.note for part in parts() if isinstance(part, Table)]
    assert len(notes) == 4
    assert {note.split(",")[0] for note in notes} == {"Direct entry", "Limit engagement speed"}
    for row in own["points"]:
        del row["shiftability"]["direct_closed_form"], row["shiftability"]["first_window"]
    del own["engagement_limits"]
    assert not any(isinstance(part, Table) for part in parts())


def test_points_with_more_angles_share_a_map_with_the_others() -> None:
    """Bins of a point with twice as many are added in pairs."""
    intervals = {"engaged_interval": [0.0, 1.0], "direct_interval": [0.0, 1.0]}
    few = {"direct": 0.5, "by_angle": [[1, 0, 0], [0, 1, 0]], **intervals}
    many = {"direct": 0.5, "by_angle": [[1, 0, 0], [0, 1, 0], [1, 0, 0], [1, 0, 0]], **intervals}
    rows = [
        PointRow(**point(speed, 300.0, 0.1, 0.001), shiftability=entries)
        for speed, entries in ((50.0, few), (100.0, many))
    ]
    figure = shiftability_figure({"prototype": (rows, 15)})
    assert figure.data[-1].z.tolist() == [[100.0, 0.0], [50.0, 100.0]]


def test_tornado_tells_assumptions_that_change_the_sign() -> None:
    common = {"value": 1.0, "range": [0.5, 2.0], "unit": "", "source": "", "status": "assumption",
              "weakest_check": ["module", "module"]}  # fmt: skip
    hinges = [
        HingeRow(assumption=name, smallest_margin=margins, flips=margins[1] < 0.0, **common)
        for name, margins in (("a", [0.1, -5.0]), ("b", [0.2, 0.1]))
    ]
    changing, keeping = assumptions_figure(hinges).data
    assert (changing.y, changing.base, changing.x) == (("a",), (10.0,), (-210.0,))
    assert (keeping.y, keeping.base, keeping.x) == (("b",), (20.0,), (-10.0,))


def test_a_design_without_a_time_keeps_its_place_among_compared_ones() -> None:
    (marks,) = times_figure(["own", "blocked", "low"], [0.1, None, 0.02], [0.01, None, 0.03]).data
    assert list(marks.x) == ["own", "blocked", "low"]
    assert np.isnan([marks.y[1], marks.error_y.array[1]]).all()
    # Gamma distributions with these means and deviations.
    lows = marks.y - marks.error_y.arrayminus
    assert lows[[0, 2]] == pytest.approx([81.364, 0.008513], rel=0.02)
