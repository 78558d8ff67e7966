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

// The page: fields and sliders, and what follows from them.
const $ = id => document.getElementById(id);
const minus = text => text.replace(/-(?=[\d.])/g, "\u2212");
const ms = seconds => minus((1e3 * seconds).toFixed(1)) + " ms";
const percent = part => minus((100 * part).toFixed(Math.abs(part) < 0.1 ? 1 : 0)) + " %";
const figure = value => minus(Number(value.toPrecision(4)).toString());
const state = {};

// A number with its field and slider. A slider of a wide range runs over the logarithm.
function field(parent, one) {
  const row = document.createElement("div"), name = document.createElement("label");
  const number = document.createElement("input"), slider = document.createElement("input"), unit = document.createElement("span");
  row.className = "number"; name.textContent = one.label; name.htmlFor = "at-" + one.key; unit.textContent = one.unit;
  Object.assign(number, {type: "number", id: "at-" + one.key, min: one.low, max: one.high, step: one.step});
  const to = one.log ? Math.log : x => x, from = one.log ? Math.exp : x => x;
  Object.assign(slider, {type: "range", min: to(one.low), max: to(one.high), step: one.log ? 0.01 : one.step});
  slider.setAttribute("aria-label", one.label);
  // Any value of the range is allowed in the field; its step is that of the arrows alone.
  number.step = one.whole ? 1 : "any";
  const set = value => { state[one.key] = value; number.value = Number(value.toFixed(4)); slider.value = to(value); };
  number.addEventListener("input", () => {
    if (number.value === "" || !number.checkValidity()) return;
    state[one.key] = +number.value; slider.value = to(state[one.key]); follow();
  });
  slider.addEventListener("input", () => {
    const value = from(+slider.value);
    set(one.log ? Number(value.toPrecision(3)) : Number(value.toFixed(4))); follow();
  });
  row.append(name, number, unit, slider); parent.append(row);
  set(one.value);
  return {row, set};
}

const shape = data.variables.map(one => field($("shape"), one));
const operating = data.operating.map(one => field($("operating"), one));
data.friction.forEach(one => field($("friction"), one));
data.designs.forEach((one, k) => $("start").append(new Option(one.name, k)));

const design = () => data.variables.map(one => state[one.key]);
const named = x => Object.fromEntries(data.variables.map((one, i) => [one.key, x[i]]));
const mix = () => $("all").checked ? data.model.mix
  : {points: [[state.mismatch_rpm, state.force_N]], weights: [1]};
const start = () => data.designs[+$("start").value];

// Python's side: the checks of the package, run by Brython; until it is there, none.
let checks = null;
function asked(x, more) { return JSON.parse(checks(JSON.stringify({design: named(x), ...more}))); }

let due = 0, later = 0;
function follow() {
  cancelAnimationFrame(due); due = requestAnimationFrame(now);
  clearTimeout(later); later = setTimeout(rest, 250);
}

let present = null;
function now() {
  const x = design(), here = mix();
  present = Times.expected(x, here);
  const rival = Times.expected(start().values, here), {distance, design: near} = Times.nearest(x);
  const none = Times.refusal(x, present), rivalNone = Times.refusal(start().values, rival);
  $("time").textContent = none ? "none" : ms(present.time);
  $("interval").textContent = none || `95 %: ${ms(present.low)} to ${ms(present.high)}`
    + `; without retries \u00b1${ms(1.96 * present.bareError)}, retries \u00b1${ms(1.96 * present.retriesError)}`;
  const apart = present.time - rival.time;
  $("rival").textContent = start().name;
  $("gain").textContent = none || rivalNone ? "-"
    : Math.abs(apart) < 5e-5 ? "the same" : (apart > 0 ? "+" : "") + ms(apart);
  const told = start().simulated_s;
  $("rivals").textContent = (rivalNone || `${ms(rival.time)} predicted`) + (told && $("all").checked
    ? `, ${ms(told)} \u00b1 ${ms(start().error_s)} simulated` : "");
  $("distance").textContent = distance < 0.005 ? "this one" : distance.toFixed(1) + " \u00d7";
  $("nearest").textContent = (distance < 0.005 ? "" : "the usual spacing: ")
    + data.variables.map((one, i) => `${figure(near[i])}${one.unit ? " " + one.unit : ""}`).join(", ");
  $("cautions").replaceChildren(...Times.warnings(x, here).map(text => {
    const line = document.createElement("p"); line.textContent = "Caution: " + minus(text) + "."; return line;
  }));
  for (const {row} of operating) row.classList.toggle("idle", $("all").checked);
  if (checks) judge(x, {});
  commands(x);
  const keys = data.variables.concat($("all").checked ? [] : data.operating, data.friction);
  history.replaceState(null, "", "#" + keys.map(one => `${one.key}=${state[one.key]}`).join("&"));
  document.body.dataset.time = JSON.stringify([present.time, present.low, present.high]);
}

// What may wait until the hand rests: margins within tolerances, and the curves.
function rest() {
  if (checks) judge(design(), {tolerances: true});
  curves();
}

function judge(x, more) {
  const friction = Object.fromEntries(data.friction.map(one => [one.key, state[one.key]]));
  const found = asked(x, {...friction, ...more});
  document.body.dataset.checks = JSON.stringify(found);
  $("refused").textContent = found.refusal ? "There is no such dog: " + found.refusal : "";
  const unmade = found.refusal ? ["no such dog"]
    : found.checks.filter(one => data.makeable.includes(one.name) && !one.passed).map(one => words(one.name));
  if (unmade.length) {
    $("time").textContent = "none"; $("gain").textContent = "-";
    $("interval").textContent = found.refusal ? "no such dog" : "cannot be made: fails " + unmade.join(", ");
  }
  $("weakest").className = "card " + (found.refusal ? "bad" : "");
  if (found.refusal) {
    $("margin").textContent = "-"; $("which").textContent = "no such dog"; $("checks").replaceChildren();
    $("landing").textContent = "";
    return;
  }
  const simulated = landing(x, found.checks);
  found.checks.push(...(simulated ?? []));
  const weakest = found.checks.reduce((a, b) => b.margin < a.margin ? b : a);
  $("margin").textContent = percent(weakest.margin);
  const failed = found.checks.filter(one => !one.passed).length;
  $("which").textContent = words(weakest.name) + (failed ? `; ${failed} of ${found.checks.length} fail` : `; all ${found.checks.length} pass`);
  if (found.lost) {
    const left = Math.min(...found.checks.map(one => one.margin - (found.lost[one.name] ?? 0)));
    $("which").textContent += Number.isFinite(left) ? `; ${percent(left)} with tolerances at their worst` : "; with tolerances no dog";
  }
  $("weakest").className = "card " + (failed ? "bad" : simulated ? "good" : "open");
  $("landing").className = simulated ? "" : "open";
  $("landing").textContent = simulated ? "landing judged" : "landing not judged";
  table(found);
  const [mu, name] = found.locks_above;
  $("more").textContent = `It locks above a static friction of ${mu.toFixed(3)} (${words(name)}). The blocking mechanism holds `
    + `${found.blocking_force_N.toFixed(0)} N. Room along the shaft: ${found.axial_length_mm.toFixed(2)} mm. Point at a check for its formula, source and key.`;
  const own = {section: found.section, pitch: found.pitch_mm, height: height(found.section)};
  const other = asked(start().values, {});
  if (!other.refusal) Figures.section(own, {section: other.section, pitch: other.pitch_mm,
    height: height(other.section), name: start().name}, data.gap);
}

// Checks of a simulation, with those of landing, where the design is one that was simulated.
function landing(x, known) {
  const one = data.designs.find(({values}) => values.every((value, i) => Math.abs(value - x[i]) < 1e-9));
  if (!one?.margins) return null;
  const names = known.map(check => check.name);
  return Object.entries(one.margins).filter(([name]) => !names.includes(name)).map(([name, margin]) => ({
    name, margin, passed: margin >= 0, group: "simulated", value: "", at_most: null, limit: "", unit: "",
    meaning: "margin of the simulated design", formula: "", source: "", key: ""}));
}

const words = name => name.replaceAll("_", " ");
const height = section => Math.max(...section.map(p => p[1])) - Math.min(...section.map(p => p[1]));

function table(found) {
  const rows = [];
  for (const [group, title] of Object.entries(data.groups)) {
    const own = found.checks.filter(one => one.group === group);
    if (!own.length) continue;
    const head = document.createElement("tr"); head.className = "group";
    head.innerHTML = "<td colspan=7></td>"; head.firstChild.textContent = title; rows.push(head);
    for (const one of own) {
      const row = document.createElement("tr");
      if (!one.passed) row.className = "failed";
      row.title = `${one.meaning}\n${one.formula}\n${one.source}\nkey: ${one.key}`;
      const lost = found.lost?.[one.name];
      const worst = !found.lost ? "" : lost === undefined ? percent(one.margin)
        : Number.isFinite(lost) ? percent(one.margin - lost) : "no dog";
      const sign = one.at_most === null ? "" : one.at_most ? "\u2264" : "\u2265";
      const number = value => value === "" ? "" : figure(value);
      const cells = [words(one.name), number(one.value), sign, number(one.limit), one.unit, "", worst];
      cells.forEach((text, i) => {
        const cell = document.createElement("td"); cell.textContent = text;
        if (i === 4) cell.className = "words";
        if (i === 5) {
          const meter = document.createElement("span"), bar = document.createElement("i");
          meter.className = "meter"; bar.style.width = Math.min(100, Math.abs(100 * one.margin)) + "%";
          if (one.margin < 0) bar.className = "low";
          meter.append(bar); cell.className = "margin"; cell.append(meter, percent(one.margin));
        }
        if (i === 6 && found.lost && one.margin - (lost ?? 0) < 0) cell.classList.add("bad");
        row.append(cell);
      });
      rows.push(row);
    }
  }
  $("checks").replaceChildren(...rows);
}

function curves() {
  const x = design(), here = mix(), [low, high] = data.model.simulated;
  $("trends").replaceChildren(...data.variables.map((one, i) => {
    const places = one.whole ? Math.round(high[i] - low[i]) + 1 : 25, curve = [];
    for (let k = 0; k < places; k++) {
      const moved = [...x];
      moved[i] = low[i] + (high[i] - low[i]) * k / (places - 1);
      if (Times.refusal(moved)) continue;
      curve.push([moved[i], 1e3 * Times.trend(moved, here, present.grown)]);
    }
    if (!curve.length) return "";
    return Figures.trend(one, curve, [x[i], 1e3 * present.time]);
  }));
}

function commands(x) {
  const sets = data.variables.map((one, i) => x[i] === one.value ? "" : ` --set dog.${one.key}=${x[i]}`).join("");
  const rubbed = data.friction.map(one => state[one.key] === one.value ? "" : ` --set load.${one.key}=${state[one.key]}`).join("");
  const where = $("all").checked ? "" : ` --mismatch-rpm ${state.mismatch_rpm} --force-N ${state.force_N}`;
  $("check").textContent = `dogshape check ${data.command}${sets}${rubbed}${where}`;
  $("expect").textContent = `dogshape expect ${data.command}${sets}${where}` + ($("all").checked ? " --precision 0.01" : " --angles 64");
}

function take(one) { shape.forEach(({set}, i) => set(one.values[i])); follow(); }
$("start").addEventListener("change", () => take(start()));
$("back").addEventListener("click", () => take(start()));
for (const id of ["all", "one"]) $(id).addEventListener("change", follow);
operating.forEach(({row}) => row.addEventListener("input", () => { $("one").checked = true; }, true));

// A link to a page with its numbers behind "#" opens with them.
for (const [key, value] of new URLSearchParams(location.hash.slice(1))) {
  const of = (list, fields) => { const k = list.findIndex(one => one.key === key); if (k >= 0 && Number.isFinite(+value)) fields[k].set(+value); return k >= 0; };
  of(data.variables, shape);
  if (of(data.operating, operating)) $("one").checked = true;
}
new URLSearchParams(location.hash.slice(1)).forEach((value, key) => {
  if (data.friction.some(one => one.key === key) && Number.isFinite(+value)) {
    state[key] = +value; $("at-" + key).value = value;
  }
});
now(); curves();

// Brython with its library, and the modules of the package; packed, they take a quarter.
async function unpacked(text) {
  const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
}
async function load() {
  // It wants to know where it lies, though all that it needs is in the page.
  window.__BRYTHON__ = {brython_path: new URL(".", location.href.split("#")[0]).href};
  for (const packed of data.python.scripts) {
    const code = document.createElement("script");
    code.textContent = await unpacked(packed); document.head.append(code); code.remove();
  }
  __BRYTHON__.update_VFS(JSON.parse(await unpacked(data.python.modules)));
  window.python_known = JSON.stringify(data.python.known);
  brython({indexedDB: false});
  __BRYTHON__.runPythonSource(data.python.program, "desk");
  checks = window.python_checks;
  now(); rest();
  document.body.dataset.ready = "yes";
}
load().catch(error => { $("which").textContent = "this browser cannot run the checks; take dogshape check"; console.error(error); });
