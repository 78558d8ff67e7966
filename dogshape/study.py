"""Study of a clutch: its design, operation and search, with the verbs on them."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from dogshape.argument_types import check_types_of_verbs
from dogshape.pipeline.config.schema import dotted_key
from dogshape.pipeline.config.study_file import (
    RequestedPoint,
    Setup,
    load_study,
    replace_keys,
    settings_of,
)
from dogshape.pipeline.progress import Progress
from dogshape.running import Angles, receiver

if TYPE_CHECKING:
    import pandas as pd

    from dogshape.check import Check, Strength
    from dogshape.expectation import Expectation
    from dogshape.predictions import Predictions
    from dogshape.shift import Shift
    from dogshape.study_result import StudyResult


@check_types_of_verbs
@dataclass(frozen=True, init=False, repr=False)
class Study:
    """Study of a clutch: its design, its operation and its search.

    An invalid study raises InputError with the file, the key, the value and the rule.

    Parameters
    ----------
    where : TOML file, folder with ``study.toml``, or name of a bundled study.
    settings : keys of the study file with their values, ``{"contact.set": "adams2019"}``, or as
        the command line has them, ``["contact.set=adams2019"]``.
    dog : keys of the dog, ``chamfer_deg=11, count=18``, and of the output ring's dog as a design
        has them, ``output_dog_height_mm=3.2``.
    """

    config: Setup

    def __init__(
        self,
        where: str | Path,
        settings: Mapping[str, Any] | Iterable[str] | None = None,
        /,
        **dog: float | str,
    ) -> None:
        keys = settings_of(settings) | {dotted_key(key): value for key, value in dog.items()}
        object.__setattr__(self, "config", load_study(where, keys))

    @classmethod
    def from_config(cls, config: Setup) -> Study:
        """Make a study from the values of a study file."""
        study = cls.__new__(cls)
        object.__setattr__(study, "config", config)
        return study

    @property
    def name(self) -> str:
        """Name of the study."""
        return self.config.name

    @property
    def dog(self) -> dict[str, float]:
        """Keys of the dog with their values, in the units that their names end in."""
        return self.config.file.dog.sizes

    # Each verb imports its own modules: simulation, search and pages take seconds to load.

    def shift(
        self,
        *,
        mismatch_rpm: float,
        angle_deg: float,
        force_N: float | None = None,
        force_rise_s: float | None = None,
        all_dogs: bool = False,
        engine: str | None = None,
    ) -> Shift:
        """Simulate one shift, repeated with finer steps if it skips a slot or bounces.

        Raises InputError for a force without a rise time or an angle that is no number,
        GeometryError for an impossible dog.
        Example: ``study.shift(mismatch_rpm=50, force_N=469, angle_deg=10)``

        Parameters
        ----------
        mismatch_rpm : speed of ring against ring before the shift, 1/min; positive runs the
            traction flanks together (docs/scope.md).
        force_N : final shift force, N; with an actuator its largest static force, None for the
            full force.
        angle_deg : relative angle: lead of the output ring over the position dogs facing dogs, deg.
        force_rise_s : rise time of the force, s; None for that of the study's table.
        all_dogs : whether to model every dog instead of one pair with the symmetry of all.
        engine : ``drake`` or ``planar``; None for that of the study.
        """
        from dogshape.shift import simulate_shift  # noqa: PLC0415

        requested = RequestedPoint(mismatch_rpm, force_N, force_rise_s)
        return simulate_shift(self._config_in(engine), requested, angle_deg, all_dogs)

    def expect(
        self,
        *,
        mismatch_rpm: float | None = None,
        force_N: float | None = None,
        force_rise_s: float | None = None,
        angles: Angles = None,
        precision: float | None = None,
        jobs: int = 0,
        cluster: str | None = None,
        journal: str | Path | None = None,
        progress: Progress | bool | None = None,
        engine: str | None = None,
    ) -> Expectation:
        """Simulate the expected shift time: in the compiled engine, unless the study names another.

        Raises InputError for a mismatch without a force (or the reverse) or a precision out of
        range, GeometryError for an impossible dog.
        Example: ``study.expect(precision=0.02, progress=True)``

        Parameters
        ----------
        mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
        force_rise_s : rise time of the force at that point, s.
        angles : how many evenly spaced relative angles, or the angles themselves, deg; None for the
            study's number.
        precision : wanted relative standard error of the mean of engaged shifts; it determines the
            number of angles. The error of the hangs stays in that of the expected time.
        jobs, cluster : worker processes, 0 for one a core; address of a Dask scheduler.
        journal : folder for the finished shifts, which a stopped run need not simulate again.
        progress : True for a bar, False for none, or a ``Progress`` of your own; None for a bar in
            a terminal or notebook alone.
        engine : as in ``shift``.
        """
        from dogshape.expectation import simulate_mean  # noqa: PLC0415
        from dogshape.pipeline.simulate.executor import RunOptions  # noqa: PLC0415

        requested = RequestedPoint(mismatch_rpm, force_N, force_rise_s)
        options = RunOptions(jobs, cluster, journal, receiver(progress))
        return simulate_mean(self._config_in(engine), options, requested, angles, precision)

    def search(
        self,
        out: str | Path | None = None,
        *,
        jobs: int = 0,
        cluster: str | None = None,
        storage: str | None = None,
        resume: bool = False,
        report: bool = True,
        progress: Progress | bool | None = None,
        engine: str | None = None,
    ) -> StudyResult:
        """Search for the best shape, or resume a search; the report takes half a minute.

        Raises InputError for an unknown objective or a study without variables, StorageError for a
        folder or storage that holds another study, or this study without ``resume``. Raises
        EngineError where the audit finds that the engines do not agree, after result and report
        are written.
        Example: ``study.search("results/mine", resume=True, progress=True)``

        Parameters
        ----------
        out : folder of the results; None for ``results/NAME``.
        storage : address of a PostgreSQL database that machines share.
        resume : whether to resume the search in the folder.
        report : whether to write the report.
        jobs, cluster, progress, engine : as in ``expect``.
        """
        from dogshape.pipeline.simulate.executor import end_workers  # noqa: PLC0415
        from dogshape.pipeline.store.folder import StudyFolder, default_out  # noqa: PLC0415

        with warnings.catch_warnings():  # of a notebook without widgets, about a bar of Optuna's
            warnings.filterwarnings("ignore", message="IProgress not found")
            from dogshape.pipeline.study import StudyOptions, run_study  # noqa: PLC0415
        from dogshape.study_result import StudyResult  # noqa: PLC0415

        start = _processor_time()
        config = self._config_in(engine)
        folder = StudyFolder(default_out(config) if out is None else Path(out))
        listener = receiver(progress)
        options = StudyOptions(folder, jobs, storage, resume, cluster, report, listener)
        record = run_study(config, options)
        end_workers()  # the processor time of a child counts after its end
        page = folder.report if report else None
        return StudyResult(config, folder.root, record, page, _processor_time() - start)

    def check(
        self,
        *,
        mismatch_rpm: float | None = None,
        force_N: float | None = None,
        surrogate: str | Path | None = None,
        engine: str | None = None,
    ) -> Check:
        """Check the design: seconds with the compiled engine, at once with a named surrogate.

        Raises InputError for a mismatch without a force (or the reverse), InputError or DataError
        for a named surrogate that is missing or of other physics.
        Example: ``study.check(mismatch_rpm=50, force_N=469)``

        Parameters
        ----------
        mismatch_rpm, force_N : one operating point, 1/min and N; neither for all of the study's.
        surrogate : file of a surrogate that replaces the compiled engine. By default the engine
            simulates, and the surrogate of the study's results, or the bundled one, is shown
            beside it.
        engine : engine of the surrogate's shifts, ``drake`` or ``planar``; None for the study's.
        """
        from dogshape.check import check_design  # noqa: PLC0415

        requested = RequestedPoint(mismatch_rpm, force_N)
        return check_design(self._config_in(engine), requested, surrogate)

    def predict(
        self,
        designs: str | Path | pd.DataFrame,
        *,
        out: str | Path | None = None,
        mismatch_rpm: float | None = None,
        force_N: float | None = None,
        surrogate: str | Path | None = None,
        engine: str | None = None,
    ) -> Predictions:
        """Predict the shift times of many designs by the surrogate, without simulation.

        Raises InputError or DataError for columns and cells that cannot be read, with row, column
        and remedy. Example: ``study.predict("designs.csv", out="answers.xlsx")``

        Parameters
        ----------
        designs : CSV or .xlsx file (``FILE.xlsx#SHEET``) or frame with a row for each design and
            columns named as the study's variables; a variable without a column takes the study's
            value, other columns are kept.
        out : CSV or .xlsx file for the predictions; None for no file.
        mismatch_rpm, force_N, surrogate, engine : as in ``check``.
        """
        from dogshape.predictions import predict_designs  # noqa: PLC0415

        requested = RequestedPoint(mismatch_rpm, force_N)
        return predict_designs(self._config_in(engine), designs, out, requested, surrogate)

    def strength(
        self,
        *,
        simulate: bool = True,
        jobs: int = 0,
        cluster: str | None = None,
        journal: str | Path | None = None,
        progress: Progress | bool | None = None,
        engine: str | None = None,
    ) -> Strength:
        """Check strength, self-locking and manufacturability, and simulate the hardest landing.

        Example: ``study.strength(simulate=False)``

        Parameters
        ----------
        simulate : whether to simulate the landing, dog on dog, at the study's operating points and
            angles; an impossible dog is not simulated.
        jobs, cluster, journal, progress, engine : as in ``expect``.
        """
        from dogshape.check import check_strength  # noqa: PLC0415
        from dogshape.pipeline.simulate.executor import RunOptions  # noqa: PLC0415

        options = RunOptions(jobs, cluster, journal, receiver(progress))
        return check_strength(self._config_in(engine), options, simulate=simulate)

    def data_sheet(self, path: str | Path, why: str = "", **block: str) -> Path:
        """Write the data sheet of the dog to ``path``: a page for A4, or JSON for ``.json``.

        ``why`` is the reason of a decision; ``block`` has drawing ``number``, ``revision``,
        ``date`` (by default today), ``author``, ``checker``, ``decided_by``. Raises InputError for
        another key.
        Example: ``study.data_sheet("sheet.html", "shortest", number="47-11", author="A. Novak")``
        """
        from dogshape.designs import write_data_sheet  # noqa: PLC0415
        from dogshape.pipeline.reports.named_design import NamedDesign  # noqa: PLC0415

        return write_data_sheet(NamedDesign(self.name, self.config), path, {"why": why, **block})

    def export_fmu(self, path: str | Path, fmi: int = 3) -> Path:
        """Write the clutch as an FMU, a co-simulation block for driveline models.

        The file ``path`` is FMI 3.0 or, with ``fmi=2``, FMI 2.0; the block runs where Python with
        this package is installed (docs/howto/own_driveline.md). An actuator of the study is in the
        block, with an input ``command``. Raises InputError without the extra ``fmu`` or for another
        version. Example: ``study.export_fmu("clutch.fmu", fmi=2)``
        """
        from dogshape.pipeline.export.fmu import write_fmu  # noqa: PLC0415
        from dogshape.pipeline.store.folder import require_targets  # noqa: PLC0415

        require_targets({"the FMU": Path(path)})
        write_fmu(self.config, Path(path), fmi)
        return Path(path)

    def export_map(
        self,
        path: str | Path,
        *,
        jobs: int = 0,
        cluster: str | None = None,
        journal: str | Path | None = None,
        progress: Progress | bool | None = None,
    ) -> tuple[Path, ...]:
        """Write a map of whether and when the clutch engages, for lumped driveline models.

        The cells of ``path`` are over mismatch, force and relative angle. Four files beside it
        have means over the angle, tables of Modelica, and parameters of the dog clutches of
        Simscape and MapleSim; returns all five paths. Raises InputError for operating points that
        are no grid, StorageError for files that cannot be written, or where ``path`` is new but a
        file beside it exists.
        Example: ``study.export_map("map.csv", progress=True)``

        Parameters
        ----------
        path : CSV file of the cells.
        jobs, cluster, journal, progress : as in ``expect``.
        """
        from dogshape.pipeline.export.engagement_map import (  # noqa: PLC0415
            require_map_targets,
            simulate_map,
        )
        from dogshape.pipeline.simulate.executor import RunOptions  # noqa: PLC0415

        require_map_targets(Path(path))
        options = RunOptions(jobs, cluster, journal, receiver(progress))
        return simulate_map(self.config, options).write(Path(path))

    def replace_keys(
        self, settings: Mapping[str, Any] | None = None, /, **dog: float | str | None
    ) -> Study:
        """Copy the study with changed ``settings`` and keys of the ``dog``; None removes a key.

        Example: ``study.replace_keys({"contact.set": "adams2019"}, chamfer_deg=11)``
        """
        keys = {**(settings or {}), **{dotted_key(key): value for key, value in dog.items()}}
        return Study.from_config(replace_keys(self.config, keys))

    def _config_in(self, engine: str | None) -> Setup:
        """Select the engine of the study; None keeps it."""
        if engine is None:
            return self.config
        return replace_keys(self.config, {"solver.engine": engine})

    def __repr__(self) -> str:
        dog = ", ".join(f"{key}={value:g}" for key, value in self.dog.items())
        return f"Study({self.name}: {dog}; {self.config.operating_text})"

    def _repr_html_(self) -> str:
        from dogshape.pipeline.record import Table  # noqa: PLC0415
        from dogshape.result import html_of  # noqa: PLC0415

        dog = [[key, f"{value:g}"] for key, value in self.dog.items()]
        name = f"study {self.name}, operating points: {self.config.operating_text}"
        return html_of([name, Table(("key of [dog]", "value"), dog)])


def _processor_time() -> float:
    """Sum the processor times of this process and its ended children, s."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system
