// One time for the whole page: scrubber, cursor, phases, curves and both views follow it.
"use strict";

const Clock = (() => {
  const find = id => document.getElementById(id);
  const [scrub, play, slow, frame, cursor, reach, bar] =
    ["scrub", "play", "slow", "frame", "cursor", "reach", "bar"].map(find);
  const series = data.series, times = series.time, end = times.at(-1);
  const fastest = Math.max(...[...series.sliding_speed, ...series.output_speed].map(Math.abs));
  const UNITS = {displacement: ["mm", 3], sliding_speed: ["1/min", 1], output_speed: ["1/min", 1],
                 mismatch: ["1/min", 1], shift_force: ["N", 0], contact_force: ["N", 0]};
  let now = 0, before = 0, range = [0, end], running = false, stamp = null, whole = false;
  const ceiling = () => data.force_ranges[whole ? 1 : 0];

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
    out.mismatch = out.output_speed - out.sliding_speed;
    out.fastest = fastest;
    // Touches since the last picture count too: a bounce is shorter than a picture.
    const from = running ? Math.min(i, after(before)) : i;
    out.touching = series.touching.slice(from, i + 1).some(touch => touch > 0);
    const still = frame.value === "output" ? out.output_angle : 0;
    out.output_place = out.output_angle - still;
    out.sliding_place = out.sliding_angle - still;
    return out;
  }

  const digits = () => Math.max(1, Math.min(6, Math.ceil(2.5 - Math.log10(range[1] - range[0]))));
  const place = time => 100 * Math.min(1, Math.max(0, (time - range[0]) / (range[1] - range[0])));
  const phaseAt = time => data.phases.find(p => time <= p.end && p.end > p.start) || data.phases.at(-1);

  function draw() {
    const values = state(now);
    Solid.draw(values, Section.draw(values));
    cursor.style.left = place(now).toFixed(3) + "%";
    // The label stays inside: its left end under the cursor at the start, its right end at the end.
    find("now").style.transform = "translateX(-" + place(now).toFixed(1) + "%)";
    find("now").textContent = now.toFixed(digits()) + " ms, " + phaseAt(now).name;
    scrub.value = now;
    for (const cell of document.querySelectorAll("[data-now]")) {
      const [unit, decimals] = UNITS[cell.dataset.now];
      cell.textContent = shown(values[cell.dataset.now], decimals) + " " + unit;
    }
    before = now;
  }

  function go(time) {
    now = Math.min(range[1], Math.max(range[0], time));
    draw();
  }

  function run(on) {
    running = on; play.textContent = on ? "Pause" : "Play";
    if (!on) return;
    if (now >= range[1]) go(range[0]);
    stamp = null; requestAnimationFrame(step);
  }

  function step(at) {
    if (!running) return;
    const next = now + (at - (stamp ?? at)) / slow.value;
    stamp = at; go(next);
    if (next >= range[1]) run(false); else requestAnimationFrame(step);
  }

  // Ends of the upright axes: of a part of the shift those of what is shown, or lines would be flat.
  function heights() {
    if (range[0] <= 0 && range[1] >= end)
      return {"yaxis.autorange": true, "yaxis2.autorange": true, "yaxis3.range": [0, ceiling()]};
    const first = after(range[0]), last = after(range[1]) + 1;
    const part = name => series[name].slice(first, last);
    const [sliding, output] = [part("sliding_speed"), part("output_speed")];
    const ends = values => {
      const low = Math.min(...values), high = Math.max(...values), room = 0.08 * (high - low) || 0.5;
      return [low - room, high + room];
    };
    const force = Math.max(...part("shift_force"), Math.min(ceiling(), Math.max(...part("contact_force"))));
    return {"yaxis.range": ends(part("displacement")), "yaxis3.range": [0, 1.08 * force],
            "yaxis2.range": ends([...sliding, ...output, ...output.map((speed, i) => speed - sliding[i])])};
  }

  // Show a span of time on the whole width, and choose a speed that shows it in some seconds.
  function show(from, to) {
    range = [from, to];
    scrub.min = from; scrub.max = to;
    const wanted = Math.log(8000 / (to - from));
    const far = option => Math.abs(Math.log(option.value) - wanted);
    slow.value = [...slow.options].reduce((a, b) => far(b) < far(a) ? b : a).value;
    for (const span of bar.children) {
      const {start, end: stop} = data.phases[span.dataset.phase];
      span.style.left = place(start) + "%"; span.style.width = place(stop) - place(start) + "%";
      span.style.color = "";
      if (span.scrollWidth > span.clientWidth) span.style.color = "transparent";
    }
    const axes = Object.keys(find("curves").layout).filter(name => name.startsWith("xaxis"));
    Plotly.relayout("curves", {...Object.fromEntries(axes.map(name => [name + ".range", [...range]])), ...heights()});
    go(now);
  }

  const length = phase => {
    const ms = phase.end - phase.start;
    return ms > 0 && ms < 0.95 ? ms.toPrecision(2) : ms.toFixed(1);
  };

  function choice(text, tone, from, to) {
    const button = document.createElement("button");
    button.type = "button";
    if (tone) button.append(Object.assign(document.createElement("i"), {style: "background:" + tone}));
    button.append(text);
    button.title = "show this span on the whole width";
    button.disabled = !(to > from);
    button.onclick = () => {
      for (const other of find("phases").children) other.ariaPressed = String(other === button);
      if (now < from || now > to) now = from;
      show(from, to);
    };
    find("phases").append(button);
    return button;
  }

  function phases() {
    choice("whole shift", null, 0, end).ariaPressed = "true";
    data.phases.forEach((phase, i) => {
      choice(phase.name + " " + length(phase) + " ms", phase.tone, phase.start, phase.end);
      const span = document.createElement("span");
      span.dataset.phase = i; span.style.background = phase.tone;
      span.textContent = phase.name + " " + length(phase) + " ms";
      bar.append(span);
    });
  }

  function forceAxis() {
    const [low, high] = data.force_ranges, button = find("ceiling");
    if (high <= low) return;
    const name = () => { button.textContent = "axis to " + (whole ? low : high).toFixed(0) + " N"; };
    button.hidden = false; name();
    button.onclick = () => {
      whole = !whole; name();
      Plotly.relayout("curves", heights());
    };
  }

  function pointer() {
    const pick = event => {
      const box = find("rail").getBoundingClientRect();
      run(false); go(range[0] + (event.clientX - box.left) / box.width * (range[1] - range[0]));
    };
    for (const area of [reach, bar]) {
      area.onpointerdown = pick;
      area.onpointermove = event => { if (event.buttons & 1) pick(event); };
    }
  }

  phases(); forceAxis(); pointer();
  scrub.oninput = () => { run(false); go(+scrub.value); };
  play.onclick = () => run(!running);
  frame.onchange = draw;
  addEventListener("keydown", event => {
    if (event.code !== "Space" || event.target.closest("button, select, input")) return;
    event.preventDefault(); run(!running);
  });
  addEventListener("resize", () => { Section.fit(); draw(); });
  show(0, end);
  // "shift.html#t=40" opens at 40 ms.
  const wanted = /[#&]t=([\d.]+)/.exec(location.hash);
  if (wanted) go(+wanted[1]);
  return {go, run};
})();
