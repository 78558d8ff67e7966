"""How many designs, angles and pairs a fit in two levels has."""

from __future__ import annotations

from collections import Counter

import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.train.mix_rows import LEAST, USUAL, angles_of, count_of, mix_blocks
from dogshape.pipeline.train.two_level_rows import APIECE, compiled, paired

ONE = {"operating.mismatch_rpm": [25.0], "operating.force_N": [469.0]}
EIGHT = {"operating.mismatch_rpm": [5.0, 25.0, 100.0, 249.0], "operating.force_N": [235.2, 641.5]}


@pytest.mark.parametrize(("settings", "angles"), [({}, 8), (EIGHT, 16), (ONE, 128)])
def test_a_design_has_enough_angles_at_each_point_and_shifts_in_all(
    settings: dict[str, object], angles: int
) -> None:
    study = load_study("mq200_paper", {**settings, "surrogate.mix_shifts": 50_000})
    assert angles_of(study) == angles >= LEAST
    each = angles * len(study.points)
    assert each >= USUAL
    assert count_of(study) == 50_000 // each
    blocks = mix_blocks(compiled(study), study.prototype, 3)
    assert sum(len(block.angles) for block in blocks) == each
    assert {block.clutch.solver.engine for block in blocks} == {"planar"}


def test_two_designs_have_no_angle_in_common() -> None:
    study = compiled(load_study("mq200_paper", EIGHT))
    seen = [block.angles[0] for k in (0, 1) for block in mix_blocks(study, study.prototype, k)]
    assert len(set(seen)) == len(seen)


@pytest.mark.parametrize("size", [1, 2, 8, 28, 200])
def test_references_share_drake_evenly_over_the_points(size: int) -> None:
    each = [list(paired(index, size)) for index in range(60)]
    assert all(len(points) >= min(size, APIECE) for points in each)
    assert all(len(points) <= 2 * APIECE for points in each)
    counts = Counter(point for points in each for point in points)
    assert set(counts) == set(range(size))
    assert max(counts.values()) - min(counts.values()) <= max(1, len(each) // APIECE)
