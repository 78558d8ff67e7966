// On paper a figure has the width of the page, not that of the window, and is less tall.
const PAPER = 700, LOWER = 0.82;
function fit(onPaper) {
  for (const figure of document.querySelectorAll(".js-plotly-plot")) {
    figure.screenHeight ??= figure.layout.height;
    const height = (onPaper ? LOWER : 1) * figure.screenHeight;
    Plotly.relayout(figure, onPaper ? {width: PAPER, height, autosize: false} : {width: null, height, autosize: true});
  }
}
addEventListener("beforeprint", () => fit(true));
addEventListener("afterprint", () => fit(false));
