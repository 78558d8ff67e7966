"""``init``: folders to begin with, and what a terminal asks."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

import dogshape as ds
from dogshape.bench.bench_data import load_bench
from dogshape.bench.stand_file import BenchRecord
from dogshape.cli import dialogue
from dogshape.cli.app import app
from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.config.toml_text import SOURCE
from dogshape.pipeline.drafts.answers import read_numbers
from dogshape.pipeline.store.check_records import LISTED_TABLES
from dogshape.sim.errors import InputError
from dogshape.sim.shift.drive import Drive
from dogshape.sim.strength.spline import Sleeve
from dogshape.sim.units import DEG, RPM
from dogshape.sim.versions import bundled_root
from tests.conftest import Call, CommandResult, set_options


def test_without_a_table_a_folder_is_to_be_filled(dogshape: Call) -> None:
    said = dogshape("init", "bench")
    assert said.status == 0
    assert "fill in shifts.csv" in said.out
    assert len(load_bench("my_bench").cells) == 28


def test_a_study_with_values_of_ones_own_keeps_its_comments(dogshape: Call) -> None:
    _, study = _begun(dogshape, "dog.count=20", "load.torque_Nm=300.0")
    text = Path("own/study.toml").read_text()
    assert (study.name, study.clutch.dog.count, study.limits.load.torque) == ("own", 20, 300.0)
    original = (bundled_root() / "mq200" / "study.toml").read_text()
    comments = [line.partition("#")[2].strip() for line in original.splitlines()[4:]]
    # Sources of the prototype and its limits do not stay beside another torque.
    meanings = [comment.partition(SOURCE)[0].rstrip(" ;") for comment in comments]
    strike = "of flanks at the largest mismatch; of ranges the worst ends count; output side rigid"
    gone = ("for the study", "at any operating point surely, on the study's own dog", strike,
            "of the blocking mechanism")  # fmt: skip
    assert all(meaning in text for meaning in meanings if meaning not in gone)
    assert "thesis table 5" not in text
    assert "thesis table 6" in text
    said = dogshape("init", "study", "--out", "plain")
    assert said.status == 0
    assert said.out.endswith(
        "  dogshape check plain\n"
        "  dogshape export plain --sheet sheet.html\n"
        "  dogshape search plain\n"
    )
    assert load_study("plain").physics_hash == load_study("mq200").physics_hash


def test_in_a_terminal_it_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    # Kind, actuator; points, at once refused; all of them again; dogs, ring and what turns with
    # it; height, fork, torque, coast; toothing, shafts, engine, drag, latch, torque left, shifts,
    # strike, steel.
    answers = "\n profile 1500 0,1 1 0,2 50 1600 profile 1500 0,1 2 0,2 50 1500"
    typed = f"{answers} 30  8  12 22 140 124 1 0,2  2,5 0,05 0,6 5  1500   1800 output 0,8 9000"
    typed = f"{typed} 0,1 1e6 0,004&0,02 1e5 steel 20MnCr5".replace(" ", "\n").replace("&", " ")
    done = CliRunner().invoke(app, ["init", "study", "--out", "mine"], input=typed)
    assert done.exit_code == 0, done.stderr
    study = load_study("mine")
    dog, mechanism = study.clutch.dog, study.clutch.mechanism
    assert (dog.count, dog.height, dog.backlash) == pytest.approx((30, 5e-3, 2e-4))
    assert mechanism.spline_radius == pytest.approx(0.8 * 0.062)
    assert study.clutch.drive == Drive(1800 * RPM, engine_side="output")
    assert (mechanism.drag_torque, study.limits.material.name) == (0.8, "20MnCr5")
    load = study.limits.load
    given = study.clutch.timeout, load.separating_force_limit, load.pull_out_share, load.shifts
    assert given == (2.0, 9000.0, 0.1, 1e6)
    strikes = {(one.ring_inertia, one.input_stiffness) for one in study.limits.strikes}
    assert strikes == {(0.004, 1e5), (0.02, 1e5)}
    for words in (
        "not judged; 2.5 kg at the mean radius have 0.01089",
        "kinds of clutch: amt (30 dogs, 138/129 mm, 2500 N m)", "height of the dogs, mm [5.09]:",
        "chamfer of the face, deg; 0: flat (the MQ200 prototype, thesis table 5) [8]:",
        "own teeth's, mm (0.8 of the inner radius) [49.6]:", "N m (none, an assumption) [0]:",
        "a range its middle; 0: the sliding ring stands", "ring that turns with the engine",
        "mq200_three (15 dogs, 52/44 mm, 200 N m)\n", "ring is pulled out (all of it) [1]:",
        "give one of 16MnCr5, 20MnCr5", "forces of the shifts, N, likewise [1500]:",
        "shift force is 1600 N, but the study has a rise time for 1500 N alone",
    ):  # fmt: skip
        assert words in done.stderr
    # The same clutch again by return alone: toothing and drag are its own.
    done = CliRunner().invoke(app, ["init", "study", "--out", "same"], input=50 * "\n")
    assert done.exit_code == 0, done.stderr
    assert load_study("same").physics_hash == load_study("mq200").physics_hash
    Path("m.csv").write_text("x;y;F_shift (kN)\n50;190;0,469\n100;180;0,469\n")
    said = ["shift_time_s=y:ms", "mismatch_rpm=x", "y", "stand 7", "me, today", "", "y"]
    said += ["command", "arm", "actuator", "known", "n"]
    done = CliRunner().invoke(app, ["init", "bench", "m.csv"], input="\n".join(said) + "\n")
    assert done.exit_code == 0, done.stderr
    bench = load_bench("m")
    assert bench.name == "stand 7"
    assert bench.record == BenchRecord(
        time_zero="command", displacement_at="actuator", sense="known"
    )
    assert bench.source.startswith("me, today; m.csv (SHA-256 ")
    assert bench.readings[0].time == pytest.approx(0.19)


def test_an_answer_equal_to_the_default_is_the_users_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Number of dogs, gap and coast torque are typed as they are shown, the rest by return."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    command = ["init", "study", "--json", "--out"]
    plain = CliRunner().invoke(app, [*command, "plain"], input=50 * "\n")
    assert plain.exit_code == 0, plain.stderr
    typed_questions = ("number of dogs", "axial gap", "largest torque on the braking flank")
    prompts = re.findall(r"(.*?) \[([^]]*)\]:", plain.stderr)
    lines = [
        default if question.startswith(typed_questions) else "" for question, default in prompts
    ]
    assert sum(map(bool, lines)) == 3
    typed = CliRunner().invoke(app, [*command, "typed"], input="\n".join(lines) + "\n")
    assert typed.exit_code == 0, typed.stderr
    # A test's terminal echoes the answers before the document.
    plain_study, typed_study = (
        json.loads(done.stdout[done.stdout.index("{") :]) for done in (plain, typed)
    )
    assert plain_study["set"] == {}
    set_values = {"dog.count": 15, "dog.axial_gap_mm": 1.0, "load.coast_share": 0.4}
    assert typed_study["set"] == set_values
    plain_sentences = " ".join(plain_study["assumed"])
    typed_sentences = " ".join(typed_study["assumed"])
    for key in set_values:
        assert f"{key} = " in plain_sentences
        assert f"{key} = " not in typed_sentences
    assert "dog.chamfer_deg = 8" in typed_sentences
    assert load_study("typed").physics_hash == load_study("plain").physics_hash


def test_what_is_given_is_not_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Play in degrees, a range of mismatches, number of dogs, root and drag are given."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    mismatch = 'operating.mismatch_rpm={distribution="uniform",low=-25,high=25}'
    settings = ("dog.count=6", "dog.backlash_deg=25", mismatch, "mechanism.drag_torque_Nm=0.3")
    command = ["init", "study", "--mount", "sleeve", "--out", "given", *set_options(settings)]
    done = CliRunner().invoke(app, command, input=50 * "\n")
    assert done.exit_code == 0, done.stderr
    for question in ("number of dogs", "play", "backlash", "mismatches", "drag", "root of the"):
        assert not re.search(rf"^{question}.*\]:", done.stderr, re.MULTILINE), question
    assert "forces of the shifts, N, likewise [" in done.stderr
    study = load_study("given")
    assert (study.clutch.dog.count, study.clutch.dog.backlash_angle / DEG) == pytest.approx((6, 25))
    drawn = 'mismatch_rpm = {distribution = "uniform", low = -25, high = 25}'
    assert drawn in Path("given/study.toml").read_text()
    # A refused value is asked with all others.
    command = ["init", "study", "--out", "again", *set_options(("operating.force_N=[100]",))]
    done = CliRunner().invoke(app, command, input=30 * "\n")
    before, after = done.stderr.split("your answers are kept")[:2]
    assert "forces of the shifts" not in before
    assert "forces of the shifts, N, likewise [100]:" in after


def test_answers_have_units_and_ranges(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A data sheet is typed as it stands; what it leaves open is asked again."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    lines = (
        "amt||12 bar|1.5 kN|40 ms||200 ms|-60 to 60 rpm|1500|36|sleeve|15\N{DEGREE SIGN}|15|"
        "|-3|\N{MINUS SIGN}3 deg|122|110|1|0.6 to 0.8 mm|1 deg|0.15|3.1 kg|0.35|45|6|1.2|3,200"
        "|3200 N m|1500 N m|58|9|600 to 1800||4|120|0.2|5e5|200 kg cm2|90 kN m/rad|"
    )
    typed = lines.replace("|", "\n") + "\n"
    done = CliRunner().invoke(app, ["init", "study", "--out", "sleeve"], input=typed)
    assert done.exit_code == 0, done.stderr
    for words in (
        "'bar' is no unit of this quantity; give it in N, pressure times area: 1 bar on 1 cm2 is",
        "3,200 may be 3200 or 3.2; write it without the comma",
        "the study has one value, so give its middle 0.7",
    ):
        assert words in done.stderr
    study = load_study("sleeve")
    assert study.clutch.drive.shaft_speed == pytest.approx(1200 * RPM)
    assert study.limits.sleeve == Sleeve()
    assert study.limits.manufacturing.rim == pytest.approx(9e-3)
    dog, load = study.clutch.dog, study.limits.load
    assert (dog.chamfer, dog.chamfer_back, dog.crest) == pytest.approx((15 * DEG, 15 * DEG, 0.5))
    assert dog.backlash == pytest.approx(DEG * 0.058)
    assert study.limits.tolerances.backlash == pytest.approx(1.5e-4)
    assert load.coast_share == pytest.approx(1500 / 3200)
    assert study.clutch.rings.mass == 3.1
    assert study.clutch.mechanism.added_mass == 1.2
    assert study.clutch.mechanism.ring_inertia == study.limits.strikes[0].ring_inertia == 0.02
    speeds = [point.mismatch / RPM for point in study.points]
    assert (len(speeds), study.forces) == (24, [1500.0])
    assert max(map(abs, speeds)) < 60.0
    # No draw has the ends of the range, which the strike is judged at.
    assert study.limits.strikes[0].mismatch == pytest.approx((-60 * RPM, 60 * RPM))


@pytest.mark.parametrize(
    ("text", "unit", "numbers"),
    [
        ("0,5", "mm", (0.5,)),
        ("1 cm", "mm", (10.0,)),
        ("25 kg mm²", "kg m2", (2.5e-5,)),
        ("1 N m/deg", "N m/rad", (1 / DEG,)),
        ("-500 250; 800", "1/min", (-500.0, 250.0, 800.0)),
        ("0.6..0.9 mm", "mm", (0.6, 0.9)),
    ],
)
def test_numbers_of_an_answer(text: str, unit: str, numbers: tuple[float, ...]) -> None:
    assert read_numbers(text, unit).numbers == pytest.approx(numbers)


@pytest.mark.parametrize("text", ["", "five", "nan", "5 to 3", "1 to 2 to 3", "1 2 to 3", "3 kg"])
def test_answers_that_are_refused(text: str) -> None:
    with pytest.raises(ds.InputError):
        read_numbers(text, "mm")


def test_a_flat_tip_takes_ridge_and_release_of_the_roof_along(dogshape: Call) -> None:
    flat = "dog.chamfer_deg=0", "dog.chamfer_back_deg=0"
    said, study = _begun(dogshape, *flat, origin="ev_disconnect")
    assert study.clutch.dog.crest == 1.0
    assert not study.limits.load.faces_release
    assert "load.faces_release False" in " ".join(said.json["assumed"])
    assert study.variables["chamfer_back_deg"] == (0.0, 25.0)
    shutil.rmtree("own")
    # A flat kind that is given a roof has a ridge, and faces that slide.
    _, roof = _begun(dogshape, "dog.chamfer_deg=12", "dog.chamfer_back_deg=12", origin="motorcycle")
    assert (roof.clutch.dog.crest, roof.limits.load.faces_release) == (0.5, True)


def test_a_mount_is_an_option(dogshape: Call) -> None:
    """And the sleeve of a copied study goes with its mount."""
    example = str(Path(__file__).parents[2] / "examples" / "sleeve.toml")
    for mount, begun in (("sleeve", "amt"), ("face", example)):
        said = dogshape("init", "study", "--like", begun, "--out", mount, "--yes", "--mount", mount)
        assert said.status == 0, said.err
        assert load_study(mount).file.dog.mount == mount
    assert load_study("face").limits.sleeve is None
    # Teeth of another ring have a height of their own.
    ring = ("dog.outer_diameter_mm=122", "dog.inner_diameter_mm=110", "dog.backlash_mm=1.4")
    said = dogshape("init", "study", "--like", example, "--out", "own", *set_options(ring), "--yes")
    assert said.status == 0, said.err
    assert load_study("own").limits.sleeve == Sleeve(speed=3000 * RPM)


def test_ranges_of_the_search_hold_the_own_dog(dogshape: Call) -> None:
    _, study = _begun(dogshape, "dog.traction_deg=-4.5", "dog.count=5", "dog.height_mm=7.5")
    wide = {name: study.variables[name] for name in ("traction_deg", "count", "height_mm")}
    assert wide == {"traction_deg": (-5.0, 30.0), "count": (5, 36), "height_mm": (1.6, 8.0)}
    assert study.variables["braking_deg"] == (4.0, 30.0)


def test_an_equal_value_of_the_user_has_no_source_of_the_kind(dogshape: Call) -> None:
    """Drag and torque are given with the numbers of the kind; the added mass is not given."""
    given_values = "mechanism.drag_torque_Nm=0.3", "load.torque_Nm=900.0"
    _begun(dogshape, *given_values, origin="ev_disconnect")
    lines = Path("own/study.toml").read_text().splitlines()
    assert "drag_torque_Nm = 0.3        # of the oil" in lines
    assert not any("assumption" in line for line in lines if line.startswith("[load]"))
    assert any(line.startswith("added_mass_kg") and "assumption" in line for line in lines)


def test_a_new_key_stands_before_the_comments_of_the_next_table(dogshape: Call) -> None:
    _begun(dogshape, "mechanism.friction_N=12")
    text = Path("own/study.toml").read_text()
    assert text.index("friction_N = 12") < text.index("# Friction of the dogs in the same range")


def _begun(dogshape: Call, *settings: str, origin: str = "mq200") -> tuple[CommandResult, Setup]:
    given = ("--yes", "--json", *set_options(settings))
    said = dogshape("init", "study", "--like", origin, "--out", "own", *given)
    assert said.status == 0, said.err
    return said, load_study("own")


def test_own_mismatch_and_force_replace_the_points_of_the_kind(
    dogshape: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    own = "operating.mismatch_rpm=[20, 50]", "operating.force_N=[600]"
    for origin in ("amt", "motorcycle"):
        sets = (*own[:1], "operating.force_N=[250]") if origin == "motorcycle" else own
        said, study = _begun(dogshape, *sets, origin=origin)
        assert [round(p.mismatch / RPM) for p in study.points] == [20, 50]
        assert "by values of yours: operating.points" in " ".join(said.json["assumed"])
        shutil.rmtree("own")
    # No number of the kind is hidden.
    points = "operating.points = [{mismatch_rpm = 20.0, force_N = 1000.0, weight = 4.0}, {"
    assert points in _begun(dogshape, origin="amt")[0].json["assumed"][0]
    assert len(load_study("ev_disconnect", [own[0], "operating.force_N=[320]"]).points) == 2
    said = dogshape("init", "study", "--like", "amt", "--yes", "--set", own[1])
    assert "remove one of the two (--set operating.points=), or set operating.mismatch_rpm and" in (
        said.sentence
    )
    with pytest.raises(ds.InputError, match=r'\{"operating.points": None\}'):
        ds.Study("amt", {"operating.force_N": [600.0]})
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(dialogue, "may_ask", lambda yes=False: not yes)
    # The forces of the kind at own mismatches, and own forces at the mismatches of the kind.
    cases = ("\n\n\n\n\n20 50\n", 4, [600.0, 1000.0]), ("\n500 900\n0.1 0.1\n", 16, [500.0, 900.0])
    for typed, n, forces in cases:
        given = f"amt\n{typed}" + 40 * "\n"
        done = CliRunner().invoke(app, ["init", "study", "--out", str(n)], input=given)
        study = load_study(str(n))
        assert (done.exit_code, len(study.points), study.forces) == (0, n, forces)


def test_what_the_user_did_not_give_is_named(dogshape: Call) -> None:
    """A differential lock from the MQ200: inertias, actuator and load are not its own."""
    said, _ = _begun(dogshape, *RING, "sliding.mass_kg=2.5", "load.torque_Nm=900")
    time, checks, *rest = said.json["assumed"]
    assert time.startswith("as in 'mq200', decides the shift time: shift.timeout_s = 1.0, shift.r")
    for words in ("sliding.inertia_kgm2 = 0.01", "output.inertia_kgm2 = 0.6048",
                  "actuation.force_N = [235.2, 315.5, 469.0, 641.5]"):  # fmt: skip
        assert words in time
    assert "decides the checks: load.application_factor = 1.5, load.coast_share" in checks
    assert "dog.count" not in time
    assert rest[0].startswith("as in 'mq200', keys of less influence: shift.seated_tolerance_mm = ")
    assert "tolerance.backlash_mm" not in rest[0]  # the file has none
    assert "manufacturing.module_mm = 1.25" in checks
    radius = "not given, by default: mechanism.spline_radius_mm = 49.6 (0.8 of the inner radius)"
    assert rest[1].startswith(radius)


RING = ("dog.outer_diameter_mm=140", "dog.inner_diameter_mm=124", "dog.count=30")


def test_what_follows_from_the_ring(dogshape: Call) -> None:
    """A truck's sleeve: spline, moving mass and limits are no longer the prototype's."""
    said, study = _begun(
        dogshape, *RING, "sliding.mass_kg=2.5", "load.torque_Nm=1500",
        "actuation.force_N=[1500]", "actuation.rise_s=[0.1]",
    )  # fmt: skip
    mechanism = study.clutch.mechanism
    assert mechanism.spline_radius == pytest.approx(0.8 * 0.062)
    assert (mechanism.added_mass, mechanism.drag_torque) == (0.0, 0.0)
    assert study.clutch.rings.mass == 2.5
    assert study.forces == [1500.0]
    # As high over the pitch as the prototype's dogs, 3.7 mm on 96 mm and 15 dogs.
    assert study.clutch.dog.height == pytest.approx(3.7e-3 * (264 / 30) / (96 / 15), rel=3e-3)
    # The force of a latch does not follow from the clutch that it has to hold.
    assert study.limits.load.separating_force_limit is None
    assert "load.separating_force_limit_N" in " ".join(said.json["assumed"])
    assert study.file.driveline.stiffness_Nm_rad is None
    assert study.file.search.limits == {"smallest_margin_statistical": 0.0}
    assert "search.limits.slower_than_reference_s" in " ".join(said.json["assumed"])
    text = Path("own/study.toml").read_text()
    # The output side is the prototype's.
    known = [one in text for one in ("4.98 squared", "prototype", "thesis table 2")]
    assert known == [True, False, False]


def test_comments_of_a_kind_go_with_its_numbers(dogshape: Call) -> None:
    own = "dog.backlash_mm=10.9", "output.inertia_kgm2=1.0", "load.accuracy=7"
    _begun(dogshape, *own, origin="motorcycle")
    text = Path("own/study.toml").read_text()
    kept = (bundled_root() / "motorcycle" / "study.toml").read_text()
    for words in ("17 deg", "260 kg at wheels"):
        assert words in kept
        assert words not in text
    # The meaning of a key is that of the study that explains the keys; what is not given stays.
    assert "accuracy = 7  # class of ISO 1328-1" in text
    assert "at wheels of 0.31 m" not in text
    assert "of the fork, which moves along; assumption" in text


def test_a_source_before_a_key_goes_with_its_number(dogshape: Call) -> None:
    _begun(dogshape, "strike.ring_inertia_kgm2=0.0004")
    text = Path("own/study.toml").read_text()
    assert "ring alone, 0.3 kg at 24 mm" not in text
    assert "steel shaft of 22 mm" in text


def test_the_ring_of_shifts_follows_a_strike_that_does_not_hold_it(dogshape: Call) -> None:
    said, study = _begun(dogshape, "strike.ring_inertia_kgm2=[0.001, 0.004]")
    assert study.clutch.mechanism.ring_inertia == 0.002
    assert "mechanism.ring_inertia_kgm2 0.002" in " ".join(said.json["assumed"])
    shutil.rmtree("own")
    _, held = _begun(dogshape, "strike.ring_inertia_kgm2=[0.0004, 0.004]")
    assert held.clutch.mechanism.ring_inertia == 0.0005


def test_a_strike_of_ones_own_stays_with_another_ring(dogshape: Call) -> None:
    """A strike replaces that of the kind; half of a strike is refused."""
    given = "strike.ring_inertia_kgm2=[0.002, 0.008]", "strike.input_stiffness_Nm_rad=1e5"
    _, study = _begun(dogshape, *RING, *given, "strike.backlash_deg=0.4")
    assert len(study.limits.strikes) == 2
    assert study.limits.strikes[0].input_stiffness == 1e5
    said = dogshape("init", "study", "--out", "half", "--yes", *set_options((*RING, given[0])))
    assert "strike.input_stiffness_Nm_rad" in said.sentence


def test_given_values_do_not_follow(dogshape: Call) -> None:
    _, study = _begun(
        dogshape, *RING, "dog.height_mm=5", "sliding.mass_kg=2.5", "mechanism.added_mass_kg=0.4",
        "mechanism.spline_radius_mm=40", "mechanism.drag_torque_Nm=0.3",
        "load.separating_force_limit_N=9000", "search.limits.slower_than_reference_s=0.01",
        "variables.count=[20, 40]",
    )  # fmt: skip
    mechanism = study.clutch.mechanism
    assert (mechanism.added_mass, mechanism.drag_torque) == (0.4, 0.3)
    assert mechanism.spline_radius == pytest.approx(0.04)
    assert study.clutch.dog.height == pytest.approx(5e-3)
    assert study.limits.load.separating_force_limit == 9000.0
    assert study.file.search.limits["slower_than_reference_s"] == 0.01
    assert study.variables["count"] == (20, 40)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (("dog.count=40",), "tip at the inner radius is 0.5872 mm, but it must be at least 1.5 mm"),
        (("dog.chamfer_deg=4",), "your own dog fails chamfer_release"),
        (("variables.count=[20, 30]",), "does not hold your own 15"),
        (("load.torque_Nm=0.2",), "is load.torque_Nm in N m?"),
    ],
)
def test_a_limit_that_the_own_dog_breaks_is_said(
    dogshape: Call, settings: tuple[str, ...], words: str
) -> None:
    said, _ = _begun(dogshape, *settings)
    assert words in " ".join(said.json["warnings"])


def test_shafts_of_a_gearbox_are_not_those_of_a_stand(dogshape: Call) -> None:
    """A study of a stand's clutch has its standing ring, and a bench of a gearbox' clutch too."""
    _, study = _begun(dogshape, origin="mq200_stand")
    assert not study.clutch.drive.turns
    assert load_study("mq200").clutch.drive.turns
    said = dogshape("init", "bench", "--from", "mq200", "--out", "stand", "--yes", "--json")
    assert said.status == 0, said.err
    assert "turn at 2000 1/min" in " ".join(said.json["assumed"])
    assert load_bench("stand").clutch.drive == Drive()


def test_values_that_nobody_gave_count_until_edited_or_confirmed(dogshape: Call) -> None:
    _, study = _begun(dogshape, "dog.count=20", "actuation.kind=motor", "actuation.lead_mm=4")
    assumed = {value.key: value for value in study.assumed_values({})}
    assert assumed["actuation.stall_torque_Nm"].source == "example of actuation.kind = 'motor'"
    assert assumed["load.torque_Nm"].source == "as in 'mq200'"
    assert assumed["dog.backlash_mm"].value is None
    assert "'mq200'" in assumed["operating.force_N"].source
    assert not assumed.keys() & {"dog.count", "actuation.kind", "actuation.lead_mm"}
    assert not any(key.startswith(("search", "variables", "expectation")) for key in assumed)
    chosen = {value.key for value in study.assumed_values({"height_mm": 3.0})}
    assert assumed.keys() - chosen == {"dog.height_mm"}

    edited = load_study("own", {"actuation.stall_torque_Nm": 0.9, "dog.backlash_mm": 0.2})
    left = {value.key for value in edited.assumed_values({})}
    assert assumed.keys() - left == {"actuation.stall_torque_Nm", "dog.backlash_mm"}
    assert load_study("own").config_hash == study.config_hash

    path = Path("own/study.toml")
    lines = path.read_text().splitlines(keepends=True)
    confirmed = [line for line in lines if '{key = "load.torque_Nm"' not in line]
    path.write_text("".join(confirmed))
    left = {value.key for value in load_study("own").assumed_values({})}
    assert assumed.keys() - left == {"load.torque_Nm"}
    assert load_study("own").config_hash == study.config_hash

    path.write_text("".join(confirmed).replace('"load.shifts"', '"load.shift"'))
    with pytest.raises(InputError, match=r"the key load\.shift, which no study file has"):
        load_study("own")


def test_a_copy_keeps_the_source_of_an_example(dogshape: Call) -> None:
    _begun(dogshape, "actuation.kind=spring")
    said = dogshape("init", "study", "--like", "own", "--out", "second", "--yes")
    assert said.status == 0, said.err
    sources = {value.key: value.source for value in load_study("second").assumed_values({})}
    assert sources["actuation.preload_N"] == "example of actuation.kind = 'spring'"

    path = Path("own/study.toml")
    path.write_text(path.read_text().replace("preload_N = 300.0", "preload_N = 310.0", 1))
    said = dogshape("init", "study", "--like", "own", "--out", "third", "--yes")
    assert said.status == 0, said.err
    sources = {value.key: value.source for value in load_study("third").assumed_values({})}
    assert sources["actuation.preload_N"] == "as in 'own'"


def test_verdict_and_sheet_name_the_values_that_nobody_gave(dogshape: Call) -> None:
    _, study = _begun(dogshape, "actuation.kind=spring", "expectation.angles=3")
    count = len(study.assumed_values({}))
    checked = dogshape("check", "own", "--json")
    verdict = json.loads(checked.out)["verdict"]
    assert f"under {count} assumed values" in verdict["line"]
    assert len(verdict["assumed"]) == count
    assert verdict["hangs"]["low"] <= verdict["hangs"]["share"] <= verdict["hangs"]["high"]
    printed = dogshape("check", "own").out
    example = "not given, actuation, example of actuation.kind = 'spring': preload_N = 300, "
    assert example in printed
    assert "not given, contact, as in 'mq200': set = " in printed
    others = re.search(r"not given, other tables: (\d+) more, listed in \[assumed\] of ", printed)
    assert others is not None
    tables = [value.key.partition(".")[0] for value in study.assumed_values({})]
    assert int(others.group(1)) == len([table for table in tables if table not in LISTED_TABLES])
    assert dogshape("export", "own", "--sheet", "sheet.html").status == 0
    page = Path("sheet.html").read_text()
    assert "Values that nobody gave" in page
    assert "preload_N = 300" in page
    assert f"under {count} assumed values" in page
