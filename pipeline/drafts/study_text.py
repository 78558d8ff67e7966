"""Text of a study file with the values of a study that was changed after it was read."""

from __future__ import annotations

import tomllib

from dogshape.bench.texts import text_of
from dogshape.pipeline.config.operating import dotted_keys, replaced_keys, value_at
from dogshape.pipeline.config.schema import StudyFile
from dogshape.pipeline.config.study_file import Setup, find_study
from dogshape.pipeline.config.toml_text import meanings_of, toml_text, with_values
from dogshape.pipeline.diagnose.study_keys import Data
from dogshape.pipeline.drafts.draft_source import COMMENTED
from dogshape.sim.clutch_tables import validate


def study_text(study: Setup) -> str:
    """Write the file of a study: that it was read from, with the values that differ.

    A new value has the comment of its key in the study that explains the keys. A study that was not
    read from a file has no comments.
    """
    tables = study.file.model_dump(exclude_none=True)
    if study.path is None:
        return toml_text(tables, {})
    text = text_of(study.path)
    text_tables = tomllib.loads(text)
    file = validate(StudyFile, tomllib.loads(text), str(study.path))
    file_tables = file.model_dump(exclude_none=True)
    changes: Data = {
        key: value_at(tables, key)
        for key in ("name", *dotted_keys(tables))
        if value_at(tables, key) != value_at(file_tables, key)
    }
    removed_keys = [
        key
        for key in dotted_keys(text_tables)
        if value_at(file_tables, key) is not None and value_at(tables, key) is None
    ]
    void_keys = [*removed_keys, *replaced_keys(changes, text_tables)]
    comments = meanings_of(text_of(find_study(COMMENTED)))
    return with_values(text, changes | dict.fromkeys(void_keys), comments)
