"""Effects that may explain why a bench differs from the simulation.

``catalogue`` has those of the package. A user's file ``NAME.py`` defines ``EFFECT``, an ``Effect``
of that name.
"""

from __future__ import annotations

import importlib.util
from pathlib import Path

from dogshape.sim.effect import Effect
from dogshape.sim.effects.catalogue import EFFECTS
from dogshape.sim.errors import InputError


def load(folder: Path | None = None) -> dict[str, Effect]:
    """Return all effects by name, in the order of their names.

    ``folder`` is one with effects of the user's. Files that begin with an underscore are no
    effects. Raises InputError where the folder is missing, a file cannot be run, has no
    ``EFFECT`` or another name than the effect, or a name is taken.
    """
    effects = {effect.name: effect for effect in EFFECTS}
    for path in own_files(folder).values() if folder else ():
        effect = _own_effect(path)
        if effect.name in effects:
            raise InputError(
                f"{path} defines the effect '{effect.name}', but there is one of that name; "
                "rename file and effect"
            )
        effects[effect.name] = effect
    return dict(sorted(effects.items()))


def own_files(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that ``load`` takes effects from, by the effects' names."""
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}; give one with effects as Python files")
    paths = sorted(path for path in folder.glob("*.py") if not path.name.startswith("_"))
    return {path.stem: path for path in paths}


def _own_effect(path: Path) -> Effect:
    spec = importlib.util.spec_from_file_location(f"user_effect_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"{path} cannot be read as Python; correct it or take it away")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        remedy = "correct it or take it away"
        if isinstance(error, ModuleNotFoundError) and (error.name or "").partition(".")[0] == "sim":
            remedy = "write 'from dogshape import Effect, Parameter, BenchTest'"
        raise InputError(
            f"{path} cannot be run ({type(error).__name__}: {error}); {remedy}"
        ) from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise InputError(f"{path} defines no EFFECT; define one of the type dogshape.Effect")
    if effect.name != path.stem:
        raise InputError(
            f"{path} defines the effect '{effect.name}', but an effect has the name of its file; "
            "rename one of the two"
        )
    return effect
