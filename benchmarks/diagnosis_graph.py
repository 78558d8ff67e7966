"""Draw the model of the diagnosis as a graph, each box with its module.

python -m benchmarks.diagnosis_graph > docs/diagnosis_model.svg
"""

from __future__ import annotations

from xml.sax.saxutils import escape

#: Box by name: column, row, title, what it says, module below ``diagnosis``.
BOXES = {
    "data": (0, 0, "Bench data", "shifts, traces, margin", "bench/bench_data.py"),
    "priors": (1, 0, "Hypotheses and priors", "each effect by itself", "prediction/hypotheses.py"),
    "bank": (2, 0, "Bank of simulations", "each effect at some levels", "prediction/bank.py"),
    "seen": (0, 1, "Observations", "mean, spread, late, engaged", "likelihood/observations.py"),
    "together": (1, 1, "Combination", "sum or product of effects", "prediction/combination.py"),
    "emulator": (2, 1, "Emulator", "times at any value", "prediction/emulator.py"),
    "flight": (0, 2, "Marks of the flight", "traces only", "likelihood/flight_likelihood.py"),
    "cell": (1, 2, "Likelihood of a cell", "odd cells as well", "likelihood/cell_likelihood.py"),
    "wrong": (2, 2, "Discrepancy", "of inferred amplitude", "likelihood/discrepancy.py"),
    "unknown": (0, 3, "Unknown", "smooth offsets of cells", "inference/unknown.py"),
    "evidence": (1, 3, "Evidence", "over the priors", "inference/evidence.py"),
    "ranking": (2, 3, "Ranking", "singles, pairs, some threes", "inference/ranking.py"),
    "check": (0, 4, "Predictive check", "could it make such data", "inference/predictive_check.py"),
    "posterior": (1, 4, "Posterior", "what is unseen counts as none", "inference/posterior.py"),
    "classes": (2, 4, "Classes", "what data cannot part", "inference/classes.py"),
    "same": (0, 5, "Equivalence", "gap within the margin", "inference/equivalence.py"),
    "verdict": (1, 5, "Verdict", "effect, none, unknown, ambiguous", "inference/verdict.py"),
    "next": (2, 5, "Next test", "what settles it", "inference/next_test.py"),
}  # fmt: skip
ARROWS = (
    "data seen", "bank emulator", "together emulator", "priors together", "seen flight",
    "seen cell", "emulator cell", "emulator wrong", "flight evidence",
    "cell evidence", "wrong evidence", "evidence ranking", "unknown posterior",
    "evidence posterior", "ranking posterior", "check posterior", "posterior classes",
    "posterior same", "posterior verdict", "same verdict", "classes verdict", "verdict next",
)  # fmt: skip
WIDE, HIGH, ACROSS, DOWN, EDGE = 270, 74, 335, 116, 20  #: of boxes and from box to box, pixels
STYLE = """
.graph rect.box{fill:#dbe5f0;stroke:#1b2733;stroke-width:1.4}
.graph line{stroke:#55626f;stroke-width:1.4;marker-end:url(#tip)}
.graph text{font:13px system-ui,sans-serif;fill:#1b2733;text-anchor:middle}
.graph text.title{font-size:15px;font-weight:600}
.graph text.module{font:12px ui-monospace,monospace;fill:#55626f}
"""


def _corner(name: str) -> tuple[int, int]:
    column, row = BOXES[name][:2]
    return EDGE + column * ACROSS, EDGE + row * DOWN


def _box(name: str) -> str:
    _, _, title, what, module = BOXES[name]
    x, y = _corner(name)
    middle = x + WIDE // 2
    lines = (("title", 23, title), ("what", 43, what), ("module", 63, module))
    texts = "".join(
        f'<text class="{kind}" x="{middle}" y="{y + down}">{escape(text)}</text>'
        for kind, down, text in lines
    )
    return f'<rect class="box" x="{x}" y="{y}" width="{WIDE}" height="{HIGH}" rx="4"/>{texts}'


def _arrow(pair: str) -> str:
    """Draw an arrow from side to side in a row, from row to row else."""
    (x, y), (to_x, to_y) = (_corner(name) for name in pair.split())
    if y == to_y:
        right = to_x > x
        ends = x + WIDE * right, y + HIGH // 2, to_x + WIDE * (not right), y + HIGH // 2
    else:
        lean = (to_x > x) - (to_x < x)
        from_x, at_x = (left + WIDE // 2 + sign * lean * 80 for left, sign in ((x, 1), (to_x, -1)))
        ends = from_x, y + HIGH, at_x, to_y
    return '<line x1="{}" y1="{}" x2="{}" y2="{}"/>'.format(*ends)


def drawing() -> str:
    """Return the graph as SVG."""
    width, height = 2 * ACROSS + WIDE + 2 * EDGE, 5 * DOWN + HIGH + 2 * EDGE
    title = "The model of the diagnosis"
    tip = (
        '<marker id="tip" viewBox="0 0 10 10" refX="10" refY="5" markerWidth="8" '
        'markerHeight="8" orient="auto"><path d="M0,1 L10,5 L0,9 Z" fill="#55626f"/></marker>'
    )
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}" class="graph" role="img" aria-label="{title}">'
    )
    parts = [
        head,
        f"<title>{title}</title>",
        f"<style>{STYLE}</style>",
        f"<defs>{tip}</defs>",
        f'<rect width="{width}" height="{height}" fill="#fff"/>',
        *map(_arrow, ARROWS),
        *map(_box, BOXES),
        "</svg>",
    ]
    return "\n".join(parts)


if __name__ == "__main__":
    print(drawing())
