"""``strength``, ``check`` and ``export``: one design, its checks, its predicted time, its part."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Group, RenderableType

from pipeline import tables
from pipeline.cad import write_step
from pipeline.config import Study, load_study
from pipeline.console import emit, verb
from pipeline.design import Design, design_of
from pipeline.drawing import dimensioned_svg
from pipeline.evaluation import evaluate
from pipeline.executor import scratch_executor
from pipeline.folder import StudyFolder
from pipeline.options import Jobs, Json, Sets, StudyArg, app, default_out
from pipeline.progress import ShiftProgress
from pipeline.records import check_record, number_or_none, root_record
from pipeline.tolerances import KINDS, Within, margins_within, spread_record, time_spread
from sim.checks import feasible
from sim.errors import InputError, require_between
from sim.landing import LANDING_RULES
from sim.locking import blocking_force
from sim.manufacture import manufacturing_checks, require_makeable
from sim.mesh import to_stl
from sim.notch import outside_fit
from sim.part import part_volume, ring_part
from sim.root_check import root_checks
from sim.units import MM, MPA
from surrogate.query import ask
from surrogate.store import load


@app.command()
@verb
def strength(
    study: StudyArg,
    simulation: Annotated[
        bool, typer.Option(help="simulate the hardest landing, dog on dog")
    ] = True,
    explain: Annotated[bool, typer.Option("--explain", help="formulas, sources, keys")] = False,
    fem: Annotated[
        bool, typer.Option("--fem", help="root stress by finite elements too; extra [fem]")
    ] = False,
    set_: Sets = None,
    jobs: Jobs = 0,
    json: Json = False,
) -> None:
    """Strength, self-locking and manufacturability of one design.

    The hardest landing is that of the study's operating points and angles; it takes some
    seconds, and --no-simulation leaves it out.

    Example: dogshape strength mq200 --set dog.height_mm=3.2
    """
    given = load_study(study, set_)
    roots = root_checks(given.clutch.dog, given.limits) if fem else []
    design = _landed(given, jobs) if simulation else design_of(given, {})
    within = margins_within(given, design)
    data = {
        "feasible": design.feasible,
        "not_checked": _not_checked(design),
        "checks": _checks(design, within),
        **_load_record(given),
    }
    if fem:
        data["finite_elements"] = [root_record(root) for root in roots]
    held = blocking_force(given.clutch.dog, given.limits.load)

    def text() -> RenderableType:
        table = tables.strength_table(design.checks, within, held, _notes(given), explain)
        return Group(table, tables.root_table(roots)) if fem else table

    emit(data, json, text)
    if not design.feasible:
        raise typer.Exit(1)


def _landed(given: Study, jobs: int) -> Design:
    """Return the study's dog with the checks of its landing, where it can be made at all."""
    dog, settings = given.clutch.dog, given.file.expectation
    if not feasible(manufacturing_checks(dog, given.limits.manufacturing)):
        return design_of(given, {})
    with ShiftProgress(len(given.points) * settings.angles) as progress:
        executor = scratch_executor(jobs, progress.advance)
        (found,) = evaluate(given, [dog], executor, settings.angles, settings.seed)
    return design_of(given, {}, found.landing)


def _not_checked(design: Design) -> list[str]:
    """Return the names of the checks that a simulation would add."""
    known = {check.name for check in design.checks}
    return [rule.name for rule in LANDING_RULES if rule.name not in known]


def _notes(given: Study) -> list[str]:
    return outside_fit(given.clutch.dog, given.limits.root_radius)


def _checks(design: Design, within: Within) -> list[dict[str, Any]]:
    empty: dict[str, float] = {}
    return [
        check_record(check)
        | {
            f"margin_{kind}": number_or_none(within.get(check.name, empty).get(kind))
            for kind in KINDS
        }
        for check in design.checks
    ]


def _load_record(given: Study) -> dict[str, Any]:
    dog, limits = given.clutch.dog, given.limits
    return {
        "warnings": _notes(given),
        "load": {
            **given.file.load.model_dump(),
            "force_per_dog_N": limits.load.force_per_dog(dog),
            "blocking_force_N": blocking_force(dog, limits.load),
        },
        "material": {
            "set": limits.material.name,
            "source": limits.material.source,
            "allowable_stress_MPa": limits.allowable_stress / MPA,
            "fatigue_stress_MPa": limits.fatigue_stress / MPA,
        },
    }


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
    model, validation = load(surrogate or StudyFolder(default_out(given)).surrogate)
    answer = ask(model, given.prototype, given.physics_hash)
    design = design_of(given, {})
    within = margins_within(given, design)
    spread = time_spread(given, model, given.prototype)
    data = {
        "expected_shift_time_s": answer.time,
        "low_s": answer.low,
        "high_s": answer.high,
        "in_range": answer.in_range,
        "q2": validation.q2,
        "warnings": list(answer.warnings),
        "time_within_tolerances": spread_record(spread),
        "feasible": design.feasible,
        "not_checked": _not_checked(design),
        "checks": _checks(design, within),
    }
    held = blocking_force(given.clutch.dog, given.limits.load)

    def text() -> RenderableType:
        table = tables.strength_table(design.checks, within, held, _notes(given))
        return tables.answer_text(answer, validation, spread, table)

    emit(data, json, text)
    if not design.feasible:
        raise typer.Exit(1)


@app.command()
@verb
def export(
    study: StudyArg,
    stl: Annotated[Path | None, typer.Option(help="one ring for print; both are alike")] = None,
    step: Annotated[Path | None, typer.Option(help="both rings for CAD; extra [cad]")] = None,
    svg: Annotated[Path | None, typer.Option(help="dimensioned section of a dog")] = None,
    body_mm: Annotated[float, typer.Option(help="thickness of a ring below the slots")] = 3.0,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Geometry for CAD and print, and the drawing of a dog.

    Example: dogshape export mq200 --step rings.step --svg dog.svg
    """
    given = load_study(study, set_)
    dog, radius = given.clutch.dog, given.limits.root_radius
    if not (stl or step or svg):
        raise InputError("export was asked for nothing; give --stl, --step or --svg with a file")
    require_between("--body-mm", body_mm, 0.1, 1000.0, "give the thickness in mm")
    require_makeable(dog, given.limits.manufacturing)
    design = design_of(given, {})
    if not design.feasible:
        failed = ", ".join(design.failed)
        print(f"warning: not feasible ({failed}); see dogshape strength", file=sys.stderr)
    body = body_mm * MM
    if svg is not None:
        svg.write_text(dimensioned_svg(dog, given.limits), encoding="utf-8")
    if stl is not None:
        stl.write_bytes(to_stl(ring_part(dog, radius, body), f"dogshape {given.name} ring"))
    if step is not None:
        write_step(dog, radius, body, step)
    files = {"svg": svg, "stl": stl, "step": step}
    written = {kind: str(path) for kind, path in files.items() if path is not None}
    volume = part_volume(dog, radius, body) / MM**3
    emit(
        {**written, "ring_volume_mm3": volume, "root_radius_mm": radius / MM, "body_mm": body_mm},
        json,
        lambda: tables.export_text(written, volume),
    )
