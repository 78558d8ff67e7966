"""Effects that may explain why a bench differs from the simulation, one file each.

A file ``NAME.py`` defines ``EFFECT``, an ``Effect`` of that name. ``load`` finds those here and
those in a folder of the user's.
"""

from __future__ import annotations

import importlib
import importlib.util
from pathlib import Path
from types import ModuleType

from dogshape.sim.effect import Effect
from dogshape.sim.errors import InputError


def load(folder: Path | None = None) -> dict[str, Effect]:
    """Return all effects by name, in the order of their names.

    ``folder`` is one with effects of the user's. Files that begin with an underscore are no
    effects. Raises InputError where the folder is missing, a file cannot be run, has no
    ``EFFECT`` or another name than the effect, or a name is taken.
    """
    effects = {
        path.stem: _effect(importlib.import_module(f"dogshape.sim.effects.{path.stem}"), path)
        for path in _files(Path(__file__).parent)
    }
    for path in _files(folder) if folder else []:
        effect = _effect(_module(path), path)
        if effect.name in effects:
            raise InputError(
                f"{path} defines the effect '{effect.name}', but there is one of that name; "
                "rename file and effect"
            )
        effects[effect.name] = effect
    return dict(sorted(effects.items()))


def own_files(folder: Path) -> dict[str, Path]:
    """Return the files of a folder that ``load`` takes effects from, by the effects' names."""
    return {path.stem: path for path in _files(folder)}


def _files(folder: Path) -> list[Path]:
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}; give one with effects as Python files")
    return sorted(path for path in folder.glob("*.py") if not path.name.startswith("_"))


def _module(path: Path) -> ModuleType:
    """Return a user's file as a module; whatever it raises becomes a sentence."""
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
    return module


def _effect(module: ModuleType, path: Path) -> Effect:
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise InputError(f"{path} defines no EFFECT; define one of the type dogshape.Effect")
    if effect.name != path.stem:
        raise InputError(
            f"{path} defines the effect '{effect.name}', but an effect has the name of its file; "
            "rename one of the two"
        )
    return effect
