"""Say which sections of the documents hold results, and which of their numbers need no source.

A section is in ``RESULTS``, where each figure has an entry of ``benchmarks.published`` or matches a
pattern with a reason, or in ``OTHERS`` with the reason why none of its figures is held.
"""

from __future__ import annotations

SPEEDS, FORCES = r"(?:5|10|25|50|100|149|249)", r"(?:235(?:\.2)?|315\.5|469|641\.5)"
#: Numbers that are no results, wherever they stand.
EVERYWHERE = (
    (rf"\b{SPEEDS}(?:,? (?:and|to) {SPEEDS})*\s1/min", "speed of an operating point"),
    (rf"\b{FORCES}\b(?: (?:to|and) {FORCES})?(?:\sN)?(?!\w)", "force of an operating point"),
    (r"\b9[05] %\)?\s(?:intervals?|quantile)|in\s95 %|hold 90 %", "level of an interval"),
)

DEFINITIONS = "keys, limits and constants of the method, which its tests hold"
ONCE = "measured once while the method was chosen; no table is kept"
TABLES = "quoted from tables of docs/evidence, not yet entered one by one"

RESULTS: dict[str, dict[str, tuple[tuple[str, str], ...]]] = {
    "README.md": {
        "What it found": (
            (r"28 operating points", "of the default study"),
            (r"the 90 % set|above 0\.95", "levels of the figures, in validation/blind/figures.py"),
        )
    },
    "docs/results.md": {
        "The default study": (
            (
                r"friction of 0\.1 in|more than 2 ms|at 64 angles|what 1 % of",
                "keys of its study file",
            ),
        ),
        "As the paper asks": (
            (r"below\s0\.01 ms", "a bound on numerical_error_s, rounded up"),
            (r"16 new relative angles|among 256 of", "keys of the study file"),
            (r"\(0\.12\)|\(1\.5 mm\)", "keys of the study file"),
        ),
        "Under other contact": (
            (r"25 designs over", "size of the table"),
            (r"Friction of 0\.1 in|0\.3 kg and a drag of 0\.1 N m", "settings of the table"),
        ),
        "Other bundled studies": (
            (
                r"63\.55 ± 0\.26 ms at 6\.69 mm",
                "`make study` on another machine; it keeps its own result",
            ),
            (
                r"60\.4 ± 3\.1 ms|110 ± 4 ms at 7\.1 mm|67 ± 1 ms, 8\.6 mm and\s18\.3 ± 0\.4 kN",
                "the row before, in the history of result.json",
            ),
        ),
        "Shift control searched with the shape": (
            (r"to 15 1/min|reach 1\.4 N s", "keys of its study file"),
        ),
        "Over the life": ((r"If 0\.1 mm is lost", "a row of the table"),),
        "Against the published model": (
            (r"25 cells that have", "cells of the bench tables with a time"),
            (
                r"up to 20 ms at low(?s:.)*?by up to 19 %",
                "printed by `dogshape validate mq200_adams`",
            ),
        ),
        "Against the stand: why a tenth of a second?": (
            (r"121 ms longer", "mean of both tables in studies/bench"),
            (r"A drag of 1 N m and more", "low end of the interval, rounded"),
            (r"0\.5 N m at most", "ordinary size of the effect drag_torque"),
        ),
        "Does the diagnosis find what is there?": (),
    },
    "docs/model.md": {
        "The surrogate in short": ((r"28 operating points, 40 designs", "what was held out"),),
    },
    "docs/planar.md": {
        "How well both agree": (
            (r"\(40 to 120 mm, 0\.2 to 2 kg\)", "sizes of the benchmark's clutches"),
            (r"\| 90 % \|", "a quantile"),
            (r"at\s+0\.3 mm/kN", "a setting of the benchmark"),
            (r"more\s+than a percent", "threshold of the table"),
            (r"one of the 32 shifts", "size of the benchmark"),
            (r"within 1 % at single", "tolerance of the test"),
        ),
    },
    "docs/simulation.md": {
        "Rounded edges": (
            (r"(?:45|90)°|d\^1\.5|2 s\)", "the formulas"),
            (r"an edge of 0\.3 mm|gives 20 N/mm", "a row of the table"),
            (r"\| 0(?:\.\d)? \||edges of 0\.\d mm", "radii of the table"),
            (r"28 operating points|24 angles|of each 672", "size of the table"),
            (r"at 0\.3 mm one shift", "lost shifts of the table's last row"),
        ),
    },
    "docs/search.md": {
        "How sure the front is": ((r"\(24\)|Above 3", "rules of confirmation"),),
        "Against other samplers": (
            (r"230(?: shifts)?|1152|384 compiled shifts|288 shifts", "set for the comparison"),
            (r"by 0\.02 to 0\.17|by\s+0\.0(?:02|1|2)", "races of samplers.txt"),
            (r"had 0\.93 at", "the row before, in the history of samplers.txt"),
            (r"by 0\.0[35] ± 0\.02", "measured once, by a reference point that is no more"),
            (r"0\.60 to 0\.71|to 0\.95", "rows of the table above"),
            (r"took 0\.9 minutes(?s:.)*?to 0\.8", "costs of samplers.txt, other on each machine"),
            (r"(?:48|55) designs", "counts of samplers.txt"),
        ),
    },
    "docs/surrogate.md": {
        "Model": (
            (r"\)/0\.04|a share of 0\.999", "shape of the covariance, an example"),
            (r"predicted to 10 %", "rmse of ln t in the table above, rounded"),
        ),
        "One level": (
            (r"20 000 shifts|500 designs at|12 or 24 angles|costs 1\.2 s", "how it was made"),
            (r"40 designs that", "what was held out"),
        ),
    },
}

OTHERS: dict[str, dict[str, str]] = {
    "README.md": {
        "": "what the program does",
        "Start": "what to type",
        "From Python": "what to type",
        "Your own clutch and your own bench": "what to type",
        "Read on": "links",
    },
    "docs/results.md": {"": "what the page holds"},
    "docs/commands.md": dict.fromkeys(
        (
            *("", "Install", "Verbs", "Begin with a folder"),
            *("Compare", "Decide for a design", "A study of your own"),
            "On many machines",
            *(
                "How long it takes",
                "When something goes wrong",
                "Exit status",
                "What a study's folder holds",
            ),
        ),
        "examples, limits and defaults",
    ),
    "docs/model.md": {
        "": "a heading",
        **dict.fromkeys(
            ("Scope", "Conventions", "Physics in short", "Strength in short"), DEFINITIONS
        ),
    },
    "docs/bench.md": dict.fromkeys(
        (
            *(
                "",
                "Format",
                "Record",
                "Step of the clock",
                "Errors of nominal values",
                "From a table of your own",
            ),
            *("Slips of units and axes", "Along the shift"),
        ),
        DEFINITIONS,
    ),
    "docs/blind.md": {
        **dict.fromkeys(
            ("", "Truth", "Field sets", "Yardstick", "Figures and aims", "Seal"), DEFINITIONS
        ),
        **dict.fromkeys(
            (
                "The score of the published set",
                "Self-consistency",
                "Both engines without any effect",
            ),
            TABLES,
        ),
        "Cost": ONCE,
    },
    "docs/diagnosis.md": dict.fromkeys(
        ("", "Simulations", "One effect", "Several effects", "The flight", "Limits"), DEFINITIONS
    ),
    "docs/tutorial.md": dict.fromkeys(
        (
            "",
            "1. The first study",
            "2. A clutch of your own",
            "3. A bench of your own",
            "4. An effect of your own",
            "Where to go on",
        ),
        "made by the commands of the page, which tests/integration/test_learning_pages.py runs",
    ),
    "docs/effects.md": {
        **dict.fromkeys(("", "The effects", "Mechanism", "An effect of your own"), DEFINITIONS),
        "Checked": ONCE,
    },
    "docs/glossary.md": dict.fromkeys(
        ("", "The clutch", "The shift", "Statistics", "Search", "Diagnosis"), "words"
    ),
    "docs/index.md": dict.fromkeys(("", "Start", "Pages", "Sources"), "what to read"),
    "docs/proof.md": {
        **dict.fromkeys(("", "Kinds of test", "How figures are proven"), DEFINITIONS),
        **dict.fromkeys(("Verification", "Valid range", "Cost"), TABLES),
    },
    "docs/gap.md": {
        **dict.fromkeys(
            ("", "Parts of the report", "Plan of shifts", "New readings", "Calibrated study"),
            DEFINITIONS,
        ),
        "The stand, end to end": "printed by the commands of the section",
    },
    "docs/inference.md": {
        **dict.fromkeys(
            (
                *("", "Hypotheses", "Likelihood", "Evidence", "Readings of the record"),
                *("Decision", "Next test"),
            ),
            DEFINITIONS,
        ),
        "Constants": "written by benchmarks/constants.py",
    },
    "docs/mismatch.md": dict.fromkeys(
        ("", "Which ring is the sliding one", "In the simulation", "Where it is not known"),
        "a definition",
    ),
    "docs/planar.md": dict.fromkeys(
        ("", "What is the same, and what is not", "Simulations of a diagnosis", "The first start"),
        DEFINITIONS,
    ),
    "docs/search.md": {
        **dict.fromkeys(
            (
                "",
                "What is proposed",
                "What is simulated",
                "In two levels",
                "What a limit costs",
                "Checked",
            ),
            DEFINITIONS,
        ),
        "What is kept": TABLES,
    },
    "docs/simulation.md": dict.fromkeys(("", "What is modelled", "Friction"), DEFINITIONS),
    "docs/strength.md": {
        **dict.fromkeys(
            ("", "Material", "Dog on dog", "Flank strike", "Drawing, print, CAD"), DEFINITIONS
        ),
        **dict.fromkeys(
            (
                "Load",
                "What touches",
                "Root",
                "Locking",
                "Under the loads of a gearbox",
                "Tolerances",
            ),
            TABLES,
        ),
    },
    "docs/studies.md": {
        "": DEFINITIONS,
        "Operating points": DEFINITIONS,
        "Uncertainty": ONCE,
        "Mechanism and effects": DEFINITIONS,
        "Rounded edges": DEFINITIONS,
        "Further loads": DEFINITIONS,
        "Wear over the life": DEFINITIONS,
        "Shift control as variables": DEFINITIONS,
        "Objectives and limits": ONCE,
        "Shifts of a command that was stopped": DEFINITIONS,
        "Keys of `result.json`": "units and meanings of keys",
    },
    "docs/surrogate.md": {
        **dict.fromkeys(("", "Data", "Expectation over a mix"), DEFINITIONS),
        "Validation": TABLES,
        **dict.fromkeys(("What if, live", "The file"), DEFINITIONS),
        "Where to simulate next": TABLES,
        "Asking": TABLES,
    },
}
