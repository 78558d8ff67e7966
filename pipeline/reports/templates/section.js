// The section view: both rings unrolled at the mean radius, seen from outside, to scale.
"use strict";

const Section = (() => {
  const canvas = document.getElementById("section"), pen = canvas.getContext("2d");
  const radius = 0.5 * (data.radii[0] + data.radii[1]), around = 2 * Math.PI * radius;
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

  const pixel = ([x, z]) => [0.5 * width + x * scale, level - z * scale];

  // Corner points of dog k of a ring; the sliding ring (flip -1) is turned over.
  const dog = (ring, k) => data.profile.map(([x, z]) =>
    [ring.flip * x + k * data.pitch + ring.shift, ring.flip * z + ring.middle]);

  function visible(ring) {
    const half = 0.5 * width / scale + data.pitch, from = Math.ceil((-half - ring.shift) / data.pitch);
    return Array.from({length: Math.floor(2 * half / data.pitch) + 1}, (_, i) => from + i);
  }

  function draw(points, line, thick, fill) {
    pen.beginPath();
    for (const point of points) pen.lineTo(...point);
    if (fill) { pen.closePath(); pen.fillStyle = fill; pen.fill(); }
    pen.strokeStyle = line; pen.lineWidth = thick; pen.stroke();
  }

  function drawRing(ring) {
    const edge = ring.flip > 0 ? height + 4 : -4, every = visible(ring);
    const points = every.flatMap(k => ring.flip > 0 ? dog(ring, k) : dog(ring, k).reverse()).map(pixel);
    draw([...points, [points.at(-1)[0], edge], [points[0][0], edge]], ring.line, 2, ring.fill);
    // One dog of each ring is marked, to see how far they turn.
    for (const k of every) if (k % data.count === 0) draw(dog(ring, k).map(pixel), ring.line, 2, ring.mark);
  }

  function show(now) {
    const turned = -now.relative_angle_deg * Math.PI / 180 * radius;
    const touch = now.touching ? "#d1242f" : null, middle = data.height + data.gap - now.displacement_mm;
    const lower = {flip: 1, middle: 0, shift: 0, fill: "#f3ddcb", mark: "#f5b98a", line: touch ?? "#c8590c"};
    const upper = {flip: -1, middle, fill: "#c9d8ea", mark: "#9cc3ee", line: touch ?? "#1f5fa8",
                   shift: turned - around * Math.round(turned / around)};
    pen.clearRect(0, 0, width, height);
    drawRing(lower); drawRing(upper);
    pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = "right"; pen.fillStyle = "#55626f";
    pen.fillText("unrolled at the mean radius, seen from outside", width - 12, 20);
    pen.fillText("2 mm", width - 20 - 2 * scale, height - 8);
    draw([[width - 14 - 2 * scale, height - 12], [width - 14, height - 12]], "#1b2733", 3);
  }

  fit();
  return {show, fit};
})();
