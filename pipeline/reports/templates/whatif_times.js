// Expected shift times from the surrogate's rows: a Gaussian process of their logarithms, summed
// over operating points as the command line does (surrogate/model.py).
"use strict";

const Times = (() => {
  const numbers = (text, Kind) => {
    const bytes = Uint8Array.from(atob(text), c => c.charCodeAt(0));
    return new Kind(bytes.buffer);
  };
  const model = data.model;
  const known = numbers(model.known, Float64Array), place = numbers(model.place, Int32Array);
  const rows = numbers(model.rows, Float64Array), weights = numbers(model.weights, Float64Array);
  const root = numbers(model.root, Float32Array);
  const share = {...model.share};
  share.place = numbers(share.place, Int32Array); share.rows = numbers(share.rows, Float64Array);
  share.engaged = numbers(share.engaged, Float64Array); share.lost = numbers(share.lost, Float64Array);
  const n = weights.length, wide = known.length / model.designs.length, count = model.designs.length;

  const scaled = x => x.map((v, i) => (v - model.low[i]) / (model.high[i] - model.low[i]));
  const inputs = x => [...scaled(x), ...model.ridge.angles.map(i =>
    Math.tanh((Math.tan(x[i] * Math.PI / 180) - model.ridge.friction) / model.ridge.width))];
  const place_of = ([mismatch, force]) => [Math.asinh(mismatch / 5) / 4, Math.log(force / 400)];

  function correlation(rough, square, coordinates) {
    if (!rough) {
      const r = Math.sqrt(5 * square);
      return (1 + r + r * r / 3) * Math.exp(-r);
    }
    const apart = Math.sqrt(square), power = Math.max(7, Math.floor(coordinates / 2) + 3);
    return apart < 1 ? (1 - apart) ** power * (power * apart + 1) : 0;
  }

  // A term's factor of a design and each of the known ones.
  function factorOf(part, z, designs) {
    const size = z.length, found = new Float64Array(designs.length / size).fill(1);
    if (part.design === null) return found;
    for (let k = 0; k < found.length; k++) {
      let square = 0;
      for (let i = 0; i < size; i++) square += ((z[i] - designs[k * size + i]) / part.design[i]) ** 2;
      found[k] = correlation(part.rough, square, size);
    }
    return found;
  }
  const designFactor = (part, z) => factorOf(part, z, known);

  function amplitude(part, o) {
    const size = Math.abs(o[0]) - 1, [steep, bent] = part.growth;
    return Math.sqrt(part.variance) * Math.exp(0.5 * (steep * size + bent * size * size));
  }

  function pointFactor(part, a, b) {
    const grown = amplitude(part, a) * amplitude(part, b);
    if (part.point === null) return grown;
    const square = ((a[0] - b[0]) / part.point[0]) ** 2 + ((a[1] - b[1]) / part.point[1]) ** 2;
    return grown * correlation(part.rough, square, 2);
  }

  // What operating points and rows have to do with each other does not change with the design.
  let linked = {key: "", links: [], prior: []};
  function links(nodes) {
    const key = JSON.stringify(nodes);
    if (linked.key === key) return linked;
    const row = i => [rows[2 * i], rows[2 * i + 1]];
    linked = {key, links: model.parts.map(part => nodes.map(o =>
      Float64Array.from({length: n}, (_, i) => pointFactor(part, o, row(i))))),
      prior: nodes.map(a => nodes.map(b =>
        model.parts.reduce((sum, part) => sum + pointFactor(part, a, b), 0)))};
    return linked;
  }

  // Covariance of a design's logarithm at each node with that of each row, and its prediction.
  function cross(z, nodes, smooth) {
    const by = links(nodes).links, found = nodes.map(() => new Float64Array(n));
    model.parts.forEach((part, p) => {
      if (smooth && part.rough) return;
      const factor = designFactor(part, z);
      if (part.rough && factor.every(value => value === 0)) return;
      nodes.forEach((_, j) => {
        const link = by[p][j], into = found[j];
        for (let i = 0; i < n; i++) into[i] += factor[place[i]] * link[i];
      });
    });
    return found;
  }

  const dot = (a, b) => { let sum = 0; for (let i = 0; i < a.length; i++) sum += a[i] * b[i]; return sum; };
  const means = crossed => crossed.map(row => model.centre + dot(row, weights));

  // Covariance of a design's logarithms given the rows, node by node.
  function joint(crossed, nodes) {
    const size = nodes.length, white = nodes.map(() => new Float64Array(n));
    for (let i = 0, start = 0; i < n; start += ++i) {
      for (let j = 0; j < size; j++) {
        const row = crossed[j];
        let sum = 0;
        for (let m = 0; m <= i; m++) sum += root[start + m] * row[m];
        white[j][i] = sum;
      }
    }
    const prior = links(nodes).prior, found = nodes.map(() => new Array(size));
    for (let j = 0; j < size; j++) for (let k = 0; k <= j; k++)
      found[j][k] = found[k][j] = prior[j][k] - dot(white[j], white[k]);
    return found;
  }

  // Processes over designs alone of the study's own mix and of each of its points, in this order
  // (surrogate/mix_times.py).
  const own = model.own && {...model.own, known: numbers(model.own.known, Float64Array),
    processes: model.own.processes.map(one => ({...one, weights: numbers(one.weights, Float64Array),
      noise: numbers(one.noise, Float64Array)}))};
  const alike = (a, b) => a.length === b.length && a.every((point, j) =>
    point.every((value, i) => Math.abs(value - b[j][i]) < 1e-6));

  // The process that has a mix, null where none has.
  function ownOf(mix) {
    if (own === null) return null;
    const weighed = mix.weights.every((weight, j) => Math.abs(weight - own.weights[j]) < 1e-9);
    if (alike(mix.points, own.points) && weighed) return own.processes[0];
    if (mix.points.length !== 1) return null;
    const place = own.points.findIndex(point => alike(mix.points, [point]));
    return place < 0 ? null : own.processes[1 + place];
  }

  // Covariance of a design with each of the known ones.
  function ownLinks(process, z) {
    const linked = new Float64Array(process.weights.length);
    for (const part of process.parts) {
      const factor = factorOf(part, z, own.known);
      for (let k = 0; k < linked.length; k++) linked[k] += part.variance * factor[k];
    }
    return linked;
  }

  // Lower root of the known designs' covariance, row after row; worked out when it is first asked.
  function ownRoot(process) {
    if (process.root) return process.root;
    const size = process.weights.length, width = own.known.length / size;
    const root = new Float64Array(size * (size + 1) / 2);
    for (let i = 0, at = 0; i < size; at += ++i) {
      const row = ownLinks(process, own.known.subarray(i * width, (i + 1) * width));
      row[i] += process.noise[i];
      for (let j = 0, to = 0; j <= i; to += ++j) {
        let sum = row[j];
        for (let k = 0; k < j; k++) sum -= root[at + k] * root[to + k];
        root[at + j] = i === j ? Math.sqrt(sum) : sum / root[to + j];
      }
    }
    return process.root = root;
  }

  function ownInputs(x) {
    const tangent = angle => Math.tan(angle * Math.PI / 180);
    const z = [...scaled(x), ...own.angles.map(i =>
      Math.tanh((tangent(x[i]) - model.ridge.friction) / model.ridge.width))];
    if (own.shape === null) return z;
    const [chamfer, traction, braking, height, dogs, outer, inner] =
      own.shape.map(({place, value}) => place === null ? value : x[place]);
    const play = height * (tangent(traction) + tangent(braking));
    const tip = Math.PI * 0.25 * (outer + inner) / dogs - 0.5 * play;
    const fall = tip * tangent(chamfer) / (1 - tangent(chamfer) * tangent(braking));
    return [...z, ...[play, tip, fall].map((value, i) => (value - own.low[i]) / own.span[i])];
  }

  // Logarithm of the expected time of a design, and its variance.
  function ownTime(process, x) {
    const linked = ownLinks(process, ownInputs(x)), root = ownRoot(process);
    const white = new Float64Array(linked.length);
    let variance = process.parts.reduce((sum, part) => sum + part.variance, 0);
    for (let i = 0, at = 0; i < white.length; at += ++i) {
      let sum = linked[i];
      for (let k = 0; k < i; k++) sum -= root[at + k] * white[k];
      white[i] = sum / root[at + i];
      variance -= white[i] ** 2;
    }
    return {mean: process.centre + dot(linked, process.weights), variance: Math.max(variance, 0)};
  }

  const near = square => share.length === null ? 1 : Math.exp(-0.5 * square / share.length ** 2);

  // Share of shifts that engage at each node, and its variance.
  function engaged(z, nodes) {
    const design = new Float64Array(count);
    for (let k = 0; k < count; k++) {
      let square = 0;
      for (let i = 0; i < wide; i++) square += (z[i] - known[k * wide + i]) ** 2;
      design[k] = near(square);
    }
    return nodes.map(o => {
      let yes = share.strength * share.overall, no = share.strength * (1 - share.overall);
      for (let i = 0; i < share.place.length; i++) {
        const there = design[share.place[i]]
          * near((o[0] - share.rows[2 * i]) ** 2 + (o[1] - share.rows[2 * i + 1]) ** 2);
        yes += there * share.engaged[i]; no += there * share.lost[i];
      }
      const all = yes + no;
      return {share: yes / all, variance: yes * no / (all * all * (all + 1))};
    });
  }

  function interval(time, error) {
    const relative = Math.sqrt(Math.log1p((error / time) ** 2));
    const centre = Math.log(time) - 0.5 * relative * relative;
    return [Math.exp(centre - 1.96 * relative), Math.exp(centre + 1.96 * relative)];
  }

  // Expected time of shifts that engage with its variance, and half the variances of logarithms.
  function ownEngages(process, x) {
    const {mean, variance} = ownTime(process, x), time = Math.exp(mean + 0.5 * variance);
    return {time, variance: time * time * Math.expm1(variance), grown: [0.5 * variance]};
  }

  function engagesBy(crossed, nodes, mix) {
    const covariance = joint(crossed, nodes), grown = covariance.map((row, j) => 0.5 * row[j]);
    const weighted = means(crossed).map((value, j) => mix.weights[j] * Math.exp(value + grown[j]));
    let time = 0, variance = 0;
    for (let j = 0; j < nodes.length; j++) {
      time += weighted[j];
      for (let k = 0; k < nodes.length; k++)
        variance += weighted[j] * weighted[k] * Math.expm1(covariance[j][k]);
    }
    return {time, variance, grown};
  }

  // Expected shift time of a design (edge units) over operating points with weights.
  function expected(x, mix) {
    const z = inputs(x), nodes = mix.points.map(place_of), parts = engaged(z, nodes);
    const process = ownOf(mix);
    const {time: engages, variance: unknown, grown} = process ? ownEngages(process, x)
      : engagesBy(cross(z, nodes, false), nodes, mix);
    const lost = parts.map((one, j) =>
      mix.weights[j] * Math.sqrt(one.variance) / one.share ** 2 * model.retry);
    let retries = 0, unsure = 0;
    for (let j = 0; j < nodes.length; j++) {
      retries += mix.weights[j] * (1 - parts[j].share) / parts[j].share * model.retry;
      for (let k = 0; k < nodes.length; k++) {
        unsure += lost[j] * lost[k]
          * near((nodes[j][0] - nodes[k][0]) ** 2 + (nodes[j][1] - nodes[k][1]) ** 2);
      }
    }
    const error = Math.sqrt(Math.max(unknown, 0) + unsure), time = engages + retries;
    const [low, high] = interval(time, error);
    return {time, low, high, error, grown, retries,
            bareError: Math.sqrt(Math.max(unknown, 0)), retriesError: Math.sqrt(unsure),
            engaged: Math.min(...parts.map(one => one.share))};
  }

  // The smooth trend, without what a simulated design says of itself alone; the variance of the
  // logarithms at each node (half of it, "grown") is taken as that of the present design.
  function trend(x, mix, grown) {
    const z = inputs(x), nodes = mix.points.map(place_of), parts = engaged(z, nodes);
    const retries = parts.reduce((sum, {share}, j) =>
      sum + mix.weights[j] * (1 - share) / share * model.retry, 0);
    const process = ownOf(mix);
    if (process) return retries + Math.exp(grown[0] + process.centre
      + dot(ownLinks(process, ownInputs(x)), process.weights));
    return means(cross(z, nodes, true)).reduce((sum, mean, j) =>
      sum + mix.weights[j] * Math.exp(mean + grown[j]), retries);
  }

  // The nearest simulated design, and how far it is in the usual distance of one to the next.
  function nearest(x) {
    const z = scaled(x);
    let best = -1, least = Infinity;
    model.designs.forEach((design, k) => {
      const square = scaled(design).reduce((sum, value, i) => sum + (value - z[i]) ** 2, 0);
      if (square < least) { least = square; best = k; }
    });
    return {design: model.designs[best], distance: Math.sqrt(least) / model.spacing};
  }

  const within = (value, low, high) =>
    value >= low - 0.01 * (high - low) && value <= high + 0.01 * (high - low);

  // What speaks against trusting a prediction, as sentences.
  function warnings(x, mix) {
    const found = [], short = value => Number(value.toPrecision(4)).toString();
    const [low, high] = model.simulated;
    x.forEach((value, i) => {
      if (!within(value, low[i], high[i])) found.push(`${data.variables[i].label} is outside the `
        + `simulated designs (${short(low[i])} to ${short(high[i])} ${data.variables[i].unit})`.trimEnd());
    });
    [["mismatch", "1/min"], ["shift force", "N"]].forEach(([name, unit], i) => {
      const asked = mix.points.map(point => point[i]), [from, to] = model.points.map(one => one[i]);
      for (const end of new Set([Math.min(...asked), Math.max(...asked)]))
        if (!within(end, from, to)) found.push(`${name} ${short(end)} ${unit} is outside what was `
          + `simulated (${short(from)} to ${short(to)})`);
    });
    if (!found.length && refusal(x)) found.push(refusal(x));
    const {distance} = nearest(x);
    if (!found.length && distance > model.far) found.push("the next simulated design is "
      + `${distance.toFixed(1)} times as far as designs usually are from each other`);
    return found;
  }

  // Why a design has no time, empty where it has one (surrogate/query.py).
  function refusal(x, found) {
    const {place, friction, reason, engaged} = model.holds;
    if (place !== null && x[place] < model.simulated[0][place]
        && Math.tan(x[place] * Math.PI / 180) <= friction) return reason;
    return found && found.engaged < engaged
      ? `about ${(100 * found.engaged).toFixed(0)} % of the shifts engage where fewest do` : "";
  }

  return {expected, trend, nearest, warnings, refusal};
})();
