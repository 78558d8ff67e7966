"""Every public result has a record, a table, a figure, a page and a notebook's view."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import plotly.graph_objects as go
import plotly.io as pio
import pytest

import dogshape as ds
from dogshape.expectation import DrawnExpectation
from dogshape.fitted import Fitted
from dogshape.result import Result
from dogshape.surrogate.store import load

ROOT = Path(__file__).parents[2]
SURROGATE = ROOT / "studies" / "mq200_paper" / "surrogate.json"
MAX_PAGE_SIZE = 2_000_000  #: bytes
POINT = {"mismatch_rpm": 100, "force_N": 469}


def paper_study() -> ds.Study:
    return ds.Study("mq200_paper")


def drawn_expectation() -> DrawnExpectation:
    times = np.array([0.10, 0.11, 0.13])
    return DrawnExpectation((paper_study().config,) * 3, times, np.full(3, 0.004))


def fitted_surrogate() -> Fitted:
    return Fitted(paper_study().config, load(SURROGATE), SURROGATE, 0.0)


def predictions() -> ds.Predictions:
    designs = pd.DataFrame({"chamfer_deg": [9.0, 11.0, 11.0], "count": [14, 18, 200]})
    return paper_study().predict(designs)


RESULTS: dict[str, Callable[[], Result]] = {
    "shift": lambda: paper_study().shift(**POINT, angle_deg=10),
    "expectation": lambda: paper_study().expect(**POINT, angles=3, jobs=1),
    "drawn expectation": drawn_expectation,
    "strength": lambda: paper_study().strength(simulate=False),
    "check": lambda: paper_study().check(surrogate=SURROGATE),
    "contact sets": lambda: ds.compare("lubricated_steel", "adams2019"),
    "predictions": predictions,
    "surrogate": fitted_surrogate,
}


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_has_all_of_its_forms(name: str, tmp_path: Path) -> None:
    result = RESULTS[name]()
    json.dumps(result.to_dict(), allow_nan=False)
    assert len(result.to_frame())
    figure = result.plot()
    assert isinstance(figure, go.Figure)
    assert any(len(trace.y if trace.y is not None else trace.x) for trace in figure.data)
    page = result.report(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Plotly.newPlot" in page
    assert 'src="http' not in page
    assert len(page) < MAX_PAGE_SIZE


def test_a_notebook_shows_tables_with_escaped_cells() -> None:
    html = RESULTS["strength"]()._repr_html_()
    assert html.count("<table>") == 1
    assert "root" in html
    comparison = ds.compare("lubricated_steel", "adams2019")
    assert "<th style" in comparison._repr_html_()
    assert "<script" not in html


def test_a_notebook_shows_a_study_as_a_table() -> None:
    html = paper_study()._repr_html_()
    assert "28 with 5 to 249" in html.replace("\N{NO-BREAK SPACE}", " ")
    assert html.count("<tr>") == 1 + len(paper_study().dog)


def test_a_figure_in_a_notebook_loads_nothing_from_a_network() -> None:
    figure = RESULTS["strength"]().plot()
    bundle = pio.renderers["offline"].to_mimebundle(figure.to_dict())
    assert "Plotly.newPlot" in bundle["text/html"]
    assert 'src="http' not in bundle["text/html"]


def test_margins_show_the_failed_checks() -> None:
    strength = ds.Study("mq200_paper", height_mm=6).strength(simulate=False)
    (bars,) = strength.plot().data
    percents = dict(zip(bars.y, bars.x, strict=True))
    assert min(percents.values()) < 0.0
    failed = [name for name, shape in zip(bars.y, bars.marker.pattern.shape, strict=True) if shape]
    assert len(failed) == len(strength.failed)


def test_predictions_have_asymmetric_intervals() -> None:
    many = predictions()
    times = many.to_frame()["expected_shift_time_s"].dropna()
    drawn = [time for trace in many.plot().data for time in trace.y]
    assert sorted(drawn) == pytest.approx(sorted(1e3 * times))
