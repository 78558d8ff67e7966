"""Verbs on a study, its results or a bench; each loads its modules when it is called."""

from __future__ import annotations

import shlex
from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from typer import Argument, Option, echo

import dogshape as ds
from dogshape.cli.options import (
    BenchArg,
    Cluster,
    Corrections,
    Engine,
    Jobs,
    Journal,
    Json,
    OneForce,
    OneMismatch,
    Rise,
    Sets,
    StudyArg,
    SurrogateFile,
    angles_of,
    emit,
    run_arguments,
    show,
    warn,
)
from dogshape.sim.errors import InputError, require_between
from dogshape.sim.files import name_file_in_errors
from dogshape.sim.units import MM

if TYPE_CHECKING:
    from dogshape.pipeline.config.study_file import Setup

Ring = Literal["sliding", "output"]
Explain = Annotated[bool, Option("--explain", help="formulas, sources, keys")]
TABLES = (".csv", ".xlsx")
TITLE_HELP = "value of the title block"
ENDINGS = {
    "--stl": (".stl",),
    "--step": (".step", ".stp"),
    "--svg": (".svg",),
    "--dxf": (".dxf",),
    "--sheet": (".html", ".json"),
    "--report": (".html", ".htm"),
    "--trace": TABLES,
    "--fmu": (".fmu",),
    "--map": (".csv",),
}
#: Words for the files of ``export``.
FILE_LABELS = {
    "svg": "drawing",
    "dxf": "section of both rings",
    "stl": "one ring, both are alike",
    "step": "both rings",
    "sheet": "data sheet",
    "fmu": "FMI {fmi}.0 co-simulation",
    "map": "map over mismatch, force and angle",
}


def _named_study(name: str, settings: list[str]) -> ds.Study:
    """Load a study by name, file or results, or a searched design as FOLDER#N or STUDY#N."""
    from dogshape.pipeline.config.study_file import settings_of  # noqa: PLC0415
    from dogshape.pipeline.reports.named_design import named_design  # noqa: PLC0415
    from dogshape.pipeline.store.folder import StudyFolder  # noqa: PLC0415

    folder = StudyFolder(Path(name))
    if folder.manifest.is_file():
        return ds.Study.from_config(folder.stored_study()).replace_keys(settings_of(settings))
    if "#" not in name or Path(name).exists():
        return ds.Study(name, settings)
    return ds.Study.from_config(named_design(name, settings, chosen=False).prototype_study)


def _warn_of_doubts(study: ds.Study, angles: Collection[float] = ()) -> None:
    """Warn of units in doubt, of slides that lose power, and of angles beyond a pitch, deg."""
    from dogshape.pipeline.simulate.plausibility import angle_notes, slide_notes, slips_of  # noqa: PLC0415

    config = study.config
    warn([*slips_of(config), *slide_notes(config), *angle_notes(config.clutch.dog, angles)])


def shift(
    study: StudyArg,
    mismatch_rpm: Annotated[float, Option(help="+ runs the traction flanks together")],
    angle_deg: Annotated[float, Option(help="lead over dogs facing dogs")],
    force_N: Annotated[
        float | None, Option("--force-N", help="final shift force; of an actuator all by default")
    ] = None,
    force_rise_s: Rise = None,
    all_dogs: Annotated[bool, Option("--all-dogs", help="model every dog")] = False,
    report: Annotated[Path | None, Option(help="write an animation with its curves")] = None,
    trace: Annotated[Path | None, Option(help="write the time series, CSV or .xlsx")] = None,
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Simulate one engagement.

    Example: dogshape shift mq200 --mismatch-rpm 50 --force-N 469 --angle-deg 10
    """
    from dogshape.pipeline.store.folder import require_targets  # noqa: PLC0415

    if report is not None and report == trace:
        raise InputError(f"--report and --trace both name {report}; give two files")
    require_targets({"--report": report, "--trace": trace}, ENDINGS)
    problem = _named_study(study, set_ or [])
    result = problem.shift(
        mismatch_rpm=mismatch_rpm,
        force_N=force_N,
        angle_deg=angle_deg,
        force_rise_s=force_rise_s,
        all_dogs=all_dogs,
        engine=engine,
    )
    _warn_of_doubts(problem, [angle_deg])
    files = []
    if report is not None:
        files.append(result.report(report))
    if trace is not None:
        files.append(result.write_trace(trace))
    show(result, json, *(f"wrote {path}" for path in files))


def expect(
    study: StudyArg,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    force_rise_s: Rise = None,
    angles: Annotated[str | None, Option(help="how many, or degrees: A,B,C")] = None,
    precision: Annotated[
        float | None, Option(help="relative standard error of the mean of engaged shifts")
    ] = None,
    set_: Sets = None,
    engine: Engine = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    journal: Journal = None,
    json: Json = False,
) -> None:
    """Compute the expected shift time over the relative angle.

    Example: dogshape expect mq200 --mismatch-rpm 50 --force-N 469 --angles 24
    """
    relative_angles = angles_of(angles)
    problem = _named_study(study, set_ or [])
    _warn_of_doubts(problem, relative_angles if isinstance(relative_angles, tuple) else ())
    result = problem.expect(
        mismatch_rpm=mismatch_rpm,
        force_N=force_N,
        force_rise_s=force_rise_s,
        angles=relative_angles,
        precision=precision,
        **run_arguments(jobs, cluster, journal, engine),
    )
    if json:
        warn(warning.removeprefix("warning: ") for warning in result.shortfall)
    show(result, json)


def expect_draws(
    study: StudyArg,
    draws: Annotated[str, Argument(metavar="FILE", help="table: keys, a row a draw")],
    angles: Annotated[int | None, Option(help="at each operating point, at least 3")] = None,
    set_: Sets = None,
    engine: Engine = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    json: Json = False,
) -> None:
    """Compute the expected shift time at each draw of some keys of a study.

    Draws of a diagnosis are in NAME-draws.csv beside its calibrated study.

    Example: dogshape expect-draws stand.toml stand-draws.csv --angles 8
    """
    expectation = ds.expect_draws(
        study,
        draws,
        set_ or [],
        angles=angles,
        jobs=jobs,
        cluster=cluster,
        progress=True,
        engine=engine,
    )
    show(expectation, json)


def validate(
    bench: BenchArg,
    angles: Annotated[str | None, Option(help="how many, or degrees: A,B,C")] = None,
    correct: Corrections = None,
    engine: Engine = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    journal: Journal = None,
    json: Json = False,
) -> None:
    """Compare a bench data set with the simulation.

    Drake takes minutes, --engine planar seconds. A stopped run leaves its finished shifts in
    results/shifts, or in the folder of --journal, and the same command goes on from there.

    Example: dogshape validate mq200_adams
    """
    comparison = ds.validate(
        bench,
        angles_of(angles),
        correct=correct or (),
        **run_arguments(jobs, cluster, journal, engine),
    )
    show(comparison, json)


def strength(
    study: StudyArg,
    simulate: Annotated[bool, Option(help="simulate the hardest landing, dog on dog")] = True,
    explain: Explain = False,
    fem: Annotated[bool, Option("--fem", help="finite elements too; extra [fem]")] = False,
    set_: Sets = None,
    engine: Engine = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    journal: Journal = None,
    json: Json = False,
) -> None:
    """Check strength, self-locking and manufacture of a design.

    The compiled engine simulates the hardest landing over operating points and angles in seconds;
    --no-simulate leaves it out.

    Example: dogshape strength mq200 --set dog.height_mm=3.2
    """
    problem = _named_study(study, set_ or [])
    record = {}
    tables = []
    if fem:
        from dogshape.validation.finite_elements import root_stress, stiffness  # noqa: PLC0415

        if problem.config.limits.sleeve is not None:
            raise InputError("--fem has dogs on a face, and dog.mount is 'sleeve'; leave --fem out")
        if problem.config.limits.has_unlike_rings:
            raise InputError(
                "--fem has one dog for both rings, and [output_dog] gives another one; leave out "
                "--fem, or compute each ring as a study of equal dogs"
            )
        dog = problem.config.clutch.dog
        limits = problem.config.limits
        roots = root_stress.root_checks(dog, limits)
        record["finite_elements"] = [root.to_dict() for root in roots]
        loads = stiffness.stiffness_checks(dog, limits.root_radius)
        record["stiffness"] = [load.to_dict() for load in loads]
        tables = [root_stress.root_table(roots), stiffness.stiffness_table(loads)]
    arguments = run_arguments(jobs, cluster, journal, engine)
    result = problem.strength(simulate=simulate, **arguments)
    parts = result.to_parts()
    if explain:
        parts += result.explained
    parts += tables
    emit({**result.to_dict(), **record}, json, lambda: parts, ok=not result.verdict.failed)


def check(
    study: StudyArg,
    surrogate: SurrogateFile = None,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    explain: Explain = False,
    set_: Sets = None,
    engine: Engine = None,
    json: Json = False,
) -> None:
    """Check one design in seconds.

    The compiled engine simulates the design, landing included, beside the surrogate's prediction;
    --surrogate FILE answers at once, without the landing.

    Example: dogshape check mq200 --set dog.chamfer_deg=14 --set dog.count=18
    """
    result = _named_study(study, set_ or []).check(
        mismatch_rpm=mismatch_rpm, force_N=force_N, surrogate=surrogate, engine=engine
    )
    explanation = result.explained if explain else ()
    show(result, json, *explanation, ok=not result.verdict.failed)


def predict(
    study: StudyArg,
    designs: Annotated[Path, Argument(metavar="DESIGNS", help="CSV or .xlsx, a row a design")],
    out: Annotated[Path | None, Option(help="CSV or .xlsx; default: NAME-times beside")] = None,
    surrogate: SurrogateFile = None,
    mismatch_rpm: OneMismatch = None,
    force_N: OneForce = None,
    set_: Sets = None,
    engine: Engine = None,
    json: Json = False,
) -> None:
    """Predict the shift times of many designs by the surrogate.

    Columns are named as the variables, such as chamfer_deg. Status 1 if a row has no answer.

    Example: dogshape predict mq200 designs.csv
    """
    from dogshape.pipeline.store.folder import require_targets  # noqa: PLC0415
    from dogshape.predictions import answer_path  # noqa: PLC0415

    require_targets({"--out": out}, {"--out": TABLES})
    predictions = _named_study(study, set_ or []).predict(
        designs,
        out=out or answer_path(designs),
        mismatch_rpm=mismatch_rpm,
        force_N=force_N,
        surrogate=surrogate,
        engine=engine,
    )
    for line in predictions.notes:
        echo(line, err=True)
    show(predictions, json, ok=not predictions.impossible)


def search(
    study: StudyArg,
    out: Annotated[Path | None, Option(help="default: results/NAME")] = None,
    trials: Annotated[int | None, Option(min=1, help="designs to propose")] = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    seed: Annotated[int | None, Option(min=0, help="of the search")] = None,
    storage: Annotated[str | None, Option(help="PostgreSQL that machines share")] = None,
    resume: Annotated[bool, Option("--resume", help="continue a stopped study")] = False,
    report: Annotated[bool, Option(help="write the report")] = True,
    set_: Sets = None,
    engine: Engine = None,
    json: Json = False,
) -> None:
    """Search for the best shape, then write the report.

    The report takes half a minute for its effects and animations; --no-report leaves it out.

    Example: dogshape search mq200 --out results/mq200 --trials 48
    """
    settings = list(set_ or [])
    if trials is not None:
        settings.append(f"search.trials={trials}")
    if seed is not None:
        settings.append(f"search.seed={seed}")
    result = ds.Study(study, settings).search(
        out,
        jobs=jobs,
        cluster=cluster,
        storage=storage,
        resume=resume,
        report=report,
        progress=True,
        engine=engine,
    )
    show(result, json, ok=result.best is not None)


def report(
    directory: Annotated[Path, Argument(metavar="DIR", help="folder of a study")],
    title: Annotated[list[str] | None, Option(metavar="KEY=TEXT", help=TITLE_HELP)] = None,
    json: Json = False,
) -> None:
    """Write the report again from the stored results of a study.

    Missing animations of the fastest and slowest shifts are simulated, and missing effects of the
    variables are computed. The title block has number, revision, date, author, checker and
    decided_by.

    Example: dogshape report results/mq200 --title number=4711 --title author="E. Fiala"
    """
    path = ds.load_result(directory).report(progress=True, **_title_block(title))
    emit({"report": str(path)}, json, lambda: [f"report: {path}"])


def fit(
    where: Annotated[str, Argument(metavar="STUDY|DIR", help="study, or folder of one")],
    out: Annotated[Path | None, Option(help="default: surrogate.json of the folder")] = None,
    jobs: Jobs = 0,
    cluster: Cluster = None,
    engine: Engine = None,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Fit the surrogate and judge it on designs outside the fit.

    A folder of results is fitted as it is. For a study, space-filling designs are simulated first,
    into results/NAME-space, and separate designs for the validation; by the compiled engine unless
    the study names another.

    Example: dogshape fit results/mq200
    """
    surrogate = ds.fit(
        where, set_ or [], out=out, jobs=jobs, cluster=cluster, progress=True, engine=engine
    )
    show(surrogate, json)


def compare(
    items: Annotated[list[str], Argument(metavar="A B ...", help="e.g. results/mq200#43, mq200")],
    json: Json = False,
) -> None:
    """Compare designs, studies, results or contact sets.

    FOLDER#N and STUDY#N are designs, without #N the chosen one, or the study's own. Differences
    are to the first item, with the error of independent means.

    Example: dogshape compare mq200#19 mq200#43 mq200#0
    """
    show(ds.compare(*items), json)


def export(
    study: Annotated[str, Argument(metavar="STUDY", help="or FOLDER#N or STUDY#N, a design")],
    stl: Annotated[Path | None, Option(help="one ring for print; see --ring")] = None,
    step: Annotated[Path | None, Option(help="both rings for CAD; extra [cad]")] = None,
    svg: Annotated[Path | None, Option(help="dimensioned section of a dog")] = None,
    dxf: Annotated[Path | None, Option(help="developed section of both rings; extra [dxf]")] = None,
    sheet: Annotated[Path | None, Option(help="data sheet, HTML or JSON by ending")] = None,
    why: Annotated[str, Option(help="with --sheet: reason of a decision")] = "",
    title: Annotated[list[str] | None, Option(metavar="KEY=TEXT", help="with --sheet")] = None,
    fmu: Annotated[Path | None, Option(help="block for driveline models; extra [fmu]")] = None,
    fmi: Annotated[int, Option(help="with --fmu: version of FMI, 2 or 3")] = 3,
    map_: Annotated[
        Path | None, Option("--map", help="CSV: engagement and time, with tables beside")
    ] = None,
    body_mm: Annotated[float, Option(help="thickness of a ring below the slots")] = 3.0,
    ring: Annotated[Ring, Option(help="of --stl and --svg where the rings are unlike")] = "sliding",
    jobs: Jobs = 0,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Write geometry, drawing, data sheet, FMU and map of a design.

    The data sheet has dimensions, times, margins and provenance: those of the search for
    results/mq200#33 or mq200#33; any other dog is simulated in seconds, as by check.
    Its --title has number (of the drawing), revision, date, author, checker and decided_by.
    The map has every mismatch with every force of the study at expectation.angles angles; with
    --jobs workers. It replaces an earlier map with its tables.

    Example: dogshape export mq200#33 --stl ring.stl --svg dog.svg --sheet sheet.html
    """
    from dogshape.pipeline.export.cad import require_all_dogs  # noqa: PLC0415
    from dogshape.pipeline.reports.named_design import named_design  # noqa: PLC0415
    from dogshape.sim.part import part_volume  # noqa: PLC0415
    from dogshape.sim.strength.manufacture import require_fillets  # noqa: PLC0415
    from dogshape.sim.strength.spline import require_face  # noqa: PLC0415

    dog_design = named_design(study, set_, chosen=False)
    setup = dog_design.design_study
    pair = setup.clutch.pair
    dogs = pair.output_dogs if ring == "output" else pair.sliding_dogs
    dog = dogs.dog
    radius = setup.limits.root_radius
    body = body_mm * MM
    files = {
        "svg": svg,
        "dxf": dxf,
        "stl": stl,
        "step": step,
        "sheet": sheet,
        "fmu": fmu,
        "map": map_,
    }
    _require_files(files)
    if (why or title) and sheet is None:
        raise InputError("--why and --title are for the data sheet; give --sheet with a file")
    require_between("--body-mm", body_mm, 0.1, 1000.0, "give the thickness in mm")
    sleeve = setup.limits.sleeve
    if stl or step:
        require_face(sleeve)
        require_all_dogs(pair, step=step is not None, ring=ring)
    if sleeve is None and (svg or dxf or stl or step):
        for ring_dog in {pair.sliding, pair.output, pair.low or pair.output}:
            require_fillets(ring_dog, radius)
    _load_extras(dxf, step, fmu, fmi)  # before anything is written
    is_part = any((svg, dxf, stl, step))
    _warn_of_design(setup, is_part=is_part, has_load=is_part or sheet is not None)
    _write_geometry(setup, ring, dog_design.title, body=body, svg=svg, dxf=dxf, stl=stl, step=step)
    models = ds.Study.from_config(dog_design.prototype_study)
    if fmu is not None:
        models.export_fmu(fmu, fmi)
    lines = [] if map_ is None else _write_map(models, map_, jobs)
    if sheet is not None:
        from dogshape.designs import write_data_sheet  # noqa: PLC0415

        write_data_sheet(dog_design, sheet, {"why": why, **_title_block(title)})
    written = {kind: str(path) for kind, path in files.items() if path is not None}
    labels = {kind: FILE_LABELS[kind].format(fmi=fmi) for kind in written}
    if not pair.alike:
        labels |= {"stl": f"{ring} ring", "svg": f"drawing of the {ring} ring's dog"}
    lines += [f"wrote {path} ({labels[kind]})" for kind, path in written.items()]
    sizes = {"root_radius_mm": radius / MM}
    if sleeve is None and dogs.pitches == 1:
        volume = part_volume(dog, radius, body) / MM**3
        ring_name = "a ring" if pair.alike else f"the {ring} ring"
        if is_part:
            lines.append(f"volume of {ring_name} {volume:.1f} mm3")
        sizes = {"ring_volume_mm3": volume, **sizes, "body_mm": body_mm}
    emit({**written, **sizes}, json, lambda: lines)


def _warn_of_design(setup: Setup, *, is_part: bool, has_load: bool) -> None:
    """Warn of doubts about a design, with ``has_load`` of its load too, and of failed checks.

    A data sheet has the checks, so those of a part to be made are named; block and map have neither
    checks nor the load of the checks.
    """
    from dogshape.pipeline.simulate.design import design_of  # noqa: PLC0415
    from dogshape.pipeline.simulate.plausibility import motion_slips, slide_notes  # noqa: PLC0415

    if is_part:
        design = design_of(setup, {})
        if not design.feasible:
            warn([f"a check fails ({', '.join(design.failed)}); see dogshape strength"])
    if has_load:
        _warn_of_doubts(ds.Study.from_config(setup))
    else:
        warn([*motion_slips(setup), *slide_notes(setup)])


def _title_block(texts: list[str] | None) -> dict[str, str]:
    """Read the values of a title block from ``KEY=TEXT``."""
    return dict(text.partition("=")[::2] for text in texts or ())


def _require_files(files: dict[str, Path | None]) -> None:
    """Raise InputError where no file is named, StorageError where one cannot be written."""
    from dogshape.pipeline.export.engagement_map import require_map_targets  # noqa: PLC0415
    from dogshape.pipeline.store.folder import require_targets  # noqa: PLC0415

    if not any(files.values()):
        remedy = "give --stl, --step, --svg, --dxf, --sheet, --fmu or --map with a file"
        raise InputError(f"export was asked for nothing; {remedy}")
    require_targets({f"--{kind}": path for kind, path in files.items()}, ENDINGS)
    map_ = files["map"]
    if map_ is not None:
        require_map_targets(map_)


def _load_extras(dxf: Path | None, step: Path | None, fmu: Path | None, fmi: int) -> None:
    """Load the extras of the files that are asked for; InputError with the way to install one."""
    from dogshape.pipeline.export.cad import load_cad  # noqa: PLC0415
    from dogshape.pipeline.export.dxf import load_dxf  # noqa: PLC0415
    from dogshape.pipeline.export.fmu import load_fmu_builder  # noqa: PLC0415

    if dxf is not None:
        load_dxf()
    if step is not None:
        load_cad()
    if fmu is not None:
        load_fmu_builder(fmi)


def _write_map(study: ds.Study, map_: Path, jobs: int) -> list[str]:
    """Write the map for driveline models; return lines on the tables beside it."""
    _, *tables = study.export_map(map_, jobs=jobs, progress=True)
    return [f"wrote {path}" for path in tables]


def _write_geometry(
    setup: Setup,
    ring: Ring,
    title: str,
    *,
    body: float,
    svg: Path | None,
    dxf: Path | None,
    stl: Path | None,
    step: Path | None,
) -> None:
    """Write drawings, mesh and solids of a dog; ``body`` is the thickness below the slots, m."""
    from dogshape.pipeline.export.cad import write_step  # noqa: PLC0415
    from dogshape.pipeline.export.drawing import ring_drawings  # noqa: PLC0415
    from dogshape.pipeline.export.dxf import write_dxf  # noqa: PLC0415
    from dogshape.sim.part import ring_part  # noqa: PLC0415
    from dogshape.sim.shift.mesh import to_stl  # noqa: PLC0415

    pair = setup.clutch.pair
    dog = pair.output if ring == "output" else pair.sliding
    radius = setup.limits.root_radius
    if svg is not None:
        drawings = ring_drawings(pair, setup.limits, title)
        with name_file_in_errors(svg):
            svg.write_text(drawings[-1 if ring == "output" else 0], encoding="utf-8")
    if dxf is not None:
        write_dxf(pair, setup.limits, body, title, dxf)
    if stl is not None:
        with name_file_in_errors(stl):
            stl.write_bytes(to_stl(ring_part(dog, radius, body), f"dogshape {title} ring"))
    if step is not None:
        write_step(pair, radius, body, step, setup.limits.tolerances.dimensions)


def app(
    study: Annotated[
        str | None,
        Argument(metavar="[STUDY]", help="or the folder of its results; default: a new one"),
    ] = None,
    surrogate: SurrogateFile = None,
    port: Annotated[int, Option(min=0, max=65535, help="of this machine; 0: any")] = 8050,
    browser: Annotated[bool, Option(help="open the page in the browser")] = True,
    set_: Sets = None,
) -> None:
    """Open the live page: sliders, section, times and checks.

    Without a study the page first asks for a clutch of your own, as 'dogshape init study' does.
    The server listens on this machine only. The surrogate predicts at once ('dogshape fit'), the
    compiled engine simulates in seconds, landing included.

    Example: dogshape app mq200_paper --set load.torque_Nm=150
    """
    from dogshape.pipeline.store.folder import StudyFolder  # noqa: PLC0415

    folder = None
    problem = None
    command = ""
    if study is not None:
        folder = Path(study) if StudyFolder(Path(study)).manifest.is_file() else None
        problem = _named_study(study, set_ or [])
        command = shlex.join([study, *(f"--set={setting}" for setting in set_ or ())])
    elif set_:
        raise InputError("--set changes a study; name one, or answer the questions of the page")
    ds.serve_app(
        problem,
        surrogate=surrogate,
        folder=folder,
        port=port,
        browser=browser,
        progress=True,
        command=command,
    )
    raise KeyboardInterrupt  # by which the server ends
