// The section view: both rings unrolled at the mean radius, seen from outside, to scale.
"use strict";

const Section = (() => {
  const canvas = document.getElementById("section"), pen = canvas.getContext("2d");
  const spots = document.createElement("canvas"), ink = spots.getContext("2d");  // where rings touch
  const radius = 0.5 * (data.radii[0] + data.radii[1]), around = 2 * Math.PI * radius;
  let width, height, scale, level;

  function fit() {
    const ratio = window.devicePixelRatio || 1;
    width = canvas.clientWidth; height = canvas.clientHeight;
    for (const one of [pen, ink]) {
      one.canvas.width = Math.round(width * ratio); one.canvas.height = Math.round(height * ratio);
      one.setTransform(ratio, 0, 0, ratio, 0, 0);
    }
    scale = Math.min(width / (3.1 * data.pitch), (height - 64) / data.length);
    // The pitch plane of the output ring; with the gap open both rings fill the view.
    level = height - 32 - data.output.root * scale;
  }

  // Corner points of dog k of a ring, px; the sliding ring (flip -1) is turned over.
  const profile = (ring, k) => k % ring.pitches ? ring.low?.profile ?? [] : ring.profile;
  const dog = (ring, k) => profile(ring, k).map(([x, z]) => [
    0.5 * width + (ring.flip * x + k * data.pitch + ring.shift) * scale,
    level - (ring.flip * z + ring.middle) * scale]);

  function draw(points, line, thick, fill, on = pen) {
    on.beginPath();
    for (const point of points) on.lineTo(...point);
    if (fill) { on.closePath(); on.fillStyle = fill; on.fill(); }
    on.strokeStyle = line; on.lineWidth = thick; on.stroke();
  }

  // Draw a ring and return its outline; one dog of each ring is marked, to see how far they turn.
  function drawRing(ring) {
    const half = 0.5 * width / scale + data.pitch, from = Math.ceil((-half - ring.shift) / data.pitch);
    const beyond = ring.pitches - 1;  // with the next dogs beyond either end of the view
    const range = Array.from({length: Math.floor(2 * half / data.pitch) + 1 + 2 * beyond}, (_, i) => from - beyond + i);
    const every = range.filter(k => profile(ring, k).length);
    const points = every.flatMap(k => ring.flip > 0 ? dog(ring, k) : dog(ring, k).reverse());
    const edge = ring.flip > 0 ? height + 4 : -4;
    draw([...points, [points.at(-1)[0], edge], [points[0][0], edge]], ring.line, 2, ring.fill);
    for (const k of every) if (k % data.count === 0) draw(dog(ring, k), ring.line, 2, ring.mark);
    return points;
  }

  function show(now) {
    const turned = -now.relative_angle_deg * Math.PI / 180 * radius, shift = turned - around * Math.round(turned / around);
    const middle = data.travel - now.displacement_mm;
    pen.clearRect(0, 0, width, height);
    const lower = drawRing({profile: data.output.profile, low: data.output.low, pitches: data.output.pitches, flip: 1, middle: 0, shift: 0, fill: "#f3ddcb", mark: "#f5b98a", line: "#c8590c"});
    const upper = drawRing({profile: data.sliding.profile, low: data.sliding.low, pitches: data.sliding.pitches, flip: -1, middle, shift, fill: "#c9d8ea", mark: "#9cc3ee", line: "#1f5fa8"});
    if (now.touching) {  // what lies on both outlines
      ink.globalCompositeOperation = "copy"; draw(lower, "#d1242f", 5, null, ink);
      ink.globalCompositeOperation = "source-in"; draw(upper, "#d1242f", 5, null, ink);
      pen.drawImage(spots, 0, 0, width, height);
    }
    pen.font = "600 13px system-ui, sans-serif"; pen.textAlign = "right"; pen.fillStyle = "#55626f";
    pen.fillText("unrolled at the mean radius, seen from outside", width - 12, 20);
    pen.fillText("2 mm", width - 20 - 2 * scale, height - 8);
    draw([[width - 14 - 2 * scale, height - 12], [width - 14, height - 12]], "#1b2733", 3);
  }

  fit();
  return {show, fit};
})();
