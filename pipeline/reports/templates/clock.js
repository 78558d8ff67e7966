// One time for the whole page: slider, cursor, numbers and both views follow it.
"use strict";

const Clock = (() => {
  const find = id => document.getElementById(id);
  const [scrub, play, slow, cursor, curves] = ["scrub", "play", "slow", "cursor", "curves"].map(find);
  const series = data.series, times = series.time, end = times.at(-1);
  const NUMBERS = {displacement: ["mm", 3], sliding_speed: ["1/min", 1], output_speed: ["1/min", 1],
                   mismatch: ["1/min", 1], shift_force: ["N", 0], contact_force: ["N", 0]};
  let now = 0, before = 0, running = false, stamp = null;

  // Index of the first sample at or after a time.
  function after(time) {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < time) low = middle + 1; else high = middle;
    }
    return low;
  }

  function state(time) {
    const i = after(time), h = Math.max(0, i - 1), gap = times[i] - times[h];
    const share = gap > 0 ? (time - times[h]) / gap : 1;
    const at = name => series[name][h] + share * (series[name][i] - series[name][h]);
    const out = Object.fromEntries(Object.keys(series).map(name => [name, at(name)]));
    out.contact_force = series.contact_force[i];
    // Touches since the last picture count too: a bounce is shorter than a picture.
    out.touching = series.touching.slice(running ? Math.min(i, after(before)) : i, i + 1).some(touch => touch > 0);
    return out;
  }

  function draw() {
    const values = state(now), axis = curves._fullLayout?.xaxis;
    const phase = data.phases.find(p => now <= p.end) ?? data.phases.at(-1);
    Solid.draw(values, Section.draw(values));
    if (axis) {
      cursor.style.left = (axis._offset + axis.l2p(now)).toFixed(1) + "px";
      cursor.hidden = now < axis.range[0] || now > axis.range[1];
    }
    const numbers = Object.entries(NUMBERS).map(([name, [unit, decimals]]) =>
      name.replace("_", " ") + " " + shown(values[name], decimals) + " " + unit);
    find("now").textContent = [now.toFixed(2) + " ms", phase.name, ...numbers].join(", ");
    scrub.value = before = now;
  }

  function go(time) {
    now = Math.min(end, Math.max(0, time));
    draw();
  }

  function run(on) {
    running = on; play.textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (now >= end) go(0);
    stamp = null; requestAnimationFrame(step);
  }

  function step(at) {
    if (!running) return;
    const next = now + (at - (stamp ?? at)) / slow.value;
    stamp = at; go(next);
    if (next >= end) run(false); else requestAnimationFrame(step);
  }

  // Show a span of time on the whole width; the curves zoom by dragging, too.
  const show = (from, to) => Plotly.relayout(curves, {"xaxis.range": [from, to]});

  // A speed that shows the shift in some seconds.
  const distance = option => Math.abs(Math.log(option.value * end / 8000));
  slow.value = [...slow.options].reduce((a, b) => distance(b) < distance(a) ? b : a).value;
  document.querySelectorAll(".phase").forEach((button, i) => button.onclick = () => {
    const {start, end} = data.phases[i];
    if (now < start || now > end) go(start);
    show(start, end);
  });
  find("whole").onclick = () => show(0, end);
  scrub.oninput = () => { run(false); go(+scrub.value); };
  play.onclick = () => run(!running);
  curves.on?.("plotly_relayout", draw);
  curves.on?.("plotly_click", event => { run(false); go(event.points[0].x); });
  addEventListener("keydown", event => {
    if (event.code !== "Space" || event.target.closest("button, select, input")) return;
    event.preventDefault(); run(!running);
  });
  addEventListener("resize", () => { Section.fit(); draw(); });
  // "shift.html#t=40" opens at 40 ms.
  go(+(/[#&]t=([\d.]+)/.exec(location.hash)?.[1] ?? 0));
  return {go, run};
})();
