// The section view: both rings unrolled at the mean radius, seen from outside, to scale.
"use strict";

// A number as people read it: with a real minus, and no minus before a zero.
const shown = (value, decimals) =>
  value.toFixed(decimals).replace(/^-(0\.?0*)$/, "$1").replace("-", "\u2212");

const Section = (() => {
  const canvas = document.getElementById("section"), pen = canvas.getContext("2d");
  const BLUE = "#1f5fa8", ORANGE = "#c8590c", RED = "#d1242f", INK = "#1b2733";
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

  const across = x => 0.5 * width + x * scale;
  const up = z => level - z * scale;

  // Corner points of dog k of a ring; the sliding ring (flip -1) is turned over.
  function dog(ring, k) {
    return data.profile.map(([x, z]) =>
      [ring.flip * x + k * data.pitch + ring.shift, ring.flip * z + ring.middle]);
  }

  function visible(ring) {
    const half = 0.5 * width / scale + data.pitch, from = Math.ceil((-half - ring.shift) / data.pitch);
    return Array.from({length: Math.floor(2 * half / data.pitch) + 1}, (_, i) => from + i);
  }

  function drawRing(ring) {
    const edge = ring.flip > 0 ? height + 4 : -4;
    const points = visible(ring).flatMap(k => ring.flip > 0 ? dog(ring, k) : dog(ring, k).reverse());
    pen.beginPath();
    for (const [x, z] of points) pen.lineTo(across(x), up(z));
    pen.lineTo(across(points.at(-1)[0]), edge); pen.lineTo(across(points[0][0]), edge);
    pen.closePath();
    pen.fillStyle = ring.fill; pen.fill();
    pen.strokeStyle = ring.line; pen.lineWidth = 2; pen.stroke();
    // One dog of each ring is marked, to see how far they turn.
    const count = data.solids.count;
    for (const k of visible(ring)) if (((k % count) + count) % count === 0) {
      pen.beginPath();
      for (const [x, z] of dog(ring, k)) pen.lineTo(across(x), up(z));
      pen.fillStyle = ring.mark; pen.fill(); pen.stroke();
    }
  }

  // What the dogs of a stronger colour are.
  function marked() {
    // Between the output ring's speed and the scale, where no dog comes.
    const text = "marked dog of each ring", y = height - 12, end = width - 78 - 2 * scale;
    if (width < 560) return;
    label(text, end, y, "#55626f", "right");
    const start = end - pen.measureText(text).width - 32;
    ["#9cc3ee", "#f5b98a"].forEach((tone, i) => {
      pen.fillStyle = tone; pen.fillRect(start + 12 * i, y - 10, 12, 12);
    });
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
    const ends = [low, high].map(v => along ? [at(a, v), v] : [v, at(a, v)]);
    return {apart, ends};
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

  function arrow(x, y, length, colour) {
    const head = Math.sign(length) * 9;
    pen.strokeStyle = pen.fillStyle = colour; pen.lineWidth = 2.5;
    pen.beginPath(); pen.moveTo(x, y); pen.lineTo(x + length - head, y); pen.stroke();
    pen.beginPath(); pen.moveTo(x + length, y); pen.lineTo(x + length - head, y - 5);
    pen.lineTo(x + length - head, y + 5); pen.fill();
  }

  function label(text, x, y, colour, align = "left") {
    pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = align; pen.fillStyle = colour;
    pen.fillText(text, x, y);
  }

  function scaleBar() {
    const length = 2 * scale, x = width - 14 - length, y = height - 11;
    pen.strokeStyle = INK; pen.lineWidth = 1.5; pen.beginPath();
    pen.moveTo(x, y - 4); pen.lineTo(x, y); pen.lineTo(x + length, y); pen.lineTo(x + length, y - 4);
    pen.stroke(); label("2 mm", x - 6, y + 3, INK, "right");
  }

  function speed(name, value, y, colour, reach) {
    const text = name + "  " + shown(value, 1) + " 1/min";
    label(text, 12, y, colour);
    if (Math.abs(value) < 0.05) return;
    const length = Math.max(12, 60 * Math.abs(value) / reach), start = 22 + pen.measureText(text).width;
    if (value > 0) arrow(start, y - 5, length, colour); else arrow(start + length, y - 5, -length, colour);
  }

  // Draw the state of one time; returns the names of the edges that touch.
  function draw(now) {
    const lower = {flip: 1, middle: 0, fill: "#f3ddcb", mark: "#f5b98a", line: ORANGE,
                   shift: wrap(now.output_place * data.mean_radius)};
    const upper = {flip: -1, middle: data.height + data.gap - now.displacement, fill: "#c9d8ea",
                   mark: "#9cc3ee", line: BLUE, shift: wrap(now.sliding_place * data.mean_radius)};
    pen.clearRect(0, 0, width, height);
    drawRing(lower); drawRing(upper);
    const touching = now.touching ? closest(lower, upper) : [];
    pen.strokeStyle = RED; pen.lineWidth = 5; pen.lineCap = "round";
    for (const {ends} of touching) {
      pen.beginPath();
      for (const [x, z] of ends) pen.lineTo(across(x), up(z));
      pen.stroke();
    }
    pen.lineCap = "butt";
    speed("sliding ring", now.sliding_speed, 20, BLUE, now.fastest);
    speed("output ring", now.output_speed, height - 12, ORANGE, now.fastest);
    label("unrolled at the mean radius, seen from outside", width - 12, 20, "#55626f", "right");
    marked();
    scaleBar();
    return [...new Set(touching.map(t => t.name))];
  }

  const wrap = way => way - around * Math.round(way / around);

  fit();
  return {draw, fit};
})();
