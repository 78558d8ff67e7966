// One time for the whole page: slider, cursor, numbers and both views follow it.
(() => {
  const [scrub, play, slow, cursor, curves, text, whole] =
    ["scrub", "play", "slow", "cursor", "curves", "now", "whole"].map(id => document.getElementById(id));
  const series = data.series, times = series.t_s, end = times.at(-1);
  const NUMBERS = {displacement_mm: ["mm", 3], sliding_speed_rpm: ["1/min", 1], output_speed_rpm: ["1/min", 1],
                   mismatch_rpm: ["1/min", 1], force_N: ["N", 0], contact_force_N: ["N", 0]};
  let now = 0, before = 0, running = false, stamp = null;

  // Index of the first sample at or after a time.
  const after = time => Math.max(0, times.findIndex(t => t >= time));

  function state(time) {
    const i = after(time), h = Math.max(0, i - 1), gap = times[i] - times[h];
    const share = gap > 0 ? (time - times[h]) / gap : 1;
    const out = Object.fromEntries(Object.entries(series).map(([name, s]) => [name, s[h] + share * (s[i] - s[h])]));
    out.contact_force_N = series.contact_force_N[i];
    // Touches since the last picture count too: a bounce is shorter than a picture.
    out.touching = series.touching.slice(running ? Math.min(i, after(before)) : i, i + 1).some(touch => touch > 0);
    return out;
  }

  function draw() {
    const values = state(now), axis = curves._fullLayout?.xaxis;
    const phase = data.phases.find(p => now <= p.end) ?? data.phases.at(-1);
    Section.show(values); Solid.show(values);
    if (axis) {
      cursor.style.left = (axis._offset + axis.l2p(1e3 * now)).toFixed(1) + "px";
      cursor.hidden = 1e3 * now < axis.range[0] || 1e3 * now > axis.range[1];
    }
    const numbers = Object.entries(NUMBERS).map(([name, [unit, decimals]]) =>
      name.split("_").slice(0, -1).join(" ") + " " + values[name].toFixed(decimals)
        .replace(/^-(0\.?0*)$/, "$1").replace("-", "\u2212") + "\u00a0" + unit);
    text.textContent = [(1e3 * now).toFixed(2) + " ms", phase.name, ...numbers].join(", ");
    scrub.value = before = now;
  }

  function go(time) { now = Math.min(end, Math.max(0, time)); draw(); }

  function run(on) {
    running = on; stamp = null; play.textContent = on ? "Pause" : "Play";
    if (on) requestAnimationFrame(step);
  }

  function step(at) {
    if (!running) return;
    go((now < end ? now : 0) + (at - (stamp ?? at)) / (1e3 * slow.value));
    stamp = at;
    if (now >= end) run(false); else requestAnimationFrame(step);
  }

  const show = (from, to) => Plotly.relayout(curves, {"xaxis.range": [1e3 * from, 1e3 * to]});

  // A speed that shows the shift in some eight seconds.
  slow.value = [...slow.options].map(o => o.value).reduce((a, b) => b * end <= 10 ? b : a);
  scrub.max = end;
  document.querySelectorAll(".phase").forEach((button, i) => button.onclick = () => {
    const {start, end} = data.phases[i];
    if (now < start || now > end) go(start);
    show(start, end);
  });
  whole.onclick = () => show(0, end);
  scrub.oninput = () => { run(false); go(+scrub.value); };
  play.onclick = () => run(!running);
  curves.on?.("plotly_relayout", draw);
  curves.on?.("plotly_click", event => { run(false); go(event.points[0].x / 1e3); });
  addEventListener("resize", () => { Section.fit(); draw(); });
  for (const [event, width] of [["beforeprint", 700], ["afterprint", null]])
    addEventListener(event, () => { Plotly.relayout(curves, {width, autosize: !width}); draw(); });
  // "shift.html#t=40" opens at 40 ms.
  go(+(/[#&]t=([\d.]+)/.exec(location.hash)?.[1] ?? 0) / 1e3);
})();
