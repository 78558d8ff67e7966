"""``export`` and ``app``: files for the workshop, a page for the meeting."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from dogshape.cli.console import ProgressBar, emit, verb, warn
from dogshape.cli.options import (
    Json,
    Sets,
    SurrogateFile,
)
from dogshape.pipeline.config.study_file import load_study, pair_of, replace_keys
from dogshape.pipeline.export.cad import load_cad, write_step
from dogshape.pipeline.export.drawing import dimensioned_svg
from dogshape.pipeline.reports.data_sheet import named_design
from dogshape.pipeline.simulate.design import design_of
from dogshape.pipeline.simulate.plausibility import slips_of
from dogshape.pipeline.store.folder import StudyFolder, require_targets
from dogshape.sim.errors import InputError, require_between
from dogshape.sim.files import naming
from dogshape.sim.part import part_volume, ring_part
from dogshape.sim.shift.mesh import to_stl
from dogshape.sim.strength.manufacture import require_makeable
from dogshape.sim.units import MM
from dogshape.study import Study

ENDINGS = {"--stl": (".stl",), "--step": (".step", ".stp"), "--svg": (".svg",),
           "--sheet": (".html", ".json")}  # fmt: skip


@verb
def export(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="STUDY, or FOLDER#N or STUDY#N for a design")
    ],
    stl: Annotated[Path | None, typer.Option(help="one ring for print; both are alike")] = None,
    step: Annotated[Path | None, typer.Option(help="both rings for CAD; extra [cad]")] = None,
    svg: Annotated[Path | None, typer.Option(help="dimensioned section of a dog")] = None,
    sheet: Annotated[
        Path | None, typer.Option(help="data sheet, a page for A4, or JSON by its ending")
    ] = None,
    why: Annotated[str, typer.Option(help="with --sheet: reason of a decision")] = "",
    body_mm: Annotated[float, typer.Option(help="thickness of a ring below the slots")] = 3.0,
    set_: Sets = None,
    json: Json = False,
) -> None:
    """Geometry for CAD and print, drawing and data sheet of a design.

    The data sheet has dimensions, times, margins and provenance: those of the search for
    results/mq200#33 or mq200#33; any other dog is simulated in seconds, as by check.

    Example: dogshape export mq200#33 --stl ring.stl --svg dog.svg --sheet sheet.html
    """
    one = named_design(study, set_, chosen=False)
    given = one.own_study
    dog, radius = given.clutch.dog, given.limits.root_radius
    if not (stl or step or svg or sheet):
        raise InputError(
            "export was asked for nothing; give --stl, --step, --svg or --sheet with a file"
        )
    if why and sheet is None:
        raise InputError("--why is for the data sheet; give --sheet with a file")
    require_targets({"--stl": stl, "--step": step, "--svg": svg, "--sheet": sheet}, ENDINGS)
    require_between("--body-mm", body_mm, 0.1, 1000.0, "give the thickness in mm")
    require_makeable(dog, given.limits.manufacturing)
    if step is not None:
        load_cad()  # before anything is written
    design = design_of(given, {})
    if not design.feasible:
        warn([f"not feasible ({', '.join(design.failed)}); see dogshape strength"])
    warn(slips_of(given))
    body = body_mm * MM
    if svg is not None:
        with naming(svg):
            svg.write_text(dimensioned_svg(dog, given.limits, one.title), encoding="utf-8")
    if stl is not None:
        with naming(stl):
            stl.write_bytes(to_stl(ring_part(dog, radius, body), f"dogshape {one.title} ring"))
    if step is not None:
        write_step(dog, radius, body, step)
    if sheet is not None:
        # Figures take half a second to load that nothing else here needs.
        from dogshape.designs import write_data_sheet  # noqa: PLC0415

        write_data_sheet(one, sheet, why)
    files = {"svg": svg, "stl": stl, "step": step, "sheet": sheet}
    written = {kind: str(path) for kind, path in files.items() if path is not None}
    volume = part_volume(dog, radius, body) / MM**3
    words = {"svg": "drawing", "stl": "one ring, both are alike", "step": "both rings",
             "sheet": "data sheet"}  # fmt: skip
    emit(
        {**written, "ring_volume_mm3": volume, "root_radius_mm": radius / MM, "body_mm": body_mm},
        json,
        lambda: [
            *(f"wrote {path} ({words[kind]})" for kind, path in written.items()),
            f"volume of a ring {volume:.1f} mm3",
        ],
    )


@verb
def app(
    study: Annotated[
        str, typer.Argument(metavar="STUDY", help="STUDY, or the folder of a study's results")
    ],
    surrogate: SurrogateFile = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="of this machine; 0: any")] = 8050,
    browser: Annotated[bool, typer.Option(help="open the page in the browser")] = True,
    set_: Sets = None,
) -> None:
    """Live page in the browser: sliders, section, times, checks.

    The server listens on this machine only. Fields and sliders for the dogs, the operating point
    and friction; the surrogate predicts at once ('dogshape fit'), the compiled engine simulates in
    seconds, landing included. Designs of the search, single shifts, data sheet and STEP by a click.

    Example: dogshape app mq200_paper --set load.torque_Nm=150
    """
    stored = StudyFolder(Path(study))
    folder = stored.root if stored.manifest.is_file() else None
    if folder is None:
        given = load_study(study, set_)
    else:
        given = replace_keys(stored.stored_study(), dict(map(pair_of, set_ or ())))
    command = shlex.join([study, *(f"--set={one}" for one in set_ or ())])
    from dogshape.app import serve_app  # noqa: PLC0415  # Dash takes a second to load

    serve_app(
        Study.from_config(given), surrogate=surrogate, folder=folder, port=port, browser=browser,
        progress=ProgressBar(), command=command,
    )  # fmt: skip
    raise KeyboardInterrupt  # by which the server ends
