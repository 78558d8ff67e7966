"""The map of a clutch for lumped models: its cells are shifts, its tables their means."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

import dogshape as ds
from dogshape.pipeline.export.engagement_map import EngagementMap, simulate_map
from dogshape.pipeline.simulate.executor import RunOptions
from dogshape.sim.errors import InputError, StorageError
from dogshape.sim.shift.stepped_shift import StepLoads, SteppedShift, StepPhase, start_of
from dogshape.sim.statistics.expectation import variance_of_mean
from dogshape.sim.units import DEG, MM, RPM

MISMATCHES = [-50.0, 25.0, 149.0]
FORCES = [235.2, 469.0]
SETTINGS = {
    "operating.mismatch_rpm": MISMATCHES,
    "operating.force_N": FORCES,
    "expectation.angles": 5,
}
#: Flat tips that friction holds dog on dog: a part of the angles does not engage.
BLOCKING = {**SETTINGS, "dog.chamfer_deg": 0.0, "operating.mismatch_rpm": [0.5, 25.0]}


@pytest.fixture(scope="module")
def study() -> ds.Study:
    return ds.Study("mq200", SETTINGS)


@pytest.fixture(scope="module")
def engagement_map(study: ds.Study) -> EngagementMap:
    return simulate_map(study.config, RunOptions(jobs=1))


@pytest.mark.parametrize("index", [0, 13, 29])
def test_a_cell_is_a_shift(study: ds.Study, engagement_map: EngagementMap, index: int) -> None:
    """Without the uncertain factors of the study, and at the angle of the cell."""
    cell = engagement_map.cells[index]
    shift = study.shift(
        mismatch_rpm=cell.mismatch_rpm,
        force_N=cell.force_N,
        angle_deg=cell.angle_deg,
        engine="planar",
    )
    assert study.config.uncertainty is not None
    assert cell.outcome == shift.engagement.outcome.value
    assert cell.shift_time_s == pytest.approx(shift.time_s, rel=1e-9)


def test_cells_cover_the_grid_and_a_pitch(engagement_map: EngagementMap) -> None:
    cells = engagement_map.cells
    places = [(cell.mismatch_rpm, cell.force_N, cell.angle_deg) for cell in cells]
    angles = [2.4, 7.2, 12.0, 16.8, 21.6]
    expected = [(m, f, a) for m in MISMATCHES for f in FORCES for a in angles]
    assert places == [pytest.approx(place) for place in expected]


def test_files_hold_cells_means_and_tables(study: ds.Study, tmp_path: Path) -> None:
    paths = study.export_map(tmp_path / "map.csv", jobs=1)
    tables = ["map-mean.csv", "map-modelica.txt", "map-simscape.csv", "map-maplesim.csv"]
    names = ["map.csv", *tables]
    assert [path.name for path in paths] == names
    cells = pd.read_csv(paths[0])
    means = pd.read_csv(paths[1])
    groups = cells.groupby(["mismatch_rpm", "force_N"], sort=False)
    assert means["mean_time_s"].to_numpy() == pytest.approx(
        groups["shift_time_s"].mean().to_numpy(), rel=1e-8
    )
    time_errors = groups["shift_time_s"].apply(
        lambda group: math.sqrt(variance_of_mean(group.to_numpy()))
    )
    assert means["mean_time_standard_error_s"].to_numpy() == pytest.approx(time_errors, rel=1e-6)
    shares = stats.beta(0.5 + groups["engaged"].sum(), 5.5 - groups["engaged"].sum()).std()
    errors = means["engagement_probability_standard_error"]
    assert errors.to_numpy() == pytest.approx(shares, rel=1e-8)
    assert list(means["engagement_probability"]) == list(groups["engaged"].mean())
    matrices = _read_modelica(paths[2])
    assert list(matrices) == ["engagement_probability", "shift_time"]
    for table in matrices.values():
        assert table[1:, 0] == pytest.approx(np.array(MISMATCHES) * RPM)
        assert table[0, 1:] == pytest.approx(FORCES)
    times = means["mean_time_s"].to_numpy().reshape(3, 2)
    assert matrices["shift_time"][1:, 1:] == pytest.approx(times, rel=1e-8)


def _read_modelica(path: Path) -> dict[str, np.ndarray]:
    """Read matrices as ``ModelicaStandardTables`` does: ``double NAME(ROWS,COLUMNS)``."""
    head, *lines = path.read_text(encoding="ascii").splitlines()
    assert head == "#1"
    tables = {}
    while lines:
        kind, name = lines.pop(0).split(" ")
        assert kind == "double"
        name, _, size = name.rstrip(")").partition("(")
        rows, columns = map(int, size.split(","))
        tables[name] = np.array([line.split() for line in lines[:rows]], dtype=float)
        assert tables[name].shape == (rows, columns)
        assert lines[rows : rows + 1] in ([""], [])
        lines = lines[rows + 1 :]
    return tables


def test_shifts_that_hang_lower_probability_and_threshold() -> None:
    study = ds.Study("mq200", BLOCKING)
    engagement_map = simulate_map(study.config, RunOptions(jobs=1))
    cells = engagement_map.cells
    hung = [cell for cell in cells if not cell.engaged]
    assert hung
    assert {cell.shift_time_s for cell in hung} == {None}
    first = engagement_map.points[0]
    engaged = sum(cell.engaged for cell in cells[:5])
    assert first.engagement_probability == engaged / 5
    assert engaged < 5
    assert engagement_map.speed_threshold == 0.0


def test_block_parameters_are_those_of_the_clutch(engagement_map: EngagementMap) -> None:
    clutch = engagement_map.study.clutch
    rows = {row.parameter: (row.value, row.unit) for row in engagement_map.simscape_parameters}
    assert rows["Number of teeth"] == (15.0, "1")
    assert rows["Tooth height"] == (pytest.approx(clutch.dog.height / MM), "mm")
    assert rows["Ring-hub clearance when disengaged"] == (pytest.approx(1.0), "mm")
    overlap = (clutch.shift_travel - clutch.dog.axial_gap) / MM
    assert rows["Tooth overlap to engage"] == (pytest.approx(overlap), "mm")
    assert rows["Backlash"] == (clutch.dog.backlash_angle / DEG, "deg")
    assert rows["Engagement speed threshold"] == (pytest.approx(149.0), "rpm")
    for row in (*engagement_map.simscape_parameters, *engagement_map.maplesim_parameters):
        assert row.source


@pytest.mark.parametrize("backlash_mm", [0.0, 1.0])
def test_teeth_of_maplesim_meet_where_tips_meet(backlash_mm: float) -> None:
    """Of even angles without mismatch, as many tips meet as lie within epsilon of a tooth."""
    study = ds.Study("mq200", {"dog.chamfer_deg": 0.0, "dog.backlash_mm": backlash_mm})
    config = study.config.in_engine("planar")
    clutch = config.clutch
    gap, epsilon = (row.value for row in EngagementMap(config, ()).maplesim_parameters)
    assert gap * clutch.dog.count == pytest.approx(2.0 * np.pi)
    count = 60
    meetings = 0
    for angle in (np.arange(count) + 0.5) * gap / count:
        shift = SteppedShift(clutch, start_of(clutch, 0.0, float(angle)))
        phases = []
        while shift.time < 0.05 and not shift.engaged:
            shift.advance(shift.time + 5e-4, StepLoads(400.0, 0.0, 0.0))
            phases.append(shift.phase)
        meetings += StepPhase.FACE_CONTACT in phases
    assert meetings / count == pytest.approx(2.0 * epsilon / gap, abs=1.0 / count)


def test_a_map_replaces_an_earlier_one_but_no_other_table(study: ds.Study, tmp_path: Path) -> None:
    path = tmp_path / "map.csv"
    table = tmp_path / "map-mean.csv"
    table.write_text("of another origin")
    with pytest.raises(StorageError, match=r"map-mean.csv, which is there already without .*map"):
        study.export_map(path, jobs=1)
    assert table.read_text() == "of another origin"
    assert [*tmp_path.iterdir()] == [table]
    path.write_text("an earlier map")
    study.export_map(path, jobs=1)
    assert table.read_text().startswith("mismatch_rpm,")


def test_a_map_is_not_simulated_where_a_table_cannot_be_written(
    study: ds.Study, tmp_path: Path
) -> None:
    (tmp_path / "map.csv").touch()
    (tmp_path / "map-simscape.csv").mkdir()
    with pytest.raises(StorageError, match=r"map-simscape.csv, which is a folder; name a file"):
        study.export_map(tmp_path / "map.csv")
    assert (tmp_path / "map.csv").read_text() == ""


def test_points_that_are_no_grid_are_refused(tmp_path: Path) -> None:
    study = ds.Study("amt")
    with pytest.raises(InputError, match="a map needs every mismatch with every force"):
        study.export_map(tmp_path / "map.csv")
