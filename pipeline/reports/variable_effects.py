"""Effects of a study's variables and prices of its limits, by its surrogate.

They are computed once and stored beside the surrogate.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.charts import BLUE, GREY, Row, styled
from dogshape.pipeline.reports.prices import prices
from dogshape.pipeline.reports.text import axis
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.train.training import filling_designs
from dogshape.sim.errors import DogshapeError, StorageError
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range, require_same_physics
from dogshape.surrogate.sensitivity import effects
from dogshape.surrogate.store import load

Say = Callable[[str], None]

DESIGNS = 150  #: feasible designs that an effect is the mean over
APART = 70_000  #: added to the seed of the surrogate's data, so that none of these is among them
BESIDE = 3  #: panels of effects side by side


def learn_effects(folder: StudyFolder, say: Say) -> None:
    """Store effects and prices of the folder's surrogate unless they are there (a minute).

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
    say("what each variable does and each limit costs, from the surrogate (a minute)")
    found = {"effects": _effects_record(study, surrogate), "prices": prices(study, surrogate)}
    write_json(folder.effects, {"surrogate": _identity(folder), **found})


def stored_effects(folder: StudyFolder) -> Row | None:
    """Read what the folder's surrogate as it is now was found to say; None without it."""
    try:
        stored = read_json(folder.effects, "run 'dogshape report' again")
        fits = stored["surrogate"] == _identity(folder)
        fits &= all("now_s" in row for row in stored["prices"])
        return {key: stored[key] for key in ("effects", "prices")} if fits else None
    except (StorageError, KeyError):
        return None


def _identity(folder: StudyFolder) -> str:
    return str(read_json(folder.surrogate, "run 'dogshape report' again").get("hash"))


def _effects_record(study: Setup, surrogate: Surrogate) -> Row:
    seed = study.file.surrogate.seed + APART
    x = study.rows(islice(filling_designs(study, seed, border=False), DESIGNS))

    return {
        "designs": len(x),
        "outside_trained_range": 1.0 - float(in_range(surrogate, x).mean()),
        "mean_expected_shift_time_s": float(surrogate.predict(x)[0].mean()),
        "variables": [
            {"variable": one.variable, **{
                key: [float(f"{number:.6g}") for number in values]
                for key, values in (("values", one.values), ("effect_s", one.effect),
                                    ("low_s", one.low), ("high_s", one.high))
            }}
            for one in effects(surrogate, surrogate.data.variables, x)
        ],
    }  # fmt: skip


def effects_figure(found: Row) -> go.Figure:
    """Draw the main effect of each variable on the expected shift time, ms, with its band."""
    shown = found["variables"]
    rows, columns = -(-len(shown) // BESIDE), min(len(shown), BESIDE)
    figure = make_subplots(rows, columns, horizontal_spacing=0.06, vertical_spacing=0.26 / rows)
    for place, one in enumerate(shown):
        x, where = one["values"], {"row": place // BESIDE + 1, "col": place % BESIDE + 1}
        ends = [1e3 * v for v in (*one["high_s"], *reversed(one["low_s"]))]
        figure.add_scatter(
            x=[*x, *reversed(x)], y=ends, name="95 % interval", legendgroup="band",
            showlegend=place == 0, mode="lines", fill="toself", hoverinfo="skip",
            fillcolor="rgba(31, 95, 168, 0.22)", line={"width": 0}, **where,
        )  # fmt: skip
        figure.add_scatter(
            x=x, y=[1e3 * v for v in one["effect_s"]], name="effect on the expected shift time",
            legendgroup="effect", showlegend=place == 0, mode="lines+markers",
            line={"color": BLUE, "width": 2.5}, **where,
        )  # fmt: skip
        figure.add_hline(0.0, line={"color": GREY, "width": 1}, **where)
        figure.update_xaxes(title=axis(one["variable"]), **where)
    # All lines, and of wide bands half as much again either way.
    lines = [1e3 * v for one in shown for v in one["effect_s"]]
    room = 0.5 * (max(lines) - min(lines)) or 1.0
    figure.update_yaxes(
        matches="y", showticklabels=True, range=[min(lines) - room, max(lines) + room]
    )
    figure.update_yaxes(title="effect, ms", col=1)
    return styled(figure, 110 + 260 * rows)
