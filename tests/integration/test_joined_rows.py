"""A search that begins with the rows of the surrogate that the package brings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dogshape.pipeline.config.study_file import load_study
from dogshape.pipeline.search.search import open_search
from dogshape.pipeline.store.folder import StudyFolder
from dogshape.pipeline.study import Run, run_study
from dogshape.pipeline.train.found_surrogates import digest_of, known_surrogate
from dogshape.sim.errors import StorageError


def test_a_search_goes_on_with_the_rows_that_it_began_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fewer rows, other parameters or none at all are refused; other figures are not."""
    brought = known_surrogate(load_study("mq200_paper"))
    assert brought is not None
    known = brought.surrogate
    data = replace(known, data=known.data.subset(np.arange(100)))
    theta = known.times.covariance.theta + 1e-6
    times = replace(known.times, covariance=replace(known.times.covariance, theta=theta))
    others = {
        "other rows than the package brings": replace(brought, surrogate=data),
        "began with other rows": replace(brought, surrogate=replace(known, times=times)),
        "rows that the package does not bring now; go on with the version of dogshape": None,
    }
    study = load_study("mq200_paper", ["search.trials=1"])
    StudyFolder(tmp_path).open(study, resume=True)
    began = open_search(study, StudyFolder(tmp_path), None, True, known=digest_of(brought))
    for words, other in others.items():
        monkeypatch.setattr("dogshape.pipeline.study.joining", lambda *_, other=other: other)
        with pytest.raises(StorageError, match=words):
            run_study(study, Run(StudyFolder(tmp_path), resume=True))
    judged = replace(brought, validation=replace(brought.validation, shifts=1))
    open_search(study, StudyFolder(tmp_path), None, True, known=digest_of(judged))
    began.optuna.set_user_attr("known", "")
    with pytest.raises(StorageError, match="without the rows that the package brings now"):
        open_search(study, StudyFolder(tmp_path), None, True, known=digest_of(brought))
