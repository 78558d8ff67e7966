"""The command line ``dogshape``: verbs, their options and what they print.

Exit status 0 done, 1 the answer is no, 2 bad input, 130 stopped by Ctrl-C.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from diagnosis.bench import load_bench
from diagnosis.comparison import ANGLES, compare
from pipeline import tables
from pipeline.animation import write_animation, write_trace
from pipeline.config import Study, load_study, profile_for
from pipeline.console import emit, verb
from pipeline.evaluation import expectation_of
from pipeline.executor import scratch_executor
from pipeline.folder import StudyFolder
from pipeline.precision import FIRST, expect_to
from pipeline.progress import ShiftProgress
from pipeline.report import write_report
from pipeline.study import Run, check_record, expectation_record, fit_study, run_study
from sim.batch import Block, even_blocks, events_record, loads_record, versions
from sim.checks import feasible
from sim.clutch import OperatingPoint
from sim.engagement import engage
from sim.errors import InputError, refusal, require_between
from sim.expectation import Expectation
from sim.manufacture import require_makeable
from sim.numerical import CHECKED, LEAST, numerical_error
from sim.plant import ClutchPlant
from sim.strength import strength_checks
from sim.units import DEG, RPM
from surrogate.query import ask
from surrogate.store import load

app = typer.Typer(
    name="dogshape",
    help="Simulate, search and check the shape of the dogs of a dog clutch.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)

StudyArg = Annotated[
    str, typer.Argument(metavar="STUDY", help="TOML file, folder with study.toml, or bundled name")
]
Sets = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="override a key, e.g. dog.chamfer_deg=14"),
]
Json = Annotated[bool, typer.Option("--json", help="print one JSON document")]
Jobs = Annotated[int, typer.Option("--jobs", min=0, help="worker processes, 0: one a core")]
Mismatch = Annotated[float, typer.Option(help="output less sliding speed before the shift")]
Force = Annotated[float, typer.Option("--force-N", help="final shift force")]
Rise = Annotated[float | None, typer.Option(help="rise time; default: the study's table")]


def _print_version(wanted: bool) -> None:
    if wanted:
        print(f"dogshape {versions()['dogshape']}, drake {versions()['drake']}")
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="and exit")
    ] = False,
) -> None:
    """Simulate, search and check the shape of the dogs of a dog clutch."""


@app.command()
@verb
def shift(
    study: StudyArg,
    mismatch_rpm: Mismatch,
    force_N: Force,
    relative_angle_deg: Annotated[
        float, typer.Option(help="lead of the output ring over dogs facing dogs")
    ],
    force_rise_s: Rise = None,
    all_dogs: Annotated[bool, typer.Option("--all-dogs", help="model every dog")] = False,
    html: Annotated[Path | None, typer.Option(help="write an animation with its curves")] = None,
    trace: Annotated[Path | None, typer.Option(help="write the time series as CSV")] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Simulate one engagement.

    Example: dogshape shift mq200 --mismatch-rpm 50 --force-N 469 --relative-angle-deg 10
    """
    if html is not None and html == trace:
        raise InputError(f"--html and --trace both name {html}; give two files")
    given = load_study(study, set_)
    require_makeable(given.clutch.dog, given.limits.manufacturing)
    solver = replace(given.clutch.solver, all_dogs=all_dogs)
    clutch = replace(given.clutch, solver=solver)
    point = _point(given, mismatch_rpm, force_N, force_rise_s)
    if not abs(relative_angle_deg) <= 1e6:
        rule, remedy = "it must be a finite angle", "give an angle in degrees"
        raise InputError(refusal("relative angle", relative_angle_deg, "deg", rule, remedy))
    result = engage(ClutchPlant(clutch), point, relative_angle_deg * DEG)
    peak = given.torque_peak(result.loads.residual_mismatch)
    if html is not None:
        write_animation(result, html, peak)
    if trace is not None:
        write_trace(result, trace)
    data = {
        "outcome": result.outcome.value,
        "shift_time_s": result.shift_time,
        "phases": [{"name": p.name, "start": p.start, "end": p.end} for p in result.phases],
        "peak_axial_force_N": result.loads.peak_axial_force,
        "events": events_record(result),
        "loads": {**loads_record(result), "torque_peak_Nm": peak},
        "detail": result.detail,
        "solver": {
            "scheme": solver.scheme,
            "accuracy": solver.accuracy,
            "max_step_s": solver.max_step,
            "steps": result.steps,
            "evaluations": result.evaluations,
            "dogs": clutch.dog.count if all_dogs else 1,
            "contact_set": clutch.contact.name,
        },
    }
    emit(data, json, lambda: tables.shift_table(result, peak))


def _point(study: Study, mismatch: float, force: float, rise: float | None) -> OperatingPoint:
    return OperatingPoint(mismatch * RPM, profile_for(study.file, force, rise))


@app.command()
@verb
def expect(
    study: StudyArg,
    mismatch_rpm: Annotated[float | None, typer.Option(help="one operating point only")] = None,
    force_N: Annotated[float | None, typer.Option("--force-N", help="with --mismatch-rpm")] = None,
    force_rise_s: Rise = None,
    angles: Annotated[
        str | None,
        typer.Option(help="how many evenly spaced ones, or relative angles in degrees: A,B,C"),
    ] = None,
    precision: Annotated[
        float | None, typer.Option(help="wanted relative standard error, e.g. 0.01; finds N")
    ] = None,
    set_: Sets = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Expected shift time over the relative angle.

    Example: dogshape expect mq200 --mismatch-rpm 50 --force-N 469 --angles 24
    """
    given = load_study(study, set_)
    require_makeable(given.clutch.dog, given.limits.manufacturing)
    if (mismatch_rpm is None) != (force_N is None):
        raise InputError("one operating point needs --mismatch-rpm and --force-N; give both")
    if force_rise_s is not None and force_N is None:
        raise InputError("--force-rise-s goes with one operating point; give its speed and force")
    points = given.points
    if mismatch_rpm is not None and force_N is not None:
        points = (_point(given, mismatch_rpm, force_N, force_rise_s),)
    if precision is not None:
        if angles is not None:
            raise InputError("--precision finds the number of angles itself; leave out --angles")
        require_between("--precision", precision, 1e-3, 1.0, "give for instance 0.01")
        result = _expect_to(given, points, precision, jobs)
    else:
        result = _expect_at(given, points, angles, jobs)
    emit(expectation_record(result), json, lambda: tables.expectation_table(result))


def _expect_to(
    given: Study, points: tuple[OperatingPoint, ...], precision: float, jobs: int
) -> Expectation:
    with ShiftProgress(FIRST * len(points)) as progress:
        executor = scratch_executor(jobs, progress.advance)
        precise = expect_to(given, points, precision, executor, progress)
        error = numerical_error(precise.blocks, precise.rows, executor.run)
    return replace(precise.expectation, numerical_error=error)


def _expect_at(
    given: Study, points: tuple[OperatingPoint, ...], angles: str | None, jobs: int
) -> Expectation:
    count, listed = _angles(angles, given.file.expectation.angles)
    if listed:
        blocks = [Block(given.clutch, point, listed) for point in points]
    else:
        blocks = even_blocks(given.clutch, points, count, given.file.expectation.seed)
    shifts = sum(len(b.angles) for b in blocks)
    with ShiftProgress(shifts + max(LEAST, shifts // CHECKED)) as progress:
        executor = scratch_executor(jobs, progress.advance)
        rows = executor.run(blocks)
        error = numerical_error(blocks, rows, executor.run)
    result = expectation_of(given, points, rows, even=not listed)
    return replace(result, numerical_error=error)


def _angles(text: str | None, default: int) -> tuple[int, tuple[float, ...]]:
    """Return how many angles, and the angles in rad where they are listed."""
    if text is None:
        return default, ()
    try:
        if "," in text:
            listed = tuple(float(part) * DEG for part in text.split(","))
            if all(abs(angle) < 1e4 for angle in listed):
                return len(listed), listed
        elif 1 <= int(text) <= 100_000:
            return int(text), ()
    except ValueError:
        pass
    raise InputError(
        f"--angles is '{text}', but it must be a whole number from 1 to 100000 "
        "or a list of angles in degrees; write for instance 24 or 0,6,12,18"
    )


@app.command()
@verb
def strength(study: StudyArg, set_: Sets = None, json: Json = False) -> None:
    """Strength, self-locking and manufacturability of one design.

    Example: dogshape strength mq200 --set dog.height_mm=3.2
    """
    given = load_study(study, set_)
    checks = strength_checks(given.clutch.dog, given.limits)
    passed = feasible(checks)
    data = {"feasible": passed, "checks": [check_record(c) for c in checks]}
    emit(data, json, lambda: tables.checks_table(checks))
    if not passed:
        raise typer.Exit(1)


@app.command()
@verb
def study(
    study: StudyArg,
    out: Annotated[Path | None, typer.Option(help="default: results/NAME")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="designs to propose")] = None,
    jobs: Jobs = 0,
    seed: Annotated[int | None, typer.Option(min=0, help="of the search")] = None,
    storage: Annotated[str | None, typer.Option(help="Optuna URL instead of a journal")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="go on if there is a study")] = False,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Search for the best shape, then write the report.

    Example: dogshape study mq200 --out results/mq200 --trials 48
    """
    overrides = list(set_ or [])
    overrides += [f"search.trials={trials}"] if trials is not None else []
    overrides += [f"search.seed={seed}"] if seed is not None else []
    given = load_study(study, overrides)
    folder = StudyFolder(out or _default_out(given))
    result = run_study(given, Run(folder, jobs, storage, resume))
    keys = ("best", "front", "n_simulated_shifts", "n_simulated_designs", "confirmation")
    data = {key: result[key] for key in keys} | {"report": str(folder.report)}
    emit(data, json, lambda: tables.study_table(given, result, folder.report))
    if result["best"] is None:
        raise typer.Exit(1)


def _default_out(given: Study) -> Path:
    return Path("results") / given.name


@app.command()
@verb
def report(
    directory: Annotated[Path, typer.Argument(metavar="DIR", help="folder of a study")],
    json: Json = False,
) -> None:
    """Write the report again from what a study stored.

    Example: dogshape report results/mq200
    """
    path = write_report(StudyFolder(directory))
    emit({"report": str(path)}, json, lambda: f"report: {path}")


@app.command()
@verb
def fit(
    where: Annotated[str, typer.Argument(metavar="STUDY|DIR", help="study, or folder of one")],
    out: Annotated[Path | None, typer.Option(help="default: surrogate.json of the folder")] = None,
    jobs: Jobs = 0,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Fit the surrogate and validate it on designs held out.

    A folder of a study is fitted as it is. For a study without results, designs
    that fill the space are simulated first into results/NAME-space.

    Example: dogshape fit results/mq200
    """
    folder = StudyFolder(Path(where))
    given = None
    if folder.manifest.is_file() and set_:
        raise InputError(
            "--set cannot change a study that was run; leave it out, or name the study"
        )
    if not folder.manifest.is_file():
        given = load_study(where, set_)
        folder = StudyFolder(Path("results") / f"{given.name}-space")
    validation, path = fit_study(folder, given, out, jobs)
    data = {**validation.as_dict(), "file": str(path)}
    emit(data, json, lambda: tables.validation_text(validation, path))


@app.command()
@verb
def check(
    study: StudyArg,
    surrogate: Annotated[
        Path | None, typer.Option(help="default: results/NAME/surrogate.json")
    ] = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Quick check of one design, without simulating it.

    Example: dogshape check mq200 --set dog.chamfer_deg=14 --set dog.count=18
    """
    given = load_study(study, set_)
    model, validation = load(surrogate or StudyFolder(_default_out(given)).surrogate)
    answer = ask(model, given.prototype, given.physics_hash)
    checks = strength_checks(given.clutch.dog, given.limits)
    data = {
        "expected_shift_time_s": answer.time,
        "low_s": answer.low,
        "high_s": answer.high,
        "in_range": answer.in_range,
        "q2": validation.q2,
        "warnings": list(answer.warnings),
        "feasible": feasible(checks),
        "checks": [check_record(c) for c in checks],
    }
    emit(data, json, lambda: tables.answer_text(answer, validation, checks))
    if not feasible(checks):
        raise typer.Exit(1)


@app.command()
@verb
def validate(
    bench: Annotated[str, typer.Argument(metavar="BENCH_DIR", help="folder of a data set")],
    angles: Annotated[
        str | None,
        typer.Option(help="how many, or angles A,B,C in degrees; default: the set's own, or 16"),
    ] = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Simulate the operating points of a bench data set and compare.

    Example: dogshape validate mq200_adams
    """
    given = load_bench(bench)
    count, listed = _angles(angles, ANGLES)
    if len(listed or range(count)) < 3:
        raise InputError(
            f"--angles is '{angles}', but a comparison needs at least three; give more"
        )
    chosen = None if angles is None else listed or count
    own = given.relative_angles if angles is None else None
    shifts = len(given.cells) * len(listed or own or range(count))
    with ShiftProgress(shifts + max(LEAST, shifts // CHECKED)) as progress:
        run = scratch_executor(jobs, progress.advance).run
        result = compare(given, run, chosen, checked=True)
    data = {
        "name": given.name,
        "points": [tables.difference_record(d) for d in result.differences],
        "rmse_s": result.rmse,
        "relative_rms": result.relative_rms,
        "numerical_error_s": result.numerical_error,
    }
    emit(data, json, lambda: tables.comparison_table(result))
