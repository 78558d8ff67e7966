"""Surrogates that exist already: of a study's results, or brought by the package."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.store.folder import StudyFolder, default_out
from dogshape.sim.bundled import bundled_root
from dogshape.sim.statistics.shift_records import content_key
from dogshape.sim.versions import engine
from dogshape.surrogate.dataset import differences
from dogshape.surrogate.store import MissingError, Stored, load


def space_out(study: Setup) -> Path:
    """Return the folder of designs that fill the space of a study."""
    return Path("results") / f"{study.name}-space"


def known_surrogate(study: Setup) -> Stored | None:
    """Return the surrogate that the package brings for the study's physics, None if it has none."""
    for path in sorted(bundled_root().glob("*/surrogate.json")):
        stored = load(path)
        if content_key(stored.surrogate.data.physics) == study.physics_hash:
            return stored
    return None


def joining(study: Setup, say: Callable[[str], None]) -> Stored | None:
    """Find the package's surrogate if its rows may join the study's own; report the decision."""
    brought = known_surrogate(study)
    if brought is None:
        return None
    known = brought.surrogate
    if differences(known.data.engine, engine()) or known.data.variables != tuple(study.variables):
        say("the surrogate that the package brings is of other versions, so it is not used")
        return None
    shifts, designs = known.data.shifts, len(known.data.designs)
    say(f"{shifts} shifts of {designs} designs that the package brings join")
    return brought


def digest_of(brought: Stored | None) -> str:
    """Return a hash of the rows and parameters that a search begins with; empty if there are none.

    How the surrogate was judged is no part of it.
    """
    if brought is None:
        return ""
    known = brought.surrogate
    return content_key(
        {
            "data": known.data.digest,
            "form": known.form,
            "times": known.times.covariance.theta.tolist(),
            "share": [known.share.length, known.share.strength],
        }
    )


def stored_surrogate(study: Setup, named: Path | None) -> tuple[Stored, Path]:
    """Return the surrogate to ask and its file.

    The one that is named; else that of the study's search, of its space, or the package's.
    DataError where there is none.
    """
    own = StudyFolder(default_out(study)).surrogate
    results = (own, StudyFolder(space_out(study)).surrogate)
    brought = bundled_root() / study.name / "surrogate.json"
    path = named or next((path for path in (*results, brought) if path.is_file()), None)
    if path is None and (known := known_surrogate(study)) is not None:
        return known, brought
    return load(path or own), path or own


def own_surrogate(study: Setup, named: Path | None) -> tuple[Stored, Path] | None:
    """Return the same, or None where there is none or only one of other physics that nobody named.

    DataError for a file that is named and not there, or damaged.
    """
    try:
        stored, path = stored_surrogate(study, named)
    except MissingError:
        if named is not None:
            raise
        return None
    apart = differences(study.physics, stored.surrogate.data.physics)
    return None if apart and named is None else (stored, path)
