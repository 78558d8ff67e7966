"""Effects, indices and prices of limits from a study's surrogate: computed once, then stored."""

from __future__ import annotations

from dogshape.pipeline.reports.kit.look import Row
from dogshape.pipeline.reports.study.prices import prices
from dogshape.pipeline.reports.surrogate.record import Say, learned
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.train.training_rows import study_mix
from dogshape.sim.errors import DogshapeError, StorageError
from dogshape.surrogate.expected_time import Over
from dogshape.surrogate.query import require_same_physics
from dogshape.surrogate.store import load

AGAIN = "run 'dogshape report' again"


def learn_effects(folder: StudyFolder, say: Say) -> None:
    """Store effects and indices of the folder's surrogate unless they are there (a minute).

    A folder without a surrogate has none; a surrogate that cannot be used is said.
    """
    if not folder.surrogate.is_file() or stored_effects(folder) is not None:
        return
    study = folder.stored_study()
    try:
        surrogate = load(folder.surrogate).surrogate
        require_same_physics(surrogate.data, study.physics)
    except DogshapeError as error:
        say(f"no effects in the report: {error}")
        return
    say("what each variable does, from the surrogate (a minute)")
    over = Over(surrogate, study_mix(study))
    found = learned(study, surrogate, over, say)
    say("what each limit costs, from the surrogate (half a minute)")
    found["prices"] = prices(study, over)
    write_json(folder.effects, {"surrogate": _identity(folder), **found})


def stored_effects(folder: StudyFolder) -> Row | None:
    """Read what the folder's surrogate as it is now was found to say; None without it."""
    try:
        stored = read_json(folder.effects, AGAIN)
        fits = stored["surrogate"] == _identity(folder)
        fits &= all("without_s" in row for row in stored["prices"])
        return {key: stored[key] for key in ("effects", "indices", "prices")} if fits else None
    except (StorageError, KeyError):
        return None


def _identity(folder: StudyFolder) -> str:
    return str(read_json(folder.surrogate, AGAIN).get("hash"))
