// The section view: both rings unrolled at the mean radius, seen from outside, to scale.
"use strict";

// A number as people read it: with a real minus, and no minus before a zero.
const shown = (value, decimals) =>
  value.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1").replace("-", "\u2212");

const Section = (() => {
  const canvas = document.getElementById("section"), pen = canvas.getContext("2d");
  // Edges of the profile by their first point: what can touch what.
  const EDGES = {braking: 0, face: 1, traction: 2};
  const around = 2 * Math.PI * data.mean_radius;
  let width, height, scale, level;

  function fit() {
    const ratio = window.devicePixelRatio || 1;
    width = canvas.clientWidth; height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio); canvas.height = Math.round(height * ratio);
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    scale = Math.min(width / (3.1 * data.pitch), (height - 64) / (2 * data.height + data.gap));
    // The median plane of the output ring; with the gap open both rings fill the view.
    level = height - 32 - 0.5 * data.height * scale;
  }

  const across = x => 0.5 * width + x * scale, up = z => level - z * scale;

  // Corner points of dog k of a ring; the sliding ring (flip -1) is turned over.
  const dog = (ring, k) => data.profile.map(([x, z]) =>
    [ring.flip * x + k * data.pitch + ring.shift, ring.flip * z + ring.middle]);

  function visible(ring) {
    const half = 0.5 * width / scale + data.pitch, from = Math.ceil((-half - ring.shift) / data.pitch);
    return Array.from({length: Math.floor(2 * half / data.pitch) + 1}, (_, i) => from + i);
  }

  function drawRing(ring) {
    const edge = ring.flip > 0 ? height + 4 : -4;
    const points = visible(ring).flatMap(k => ring.flip > 0 ? dog(ring, k) : dog(ring, k).reverse());
    const outline = (corners, fill) => {
      pen.beginPath();
      for (const [x, z] of corners) pen.lineTo(across(x), up(z));
      if (corners === points)
        for (const [x] of [points.at(-1), points[0]]) pen.lineTo(across(x), edge);
      pen.closePath();
      pen.fillStyle = fill; pen.fill();
      pen.strokeStyle = ring.line; pen.lineWidth = 2; pen.stroke();
    };
    outline(points, ring.fill);
    // One dog of each ring is marked, to see how far they turn.
    for (const k of visible(ring)) if (k % data.solids.count === 0) outline(dog(ring, k), ring.mark);
  }

  // How close two parallel edges are, and the piece they share: along is 0 for faces, 1 for flanks.
  function pair(a, b, along) {
    const low = Math.max(Math.min(a[0][along], a[1][along]), Math.min(b[0][along], b[1][along]));
    const high = Math.min(Math.max(a[0][along], a[1][along]), Math.max(b[0][along], b[1][along]));
    const at = (edge, value) => {
      const share = (value - edge[0][along]) / (edge[1][along] - edge[0][along]);
      return edge[0][1 - along] + share * (edge[1][1 - along] - edge[0][1 - along]);
    };
    const middle = 0.5 * (low + high);
    const apart = Math.abs(at(a, middle) - at(b, middle)) + Math.max(0, low - high);
    return {apart, ends: [low, high].map(v => along ? [at(a, v), v] : [v, at(a, v)])};
  }

  // The edges that are closest: where the rings touch when they touch.
  function closest(lower, upper) {
    const found = [];
    for (const k of visible(lower)) for (const j of visible(upper)) {
      if (Math.abs((k - j) * data.pitch + lower.shift - upper.shift) > data.pitch) continue;
      const a = dog(lower, k), b = dog(upper, j);
      for (const [name, i] of Object.entries(EDGES))
        found.push({name, ...pair([a[i], a[i + 1]], [b[i], b[i + 1]], name === "face" ? 0 : 1)});
    }
    const best = Math.min(...found.map(f => f.apart));
    return found.filter(f => f.apart < best + 0.01);
  }

  function label(text, x, y, align) {
    pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = align; pen.fillStyle = "#55626f";
    pen.fillText(text, x, y);
  }

  // Draw the state of one time; returns the names of the edges that touch.
  function draw(now) {
    const turned = -now.relative_angle * data.mean_radius;
    const lower = {flip: 1, middle: 0, shift: 0, fill: "#f3ddcb", mark: "#f5b98a", line: "#c8590c"};
    const upper = {flip: -1, middle: data.height + data.gap - now.displacement, fill: "#c9d8ea",
                   mark: "#9cc3ee", line: "#1f5fa8", shift: turned - around * Math.round(turned / around)};
    pen.clearRect(0, 0, width, height);
    drawRing(lower); drawRing(upper);
    const touching = now.touching ? closest(lower, upper) : [];
    pen.strokeStyle = "#d1242f"; pen.lineWidth = 5;
    for (const {ends} of touching) {
      pen.beginPath();
      for (const [x, z] of ends) pen.lineTo(across(x), up(z));
      pen.stroke();
    }
    label("unrolled at the mean radius, seen from outside", width - 12, 20, "right");
    label("2 mm", width - 20 - 2 * scale, height - 8, "right");
    pen.fillStyle = "#1b2733"; pen.fillRect(width - 14 - 2 * scale, height - 13, 2 * scale, 3);
    return [...new Set(touching.map(t => t.name))];
  }

  fit();
  return {draw, fit};
})();
