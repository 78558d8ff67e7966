// Scripts of the page are kept compressed; run each, then draw the figures from their JSON.
async function runPackedScripts() {
  for (const packed of document.querySelectorAll("script.packed")) {
    const bytes = Uint8Array.from(atob(packed.textContent), letter => letter.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const script = document.createElement("script");
    script.textContent = await new Response(stream).text();
    document.head.append(script);
  }
}

async function drawFigures() {
  for (const figure of document.querySelectorAll(".plotly-graph-div")) {
    const {data, layout} = JSON.parse(figure.nextElementSibling.textContent);
    await Plotly.newPlot(figure, data, layout, {displayModeBar: false, responsive: true});
  }
}

await runPackedScripts();
await drawFigures();
