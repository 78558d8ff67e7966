"""Every verb as a user calls it: JSON, text, exit status, and bad input."""

from __future__ import annotations

import csv
import re
import shlex
import subprocess
from pathlib import Path

import pytest

from dogshape.cli.app import VERBS
from dogshape.validation.finite_elements.root_stress import fem_available
from tests.conftest import SMALL, Call, require_program, set_options
from tests.integration.studies import Finished
from tests.server import command_of

ONE_SHIFT = ("--mismatch-rpm", 50, "--force-N", 469, "--angle-deg", 10)
SETS = set_options(SMALL)


@pytest.mark.parametrize("verb", VERBS)
def test_help_has_an_example(dogshape: Call, verb: str) -> None:
    said = dogshape(*verb.split(), "--help")
    assert said.status == 0
    assert f"Example: dogshape {verb}" in " ".join(said.out.split())


def test_shift(dogshape: Call, tmp_path: Path) -> None:
    files = ("--report", "a.html", "--trace", "a.csv")
    said = dogshape("shift", "mq200_paper", *ONE_SHIFT, *files, "--json")
    assert said.status == 0
    assert said.json["outcome"] == "engaged"
    assert said.json["shift_time_s"] == pytest.approx(0.0826, rel=0.02)
    assert said.json["phases"][-1]["end"] == pytest.approx(said.json["shift_time_s"])
    assert 469 < said.json["peak_axial_force_N"] < 2 * 1090
    assert said.json["loads"]["torque_peak_Nm"] > 0.0
    with (tmp_path / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["output_speed_rpm"]) == pytest.approx(50)
    assert float(rows[-1]["displacement_mm"]) >= 4.65
    assert float(rows[-1]["t_s"]) == pytest.approx(said.json["shift_time_s"], abs=1.1e-3)
    page = (tmp_path / "a.html").read_text()
    assert not re.search(r'<(script|link)[^>]*(src|href)="?http', page)


def test_a_blocked_shift_is_an_answer(dogshape: Call) -> None:
    still = ("--mismatch-rpm", 0, "--force-N", 469, "--angle-deg", 0)
    said = dogshape("shift", "mq200_paper", *still, "--set", "dog.chamfer_deg=2", "--json")
    assert (said.status, said.json["outcome"], said.json["shift_time_s"]) == (0, "blocked", None)


def test_expect_at_listed_angles_is_the_mean_of_those_shifts(dogshape: Call) -> None:
    point = ("--mismatch-rpm", 100, "--force-N", 469)
    how = ("--angles", "0,12", "--engine", "drake", "--jobs", 1, "--json")
    said = dogshape("expect", "mq200_paper", *point, *how)
    shift = ("shift", "mq200_paper", *point, "--json", "--angle-deg")
    times = [dogshape(*shift, angle).json["shift_time_s"] for angle in (0, 12)]
    assert said.json["engaged_mean_s"] == pytest.approx(sum(times) / 2, rel=1e-9)
    whole = said.json["engaged_mean_s"] + said.json["retries_s"]
    assert said.json["expected_shift_time_s"] == pytest.approx(whole)
    assert 0.0 < said.json["hang_probability_low"] < said.json["hang_probability"]
    assert said.json["hang_probability"] < said.json["hang_probability_high"] < 1.0
    assert said.json["standard_error_s"] is None  # two angles tell no error
    (only,) = said.json["points"]
    assert (only["n"], only["engaged"]) == (2, 1.0)


def test_a_set_point_that_alternates_frees_what_is_held(dogshape: Call) -> None:
    """Flat dogs at a low mismatch: a retry of 1.2 s, the set-point, one too fast, one in part."""
    point = ("--mismatch-rpm", 10, "--force-N", 469, "--angles", 24, "--jobs", 1)
    flat = ("expect", "mq200_paper", *point, "--set", "dog.chamfer_deg=0")
    own = "shift.alternating={{amplitude_rpm={}, period_s=0.6, after_s=0.4}}"
    swings = ("--set", own.format(20))
    held, freed = (dogshape(*flat, *more, "--json").json for more in ((), swings))
    assert held["expected_shift_time_s"] is None
    assert freed["engages"]
    assert 0.2 < freed["expected_shift_time_s"] < 1.0
    assert [one["share"] for one in freed["quantiles"]] == [0.95, 0.999]
    assert freed["quantiles"][0]["time_s"] > freed["expected_shift_time_s"]
    assert freed["quantiles"][1]["time_s"] is None  # of 24 shifts
    (before,), (after,) = held["points"], freed["points"]
    assert before["shiftability"] == after["shiftability"]
    assert before["engaged"] == after["engaged"] < 0.5
    assert "freed by the alternating set-point" in dogshape(*flat, *swings).out
    said = dogshape(*flat, "--set", own.format(900))
    assert "more than 147.7 1/min may throw it out again; lower it" in said.sentence
    said = dogshape(*flat, "--set", "shift.alternating.amplitude_rpm=20")
    assert "'shift.alternating.period_s' is missing; add it" in said.err


@pytest.fixture
def studied(finished: Finished, tmp_path: Path) -> Path:
    """A folder with the results of a study at smoke size."""
    finished.copy(tmp_path / "home" / "results" / "mq200_paper")
    return tmp_path / "home"


def test_study_fit_check(dogshape: Call, studied: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(studied)
    fitted = dogshape("fit", "results/mq200_paper", "--out", "mine.json", "--json")
    assert set(fitted.json) >= {"q2", "coverage_95", "rmse_s", "n"}
    assert fitted.json["n"] == 12
    own = ("check", "mq200_paper", *SETS)
    mine = (*own, "--surrogate", "mine.json")
    checked = dogshape(*mine, "--json")
    assert checked.status == 0
    assert checked.json["low_s"] < checked.json["expected_shift_time_s"] < checked.json["high_s"]
    assert checked.json["in_range"] is True
    assert checked.json["verdict"]["state"] == "not_judged"
    far = dogshape(*own, "--set", "dog.height_mm=7", "--json")
    assert far.json["in_range"] is False
    assert "height_mm = 7 is outside" in far.json["warnings"][0]
    other = ("--set", "contact.set=adams2019")
    found = dogshape(*own, *other, "--json")
    assert (found.status, found.json["engine"], found.json["surrogate"]) == (0, "planar", None)
    refused = dogshape(*own, *other, "--surrogate", "results/mq200_paper/surrogate.json")
    assert "other physics" in refused.sentence


#: Commands, and words of the sentence that refuses each.
BAD = """
strength nowhere | there is no study at nowhere
strength mq200_paper --set dog.heigth_mm=3 | did you mean 'dog.height_mm'?
strength mq200_paper --set 'dog.count=15\ndog.height_mm=3' | more than one value
shift ONE --force-N -469 | shift force is -469 N
shift ONE --force-N 5000 | actuation.rise_s, or give --force-rise-s
shift ONE --report no/such/a.html | --report is no/such/a.html, but there is no folder no/such
shift ONE --report a.x --trace a.x | give two files
expect mq200_paper --force-rise-s 0.1 | goes with one operating point
expect mq200_paper --angles few | --angles is 'few'
expect mq200_paper --precision nan | --precision is nan
expect mq200_paper --precision 0.1 --angles 6 | leave out --angles
export mq200_paper | export was asked for nothing
export mq200_paper --svg a.svg --body-mm 0 | --body-mm is 0
export mq200_paper#480 --sheet a.html | has no design 480
export mq200_paper#1 --set dog.count=20 --sheet a.html | --set would change
export mq200_paper#1 --svg a.svg --why x | --why and --title are for
export mq200#33 --sheet a.html --title autor=x | did you mean 'author'
export mq200_paper#1 --sheet a.pdf | must end in .html
export mq200_paper --fmu a.zip | must end in .fmu
export mq200_paper --fmu a.fmu --fmi 1 | --fmi is 1, but FMUs are of FMI 2 or 3; give --fmi 2 or
export amt --map a.csv | a map needs every mismatch with every force
compare mq200_paper | needs two or more
compare mq200_paper nowhere | 'nowhere' is no folder of results, no study and no contact set
compare mq200_paper adams2019 | 'adams2019' is a contact set and 'mq200_paper' is none
compare mq200_paper#0 mq200_paper#99 | has the designs 0 (own dog) to 47
compare mq200_paper#0 mq200_paper#x | must end in the number of a design
init study --set dog.cuont=20 | did you mean 'dog.count'?
init study --set dog.height_mm=-3.0 | dog.height_mm is -3 mm
init study --like mq20 | or a kind: amt (30 dogs, 138/129 mm, 2500 N m); ev_disconnect
init study --out 'my clutch' | letters, digits
check mq200_paper --mismatch-rpm 80 | needs --mismatch-rpm and --force-N
check mq200_paper --surrogate none.json | there is no surrogate at
predict mq200_paper none.csv | there is no table of designs at none.csv
study mq200_paper --set operating.force_N=[99] | actuation.force_N and actuation.rise_s
study GOAL="['axial_length_mm']" | has none that needs a simulation
study GOAL="['expected_shift_time']" | did you mean 'expected_shift_time_s'?
study LIMIT.first_try_share=1.5 | is 1.5, but no share engaged in time at the first try is above 1;
study LIMIT.expected_shift_time_s=-0.06 | every expected shift time is above 0;
study LIMIT.smallest_margin_worst=10 | is above 1;
study LIMIT.impact_impulse_Ns=nan | it must be finite
study mq200_paper --out x --storage sqlite:////no/d.db | but a study is kept in postgresql+psycopg
study mq200_paper --out x --storage postgresql://u@127.0.0.1:1/d | cannot be opened
fit results/mq200_paper | there is no study at results/mq200_paper
report nowhere | there is no study.json in nowhere
validate nowhere | there is no data set at nowhere
gap mq200_stand --study mine/truck.toml | there is no study at mine/truck.toml
""".strip()
SHORT = {
    "ONE": f"mq200_paper {' '.join(map(str, ONE_SHIFT))}",
    "GOAL": "mq200_paper --set search.objectives",
    "LIMIT": "mq200_paper --set search.limits",
}


@pytest.mark.parametrize("line", re.split(r"\n(?=[a-z]+ )", BAD))
def test_bad_input_is_one_sentence(dogshape: Call, line: str) -> None:
    command, _, words = line.partition(" | ")
    for short, whole in SHORT.items():
        command = command.replace(short, whole)
    said = dogshape(*shlex.split(command))
    assert words in said.sentence
    assert said.out == ""
    assert not [path for path in Path().iterdir() if path.is_file() or path.name == "x"]


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("strength mq200_paper --colour red", "--colour"), ("shift mq200_paper", "Missing option"),
        ("shrength mq200_paper", "shrength"), ("expect mq200_paper --jobs -1", "--jobs"),
    ],
)  # fmt: skip
def test_wrong_options_are_one_sentence(program: Call, command: str, words: str) -> None:
    said = program(*command.split())
    assert words in said.sentence
    assert said.out == ""


def test_a_study_without_a_feasible_design_ends_with_a_page_and_status_1(dogshape: Call) -> None:
    """The nearest designs are simulated, and what would let them pass is said."""
    hopeless = ["manufacturing.tip_width_mm=12", "search.trials=2", "search.confirm_angles=1"]
    quick = ["operating.mismatch_rpm=[50]", "operating.force_N=[469.0]", "expectation.angles=3"]
    options = set_options([*hopeless, *quick, "solver.engine=planar"])
    outcome = dogshape("search", "mq200_paper", *options, "--out", "x")
    assert outcome.status == 1
    assert "fail tip width" in outcome.out
    assert "or use fewer or lower dogs" in outcome.err
    assert (Path("x") / "report.html").exists()


def test_version_and_status_through_the_entry_point() -> None:
    version = subprocess.run(command_of("--version"), capture_output=True, text=True, check=True)
    assert re.fullmatch(r"dogshape \d+\.\d+\.\d+, drake \S+", version.stdout.strip())
    weak = command_of("strength", "mq200_paper", "--no-simulate", "--set", "dog.traction_deg=5")
    assert subprocess.run(weak, capture_output=True, check=False).returncode == 1


def test_nothing_engaged_is_said(dogshape: Call) -> None:
    hasty = ("--set", "shift.timeout_s=0.01", "--angles", 3, "--jobs", 1)
    asked = ("expect", "mq200_paper", "--mismatch-rpm", 50, "--force-N", 469, *hasty)
    found = dogshape(*asked, "--json").json
    assert found["engages"] is False
    assert found["expected_shift_time_s"] is found["standard_error_s"] is None
    assert found["points"][0]["mean_s"] is found["mean_engaged_s"] is None
    assert (found["not_engaged"], found["shifts"]) == (3, 3)
    said = "engages in 0 of 3 shifts: no expected shift time"
    assert dogshape(*asked).out.startswith(said)


def test_damaged_results_are_refused(dogshape: Call, studied: Path) -> None:
    folder = studied / "results/mq200_paper"
    for content in ("{}", '{"trials": null}', "[]", "{"):
        (folder / "result.json").write_text(content)
        said = dogshape("report", folder)
        assert "result.json" in said.sentence
    (folder / "rows.json").write_text("{")
    assert "rows.json" in dogshape("fit", folder).sentence
    fixed = dogshape("fit", folder, "--set", "dog.count=18")
    assert "cannot change a study that was run" in fixed.sentence


def test_finite_elements_on_request(dogshape: Call) -> None:
    require_program(fem_available(), "scikit-fem")
    said = dogshape("strength", "mq200_paper", "--no-simulate", "--fem", "--json").json
    rows = {(row["flank"], row["band"]): row for row in said["finite_elements"]}
    assert len(rows) == 6
    for row in rows.values():
        assert row["closed_form_MPa"] == pytest.approx(row["finite_elements_MPa"], rel=0.1)
    assert len(said["stiffness"]) == 6
    bending = next(c for c in said["checks"] if c["name"] == "root_bending_traction")
    assert rows["traction", "load"]["closed_form_MPa"] == pytest.approx(bending["value"])
