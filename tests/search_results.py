"""Results of a search: small results made by hand, and the bundled result of a study."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

from dogshape.pipeline.config.study_file import Setup, load_study
from dogshape.pipeline.search.study_record import StudyRecord
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.sim.statistics.shift_records import clutch_record
from dogshape.sim.versions import bundled_root

Row = dict[str, Any]
VARIABLES = ["chamfer_deg", "count"]
TIME = "expected_shift_time_s"
LENGTH = "axial_length_mm"
PLAY = "backlash_mm"


def design(trial: int, time: float | None, length: float, **changes: Any) -> Row:
    """A row of a search; the prototype is trial 0."""
    row: Row = {
        "trial": trial,
        "prototype": trial == 0,
        "chamfer_deg": 8.0 + trial,
        "count": 15 + trial,
        LENGTH: length,
        PLAY: 0.1 * length,
        TIME: time,
        "standard_error_s": None if time is None else 0.001,
        "standard_errors": {TIME: None if time is None else 0.001},
        "points": 0 if time is None else 2,
        "shifts": 0 if time is None else 12,
        "engaged": None if time is None else 1.0,
        "feasible": time is not None,
        "failed": [] if time is not None else ["tip_width"],
        "smallest_margin": 0.01 * (trial + 1),
        "weakest_check": "tip_width",
        "margins": {"tip_width": 0.01 * (trial + 1), "module": 0.5},
        "margin_worst_case": -0.02,
        "weakest_check_worst_case": "root_fatigue",
        "margin_root_sum_square": 0.0,
        "time_within_tolerances": None,
    }
    return row | changes


def point(mismatch: float, force: float, mean: float, error: float, engaged: float = 1.0) -> Row:
    return {
        "mismatch_rpm": mismatch,
        "force_N": force,
        "mean_s": mean,
        "mean_engaged_s": mean,
        "standard_error_s": error,
        "sd_s": 0.01,
        "engaged": engaged,
        "n": 16,
    }


def check(name: str, margin: float, **changes: Any) -> Row:
    """A check with a margin."""
    row: Row = {
        "name": name,
        "value": 1.0,
        "limit": 1.0,
        "unit": "",
        "margin": margin,
        "passed": margin >= 0.0,
        "group": "load",
        "at_most": True,
        "meaning": "",
        "formula": "",
        "source": "",
        "limit_key": "",
    }
    return row | changes


def confirmation_of(points: list[Row], mean: float) -> Row:
    return {
        TIME: mean,
        "standard_error_s": 0.0006,
        "points": points,
        "checks": [],
        "estimates": {TIME: {"value": mean, "standard_error": 0.0006}},
        "numerical_error_s": 1e-6,
        "engages": True,
        "engaged": 1.0,
        "drake": None,
    }


def shift(study: Setup, values: Row, angle: float, time: float | None, **changes: Any) -> Row:
    """A shift as a journal holds it, of a design of the study."""
    clutch = replace(study.clutch, dog=study.dog_with(values))
    return {
        "key": f"{angle:010.4f}-{values['chamfer_deg']}",
        **clutch_record(clutch),
        "mismatch_rpm": 50.0,
        "force_N": 469.0,
        "force_rise_s": 0.1766,
        "relative_angle_deg": angle,
        "outcome": "blocked" if time is None else "engaged",
        "shift_time_s": time,
        "seed": study.file.expectation.seed,
    } | changes


def record_of(result: Row, **changes: Any) -> StudyRecord:
    """Record a result with other keys."""
    return StudyRecord(**(result | changes))


def bundled_result(name: str = "mq200_paper") -> Row:
    """Read the result of a bundled study."""
    record: Row = json.loads((bundled_root() / name / "result.json").read_text("utf-8"))
    return record


def bundled_folder(root: Path) -> StudyFolder:
    """Make a folder of the paper's study with its bundled result, without single shifts."""
    root.mkdir(parents=True)
    folder = StudyFolder(root)
    folder.open(load_study(bundled_root() / "mq200_paper" / "study.toml"), resume=False)
    shutil.copy(bundled_root() / "mq200_paper" / "result.json", folder.result)
    return folder


def search_result() -> Row:
    """A search of six designs: prototype, two on the front, one beaten, two that fail."""
    rows = [
        design(0, 0.100, 8.0),
        design(1, 0.080, 6.0),
        design(2, 0.070, 7.0),
        design(3, 0.090, 7.5),
        design(4, 0.060, 6.5, feasible=False, failed=["edge_bedding_impact"]),
        design(5, None, 5.0),
    ]
    prototype_points = [point(50, 235.2, 0.110, 0.002), point(100, 235.2, 0.090, 0.003, 0.5)]
    best_points = [point(50, 235.2, 0.060, 0.002), point(100, 235.2, 0.100, 0.002)]
    return {
        "study": "mq200_paper",
        "engine": "planar",
        "audit": None,
        "objectives": [TIME, LENGTH],
        "leading": TIME,
        "quantile": 0.95,
        "trials": rows,
        "best": rows[2],
        "front": [rows[2], rows[1]],
        "n_simulated_designs": 5,
        "n_simulated_shifts": 100,
        "surrogate": None,
        "versions": {},
        "config_hash": "",
        "physics_hash": "",
        "failed_shifts": {},
        "life": None,
        "confirmation": {
            "angles": 16,
            "chosen": 2,
            "prototype": confirmation_of(prototype_points, 0.100),
            "best": confirmation_of(best_points, 0.080),
            "designs": [{"trial": 2, **confirmation_of(best_points, 0.080)}],
            "left_out": [],
            "gain_s": 0.020,
            "gain_standard_error_s": 0.001,
            "gain_share": 0.2,
            "gains": {TIME: {"value": 0.020, "standard_error": 0.001}},
        },
    }
