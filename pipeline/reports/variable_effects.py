"""Effects and Sobol indices of a study's variables and prices of its limits, by its surrogate.

They are computed once and stored beside the surrogate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import islice

import numpy as np
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from dogshape.pipeline.config.study_file import Setup
from dogshape.pipeline.reports.look import BLUE, GREY, INK, Row, styled
from dogshape.pipeline.reports.prices import prices
from dogshape.pipeline.reports.text import axis, label
from dogshape.pipeline.store.folder import StudyFolder, read_json, write_json
from dogshape.pipeline.train.filling import filling_designs
from dogshape.sim.errors import DogshapeError, StorageError
from dogshape.surrogate.covariance import Array
from dogshape.surrogate.dataset import Dataset
from dogshape.surrogate.model import Surrogate
from dogshape.surrogate.query import in_range, require_same_physics
from dogshape.surrogate.sensitivity import (
    EVEN,
    LOG,
    SAMPLES,
    WHOLE,
    Indices,
    Input,
    effects,
    indices,
)
from dogshape.surrogate.store import load

Say = Callable[[str], None]

DESIGNS = 150  #: feasible designs that an effect is the mean over
APART = 70_000  #: added to the seed of the surrogate's data, so that none of these is among them
BOX = 0.1  #: half width of the box of the indices, in shares of the search range
AGAIN = "run 'dogshape report' again"
BESIDE = 3  #: panels of effects side by side


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
    found = {
        "effects": _effects_record(study, surrogate),
        "indices": _indices_record(study, surrogate),
    }
    say("what each limit costs, from the surrogate (half a minute)")
    found["prices"] = prices(study, surrogate)
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


def _effects_record(study: Setup, surrogate: Surrogate) -> Row:
    names = surrogate.data.variables
    seed = study.file.surrogate.seed + APART
    designs = islice(filling_designs(study, seed, border=False), DESIGNS)
    x = study.rows(designs)
    return {
        "designs": len(x),
        "outside_trained_range": 1.0 - float(in_range(surrogate, x).mean()),
        "mean_expected_shift_time_s": float(surrogate.predict(x)[0].mean()),
        "variables": [
            {
                "variable": one.variable,
                "values": _rounded(one.values),
                "effect_s": _rounded(one.effect),
                "low_s": _rounded(one.low),
                "high_s": _rounded(one.high),
                "distinguishable": one.clear,
            }
            for one in effects(surrogate, names, x)
        ],
    }


def _indices_record(study: Setup, surrogate: Surrogate) -> list[Row]:
    """Record the indices over designs, and over designs and operating points at once."""
    cut = len(surrogate.data.variables)
    box, seed = _box(study, surrogate.data), study.file.surrogate.seed + 1
    alone = indices(box, lambda z: surrogate.predict(z)[0], SAMPLES, seed)
    found = [_index_record("designs", alone)]
    operating = _operating_inputs(study)
    if operating:
        fixed = {"mismatch_rpm": study.mismatches[0],
                 "force_N": sorted(set(study.forces))[len(set(study.forces)) // 2]}  # fmt: skip

        def times(z: Array) -> Array:
            given = {one.name: z[:, cut + k] for k, one in enumerate(operating)}
            points = [given.get(name, np.full(len(z), value)) for name, value in fixed.items()]
            return surrogate.times_by_row(z[:, :cut], np.column_stack(points))

        whole = indices([*box, *operating], times, SAMPLES, seed)
        found.append(_index_record("designs and operating points", whole))
    return found


def _box(study: Setup, data: Dataset) -> list[Input]:
    """Return the box about the study's own design, within the simulated designs.

    A design beyond them has its box about the nearest value that was simulated.
    """
    sides = []
    for name, values in zip(data.variables, data.x.T, strict=True):
        known_low, known_high = float(values.min()), float(values.max())
        low, high = study.variables[name]
        centre = min(max(study.prototype[name], known_low), known_high)
        half = BOX * (high - low)
        if name == "count":
            half = max(1.0, round(half))
        ends = max(centre - half, known_low), min(centre + half, known_high)
        sides.append(Input(name, *ends, WHOLE) if name == "count" else Input(name, *ends))
    return sides


def _operating_inputs(study: Setup) -> list[Input]:
    """List mismatch and force over the study's ranges, without one that has a single value."""
    given = {"mismatch_rpm": study.mismatches, "force_N": study.forces}
    return [
        Input(name, min(values), max(values), LOG if min(values) > 0.0 else EVEN)
        for name, values in given.items()
        if min(values) < max(values)
    ]


def _index_record(over: str, found: Indices) -> Row:
    return {
        "over": over,
        "inputs": [
            {
                "variable": one.name,
                "first": float(found.first[k]), "first_half_width": float(found.first_half[k]),
                "total": float(found.total[k]), "total_half_width": float(found.total_half[k]),
            }
            for k, one in enumerate(found.inputs)
        ],
    }  # fmt: skip


def _rounded(values: Iterable[float]) -> list[float]:
    """Round numbers to six digits for JSON."""
    return [float(f"{value:.6g}") for value in values]


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
    # All lines, and of wide bands as much again either way.
    lines = [1e3 * v for one in shown for v in one["effect_s"]]
    span = max(lines) - min(lines) or 1.0
    figure.update_yaxes(matches="y", showticklabels=True,
                        range=[min(lines) - span, max(lines) + span])  # fmt: skip
    figure.update_yaxes(title="effect, ms", col=1)
    return styled(figure, 110 + 260 * rows)


def indices_figure(found: Row) -> go.Figure:
    """Draw first-order and total index of each input with their intervals."""
    inputs, figure = list(reversed(found["inputs"])), go.Figure()
    for key, name, colour, pattern in (
        ("total", "total: with all that it does together with others", "#b9c9dd", "/"),
        ("first", "first-order: alone", BLUE, ""),
    ):
        figure.add_bar(
            orientation="h",
            x=[one[key] for one in inputs],
            y=[label(one["variable"]) for one in inputs],
            error_x={"array": [one[f"{key}_half_width"] for one in inputs], "thickness": 1.2},
            name=name,
            marker={"color": colour, "pattern": {"shape": pattern}, "line": {"color": INK}},
            hovertemplate="%{y}: %{x:.2f}<extra></extra>",
        )
    figure.update_xaxes(title="share of the variance", rangemode="tozero")
    look = {"barmode": "group", "margin": {"l": 140}, "legend": {"traceorder": "reversed"}}
    return styled(figure, 130 + 48 * len(inputs)).update_layout(look)
