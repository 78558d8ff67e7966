// Drawings of the page: the section of both rings, and a small curve for each number.
const Figures = (() => {
  const BLUE = "#1f5fa8", ORANGE = "#c8590c", GREY = "#8a96a3";
  const element = (name, given, text) => {
    const found = document.createElementNS("http://www.w3.org/2000/svg", name);
    for (const [key, value] of Object.entries(given)) found.setAttribute(key, value);
    if (text !== undefined) found.textContent = text;
    return found;
  };
  const path = points => "M" + points.map(([x, y]) => `${x.toFixed(2)} ${y.toFixed(2)}`).join("L");

  // Both rings at dogs over slots with the gap of neutral; the start's profile is dashed.
  function section(answer, start, gap) {
    const svg = document.getElementById("section"), width = 860, height = 250;
    const tall = Math.max(answer.height, start.height);
    const scale = Math.min(width / 44, (height - 70) / (2 * tall + gap));
    const up = 0.5 * height + 0.5 * gap * scale;
    svg.replaceChildren();
    const ring = (one, flip, given) => {
      const points = [], reach = Math.ceil(0.5 * width / scale / one.pitch) + 1;
      for (let k = -reach; k <= reach; k++) for (const [x, z] of flip > 0 ? one.section : [...one.section].reverse()) {
        const across = flip * x + (k + (flip > 0 ? 0 : 0.5)) * one.pitch;
        points.push([0.5 * width + across * scale, flip > 0
          ? up - (z - 0.5 * one.height) * scale : up - gap * scale + (z - 0.5 * one.height) * scale]);
      }
      const edge = flip > 0 ? height + 5 : -5;
      svg.append(element("path", {d: path(points) + (given.fill === "none" ? ""
        : `L${points.at(-1)[0]} ${edge}L${points[0][0]} ${edge}Z`), ...given}));
    };
    ring(answer, -1, {fill: "#c9d8ea", stroke: BLUE, "stroke-width": 2});
    ring(answer, 1, {fill: "#f3ddcb", stroke: ORANGE, "stroke-width": 2});
    ring(start, 1, {fill: "none", stroke: "#1b2733", "stroke-width": 1.2, "stroke-dasharray": "5 4"});
    const bar = 5 * scale, y = height - 12;
    svg.append(element("path", {d: `M${width - 16 - bar} ${y}h${bar}`, stroke: "#1b2733", "stroke-width": 3}),
      element("text", {x: width - 22 - bar, y: y + 4, "text-anchor": "end"}, "5 mm"),
      element("text", {x: 10, y: 18}, "sliding ring"),
      element("text", {x: 10, y: height - 10}, `output ring, unrolled at the mean radius; dashed: ${start.name}`));
  }

  // A curve of the expected time, ms, over one number, with the present design as a dot.
  function trend(variable, curve, here) {
    const svg = element("svg", {viewBox: "0 0 230 138", role: "img",
      "aria-label": `expected time over ${variable.label}`});
    const xs = curve.map(point => point[0]), ys = curve.map(point => point[1]).concat(here[1]);
    const [from, to] = [Math.min(...xs, here[0]), Math.max(...xs, here[0])];
    let [low, high] = [Math.min(...ys), Math.max(...ys)];
    if (high - low < 1) { low -= 0.5; high += 0.5; }
    const across = x => 38 + 184 * (x - from) / (to - from || 1), down = y => 112 - 84 * (y - low) / (high - low);
    svg.append(element("path", {d: "M38 22V112H222", fill: "none", stroke: GREY}),
      element("path", {d: path(curve.map(([x, y]) => [across(x), down(y)])), fill: "none", stroke: BLUE, "stroke-width": 2}),
      element("circle", {cx: across(here[0]), cy: down(here[1]), r: 4.5, fill: ORANGE}),
      element("text", {x: 2, y: 11, "font-weight": 600}, `${variable.label}${variable.unit ? ", " + variable.unit : ""}`),
      element("text", {x: 34, y: down(high) + 4, "text-anchor": "end"}, high.toFixed(0)),
      element("text", {x: 34, y: down(low) + 4, "text-anchor": "end"}, low.toFixed(0) + " ms"),
      element("text", {x: 38, y: 128}, Number(from.toFixed(2)).toString()),
      element("text", {x: 222, y: 128, "text-anchor": "end"}, Number(to.toFixed(2)).toString()));
    return svg;
  }

  return {section, trend};
})();
