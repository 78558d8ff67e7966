"""Earlier names of verbs and options, which work for one version."""

from __future__ import annotations

from collections.abc import Sequence

#: Verbs by their earlier words; those of two words first.
VERBS: dict[tuple[str, ...], str] = {
    ("gap", "plan"): "plan-shifts",
    ("gap", "update"): "update-diagnosis",
    ("gap",): "diagnose",
    ("study",): "search",
}
#: Options of a verb by their earlier names.
OPTIONS = {
    "shift": {"--relative-angle-deg": "--angle-deg", "--html": "--report"},
    "expect": {"--keep": "--journal"},
    "strength": {
        "--simulation": "--simulate",
        "--no-simulation": "--no-simulate",
        "--keep": "--journal",
    },
    "validate": {"--keep": "--journal"},
}
#: Verb for an option that was one of another verb, whose value is now the second argument.
SPLIT_OPTIONS = {
    ("check", "--designs"): "predict",
    ("expect", "--draws"): "expect-draws",
}


def current_words(arguments: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Translate a command line into the present names of verbs and options.

    Returns the words, and the present name by each earlier one that was there.
    """
    words = list(arguments)
    renamed: dict[str, str] = {}
    for old_verb, new_verb in VERBS.items():
        if tuple(words[: len(old_verb)]) == old_verb:
            words[: len(old_verb)] = [new_verb]
            renamed[" ".join(old_verb)] = new_verb
            break
    verb = words[0] if words else ""
    for (split_verb, option), new_verb in SPLIT_OPTIONS.items():
        place = _place_of(words, option)
        if verb == split_verb and place is not None:
            words = _moved_option(words, place, new_verb)
            renamed[f"{split_verb} {option} FILE"] = f"{new_verb} STUDY FILE"
    names = OPTIONS.get(verb, {})
    for index, word in enumerate(words):
        name, sign, value = word.partition("=")
        if name in names:
            words[index] = f"{names[name]}{sign}{value}"
            renamed[name] = names[name]
    return words, renamed


def _place_of(words: Sequence[str], option: str) -> int | None:
    """Find an option that has a value among words; None without it."""
    for place, word in enumerate(words):
        if word.startswith(f"{option}=") or (word == option and place + 1 < len(words)):
            return place
    return None


def _moved_option(words: Sequence[str], place: int, verb: str) -> list[str]:
    """Make the value of the option at ``place`` the last argument of another verb."""
    _, sign, value = words[place].partition("=")
    if sign:
        return [verb, *words[1:place], *words[place + 1 :], value]
    return [verb, *words[1:place], *words[place + 2 :], words[place + 1]]
