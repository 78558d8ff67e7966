"""``init``: folders to begin with, and tables of a stand in any layout."""

from __future__ import annotations

import csv
import hashlib
import shutil
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

import dogshape as ds
from dogshape.cli.app import app
from dogshape.cli.verbs import init as verbs
from dogshape.diagnosis.bench.bench_data import load_bench
from dogshape.diagnosis.bench.stand_file import BenchRecord
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, build_study, load_study
from dogshape.pipeline.config.toml_text import SOURCE
from dogshape.pipeline.diagnose.study_keys import study_of
from dogshape.sim.clutch_tables import validate
from dogshape.sim.units import RPM
from dogshape.sim.versions import bundled_root
from tests.benches import GOOD
from tests.conftest import Call, Said, sets

FOREIGN = """\
Prüfstand 7;;;;;
Datum;23.11.2026;;;;

Nr.;Drehzahldifferenz [1/min];F_shift (kN);t_shift ms;Anzahl;i.O.
1;50;0,469;190,5;10;ja
2;100;0,469;180;10;ja
3;149;0,6415;170,25;10;ja
4;249;0,6415;1000;10;nein
"""


def test_what_no_table_shows_is_unknown_until_it_is_stated(dogshape: Call) -> None:
    Path("m.csv").write_text("dn;F;t [ms]\n50;469;190\n5;469;\n")
    said = dogshape("init", "bench", "m.csv", "--json")
    assumed = " ".join(said.json["assumed"])
    assert "--set record.time_zero=command, or force, states it" in assumed
    assert "--set record.displacement_at=sleeve, or actuator, states it" in assumed
    assert "record.empty_cells says whether they were tried" in assumed
    assert load_bench("m").record == BenchRecord(sense="unknown")
    stated = ("time_zero=force", "displacement_at=sleeve", "empty_cells=failed", "sense=known")
    options = sets([f"record.{one}" for one in stated])
    said = dogshape("init", "bench", "m.csv", "--out", "n", *options, "--json")
    assert "unknown" not in " ".join(said.json["assumed"])
    assert load_bench("n").record == BenchRecord(
        time_zero="force", displacement_at="sleeve", empty_cells="failed", sense="known"
    )
    assert [cell.failed for cell in load_bench("n").cells] == [0, 1]


@pytest.mark.parametrize("coding", ["utf-8-sig", "utf-16", "cp1252"])
def test_a_foreign_table_becomes_a_data_set(dogshape: Call, coding: str) -> None:
    Path("m.csv").write_bytes(FOREIGN.encode(coding))
    said = dogshape("init", "bench", "m.csv", "--json")
    assert said.status == 0
    bench = load_bench("m")
    rows = [(r.point.mismatch / RPM, r.point.profile.force, r.point.profile.rise, r.n, r.time)
            for r in bench.readings]  # fmt: skip
    assert rows == [
        (pytest.approx(50.0), 469.0, pytest.approx(0.1766), 10, pytest.approx(0.1905)),
        (pytest.approx(100.0), 469.0, pytest.approx(0.1766), 10, pytest.approx(0.18)),
        (pytest.approx(149.0), 641.5, pytest.approx(0.12614), 10, pytest.approx(0.17025)),
        (pytest.approx(249.0), 641.5, pytest.approx(0.12614), 10, None),
    ]
    assert [r.engaged for r in bench.readings] == [True, True, True, False]
    assert hashlib.sha256(Path("m.csv").read_bytes()).hexdigest()[:16] in bench.source
    assert Path("m/as_measured/m.csv").read_bytes() == Path("m.csv").read_bytes()
    assumed = " ".join(said.json["assumed"])
    assert "rises in 0.12614 to 0.1766 s" in assumed
    assert "left out (row 8)" in assumed
    Path("m/notes.txt").write_text("mine")
    assert "holds files already" in dogshape("init", "bench", "m.csv").sentence
    assert dogshape("init", "bench", "m.csv", "--force").status == 0
    assert Path("m/notes.txt").read_text() == "mine"


def test_every_fault_is_told_at_once(dogshape: Call) -> None:
    Path("m.csv").write_text(
        "dn_rpm;F (kN);t_mean_ms;n;ok\n50;0,469;190;10;ja\nfifty;;180;2,5;vielleicht\n"
        "149;0.6415;170,25;10;nein\n"
    )
    said = dogshape("init", "bench", "m.csv")
    assert said.status == 2
    for words in (
        "5 mistakes", "row 3: 'fifty'", "(force_N) is empty in row 3", "row 3: 2.5",
        "row 3: 'vielleicht'", "with a comma ('0,469', row 2) and with a point ('0.6415', row 4)",
    ):  # fmt: skip
        assert words in said.err
    assert "Traceback" not in said.err
    assert not Path("m").exists()
    assert sorted(p.name for p in Path().iterdir()) == ["m.csv"]


def test_without_a_table_a_folder_is_to_be_filled(dogshape: Call) -> None:
    said = dogshape("init", "bench")
    assert said.status == 0
    assert "fill in shifts.csv" in said.out
    assert len(load_bench("my_bench").cells) == 28


def test_traces_of_a_foreign_table_come_along(dogshape: Call) -> None:
    one = next(
        row
        for row in csv.DictReader((GOOD / "shifts.csv").read_text().splitlines())
        if row["trace"]
    )
    heads = {"t_s": "Zeit [s]", "displacement_mm": "Weg [m]", "force_N": "Kraft [kN]",
             "sliding_speed_rpm": "Antriebsdrehzahl [1/min]",
             "output_speed_rpm": "Abtriebsdrehzahl [1/min]"}  # fmt: skip
    trace = pd.read_csv(GOOD / one["trace"])[[*heads]]
    trace[["displacement_mm", "force_N"]] /= 1e3
    trace.rename(columns=heads).to_csv("t1.csv", index=False)
    row = (one[name] for name in ("mismatch_rpm", "force_N", "force_rise_s", "shift_time_s"))
    Path("m.csv").write_text(f"dn_rpm,force_N,rise_s,t_s,Datei\n{','.join(row)},t1.csv\n")
    said = dogshape("init", "bench", "m.csv", "--from", str(GOOD))
    assert said.status == 0, said.err
    found, wanted = (next(r.trace for r in load_bench(where).readings if r.trace is not None)
                     for where in ("m", GOOD))  # fmt: skip
    assert found.displacement == pytest.approx(wanted.displacement, rel=1e-6, abs=1e-9)
    assert found.force == pytest.approx(wanted.force, rel=1e-6)


def test_a_bench_from_a_study_has_its_contact_and_what_moves_with_the_ring(dogshape: Call) -> None:
    Path("m.csv").write_bytes(FOREIGN.encode())
    said = dogshape("init", "bench", "m.csv", "--from", "mq200", "--json")
    assert said.status == 0, said.err
    bench, study = load_bench("m"), load_study("mq200")
    assert bench.clutch.rings.mass == pytest.approx(0.3 + 0.3)
    assert replace(bench.clutch.contact, name=study.clutch.contact.name) == study.clutch.contact
    assumed = " ".join(said.json["assumed"])
    assert "0.3 kg of the [mechanism] of 'mq200' move with the ring" in assumed
    assert "friction, drag and linkage are left for the diagnosis" in assumed
    again = build_study(validate(StudyFile, study_of(bench, "back"), "back"))
    assert again.clutch.contact.stiffness == study.clutch.contact.stiffness
    assert again.clutch.contact.dissipation == study.clutch.contact.dissipation


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
    assert dogshape("init", "study", "--out", "plain").status == 0
    assert load_study("plain").physics_hash == load_study("mq200").physics_hash


def test_in_a_terminal_it_asks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(verbs, "may_ask", lambda yes: not yes)
    # Actuator; points, at once refused; actuator and points again; dogs, ring and what turns with
    # it; height, torque; toothing, drag, latch, torque left, steel.
    answers = "\n1500 0,1 1 0,2 50 1600 1500 0,1 2 0,2 50 1500 30 8 12 22 140 124 1 0,2 2,5"
    typed = f"{answers} 0,05 0,6 5 1500  0,8 9000 0,1 1e6 steel 20MnCr5".replace(" ", "\n")
    done = CliRunner().invoke(app, ["init", "study", "--out", "mine"], input=typed)
    assert done.exit_code == 0, done.stderr
    study = load_study("mine")
    dog, mechanism = study.clutch.dog, study.clutch.mechanism
    assert (dog.count, dog.height, dog.backlash) == pytest.approx((30, 5e-3, 2e-4))
    assert mechanism.spline_radius == pytest.approx(0.8 * 0.062)
    assert (mechanism.drag_torque, study.limits.material.name) == (0.8, "20MnCr5")
    load = study.limits.load
    given = study.clutch.timeout, load.separating_force_limit, load.pull_out_share, load.shifts
    assert given == (2.0, 9000.0, 0.1, 1e6)
    for words in (
        "kinds of clutch: amt (30 dogs, 140/124 mm, 2500 N m)", "height of the dogs, mm [5.09]:",
        "chamfer of the face, deg (the MQ200 prototype, thesis table 5) [8]:",
        "slides on, mm (0.8 of the inner radius) [49.6]:", "N m (none, an assumption) [0]:",
        "mq200_three (15 dogs, 52/44 mm, 200 N m)\n", "ring is pulled out (all of it) [1]:",
        "give one of 16MnCr5, 20MnCr5", "forces of the shifts, N [1500]:",
        "shift force is 1600 N, but the study has a rise time for 1500 N alone",
    ):  # fmt: skip
        assert words in done.stderr
    # The same clutch again by twenty times return: toothing and drag are its own.
    done = CliRunner().invoke(app, ["init", "study", "--out", "same"], input=30 * "\n")
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


def _begun(dogshape: Call, *settings: str, origin: str = "mq200") -> tuple[Said, Setup]:
    given = ("--yes", "--json", *sets(settings))
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
    assert "operating.points = 8 values" in _begun(dogshape, origin="amt")[0].json["assumed"][0]
    assert len(load_study("ev_disconnect", [own[0], "operating.force_N=[320]"]).points) == 2
    said = dogshape("init", "study", "--like", "amt", "--yes", "--set", own[1])
    assert "remove one of the two (--set operating.points=), or set operating.mismatch_rpm and" in (
        said.sentence
    )
    with pytest.raises(ds.InputError, match=r'\{"operating.points": None\}'):
        ds.Study("amt", {"operating.force_N": [600.0]})
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(verbs, "may_ask", lambda yes: not yes)
    # The forces of the kind at own mismatches, and own forces at the mismatches of the kind.
    cases = ("\n\n\n\n20 50\n", 4, [600.0, 1000.0]), ("500 900\n0.1 0.1\n", 16, [500.0, 900.0])
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
    assert rest[0].startswith("as in 'mq200', keys of less influence: 2 of [shift]")


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
    assert study.file.search.limits == {"smallest_margin_worst": 0.0}
    assert "search.limits.slower_than_reference_s" in " ".join(said.json["assumed"])
    text = Path("own/study.toml").read_text()
    # The output side is the prototype's.
    known = [one in text for one in ("4.98 squared", "prototype", "thesis table 2")]
    assert known == [True, False, False]


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


SERIES = """\
Lfd. Nr.;Datum Uhrzeit;dn [1/min];F [N];Schaltzeit [ms];Standardabweichung [ms];Anzahl
2;31.05.2024 14:06:00;50;469;190,5;12,5;10
1;31.05.2024 14:05:00;100;469;180;9;10
3;31.05.2024 14:07:30;149;641,5;170,25;;1
"""


def test_spread_order_and_time_stamps_of_a_foreign_table_come_along(dogshape: Call) -> None:
    Path("m.csv").write_text(SERIES)
    said = dogshape("init", "bench", "m.csv", "--json")
    assert said.status == 0
    readings = load_bench("m").readings
    assert [r.sd for r in readings] == [pytest.approx(0.0125), pytest.approx(0.009), None]
    assert [r.place for r in readings] == [2.0, 1.0, 3.0]
    lines = Path("m/shifts.csv").read_text().splitlines()
    assert lines[0].endswith("trace,shift_time_sd_s,order,timestamp")
    assert lines[1].endswith(",0.0125,2,2024-05-31T14:06:00+00:00")
    assert "'Lfd. Nr.' is the order of the shifts" in " ".join(said.json["assumed"])
    taken = {row["quantity"]: row["unit"] for row in said.json["columns"]}
    assert (taken["shift_time_sd_s"], taken["order"], taken["timestamp"]) == ("ms", None, None)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("31.05.2024 14:07:30", "14:07", "has '14:07', which is no date and time as"),
        ("31.05.2024 14:07:30", "", "column timestamp is '', but it must be filled"),
        ("31.05.2024 14:07:30", "5", "timestamp=- to leave it out"),
        ("\n3;", "\n2;", "has a number twice, so it is no place in the whole series"),
    ],
)
def test_what_cannot_be_read_of_a_series_is_asked_about(
    dogshape: Call, old: str, new: str, words: str
) -> None:
    Path("m.csv").write_text(SERIES.replace(old, new))
    said = dogshape("init", "bench", "m.csv")
    assert said.status == 2
    assert words in said.err
    out = ("--column", "order=-", "--column", "timestamp=-")
    assert dogshape("init", "bench", "m.csv", *out).status == 0
    assert [r.place for r in load_bench("m").readings] == [None] * 3
