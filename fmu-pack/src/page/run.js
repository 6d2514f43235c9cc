"use strict";
// The page around a run: controls, plots, vectors, the address that repeats a run. The FMU itself is in `worker.js`.

const $ = (id) => document.getElementById(id);
const model = JSON.parse($("fmu").textContent);
for (const v of model.variables) v.elements ??= 1;
const byName = new Map(model.variables.map((v) => [v.name, v]));
const NUMBERS = /^(Float|Int|UInt|Enumeration|Boolean)/;
const recorded = model.variables.filter((v) => (v.causality === "output" || v.causality === "input") && v.elements === 1 && NUMBERS.test(v.kind));
const differences = new Map(model.differences.map((d) => [d.name, d]));
const acts = (v) => v.causality === "input" || v.variability === "tunable";
const settable = model.variables.filter((v) => v.causality === "input" || v.causality === "parameter");
const MOST = 40000;

// What the page shows of an SI value, and back.
const scale = (v) => v.display ?? [v.unit ?? "", 1, 0];
const seen = (v, x) => x * scale(v)[1] + scale(v)[2];
const meant = (v, x) => (x - scale(v)[2]) / scale(v)[1];
const short = (x) => (Number.isFinite(x) ? String(Number(x.toPrecision(6))) : "");

const element = (parent, name, attributes = {}, text = "") => {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text) made.textContent = text;
  return parent.appendChild(made);
};

// A value beside the name of its curve.
const reading = (v, x) => (v.type ? textOf(v, x) : shown(seen(v, x)));

function tell(text, kind = "") {
  $("message").textContent = text;
  $("message").className = kind;
}

// ---------------------------------------------------------------- recording

class Recording {
  constructor() {
    this.n = 0;
    this.columns = new Map(["time", ...recorded.map((v) => v.name), ...differences.keys()].map((name) => [name, new Float64Array(1024)]));
  }
  get time() { return this.columns.get("time"); }
  add(rows) {
    const width = 1 + recorded.length, names = [...this.columns.keys()];
    for (let at = 0; at < rows.length; at += width) {
      if (this.n === MOST) this.halve();
      if (this.n === this.time.length) for (const [name, old] of this.columns) this.columns.set(name, grown(old));
      for (let i = 0; i < width; i++) this.columns.get(names[i])[this.n] = rows[at + i];
      for (const d of differences.values()) this.columns.get(d.name)[this.n] = this.difference(d);
      this.n++;
    }
  }
  difference({ of: [a, b], turn }) {
    const x = this.columns.get(a)[this.n] - this.columns.get(b)[this.n];
    return turn ? x - 2 * Math.PI * Math.round(x / (2 * Math.PI)) : x;
  }
  // The oldest half goes.
  halve() {
    for (const column of this.columns.values()) column.copyWithin(0, MOST / 2, MOST);
    this.n = MOST / 2;
  }
  // The row at a time, or the last one.
  row(t) {
    if (t === null || !this.n) return this.n - 1;
    const k = find(this.time.subarray(0, this.n), t);
    return k > 0 && (k === this.n || t - this.time[k - 1] < this.time[k] - t) ? k - 1 : k;
  }
}
const grown = (old) => { const column = new Float64Array(2 * old.length); column.set(old); return column; };

// ---------------------------------------------------------------- the run

const start = () => ({ set: new Map(), events: [], step: model.experiment.step, start: model.experiment.start, stop: model.experiment.stop });
let plan = start(), chosen = null, rec = new Recording(), old = null, k = 0, running = false, ready = false, wanted = false, saved = null, speed = null;
let engine = null, watch = 0, number = 0;

function send(message) {
  engine.postMessage(message);
  alive();
}
// Without an answer for three seconds, the model hangs.
function alive() {
  clearTimeout(watch);
  if (ready) watch = setTimeout(() => tell("The model does not answer. Reset ends it and begins anew.", "wrong"), 3000);
}

const groups = () => {
  const kinds = new Map();
  for (const v of recorded) kinds.set(v.kind, [...(kinds.get(v.kind) ?? []), v.reference]);
  return [...kinds].map(([kind, references]) => ({ kind, references }));
};
// The worker records kind by kind.
recorded.sort((a, b) => [...new Set(recorded.map((v) => v.kind))].indexOf(a.kind) - [...new Set(recorded.map((v) => v.kind))].indexOf(b.kind));

function begin(run) {
  if (rec.n > 1) old = rec;
  [rec, k, running, wanted] = [new Recording(), 0, false, run];
  const sets = new Map(model.starts.map(([name, value]) => [name, value]));
  for (const [name, value] of plan.set) sets.set(name, value);
  const coded = ([name, value]) => [byName.get(name).kind, byName.get(name).reference, value];
  tell("");
  number += 1;
  send({ does: "begin", number, plan: { ...plan, set: [...sets].map(coded), events: plan.events.map(([at, name, value]) => [at, ...coded([name, value])]), groups: groups() } });
  follow(true);
  controls();
}

const rate = () => Number($("rate").value);
function run() {
  const message = { does: "run", rate: rate() };
  // After the end, a run goes on without one.
  if (plan.stop !== null && k >= Math.round((plan.stop - plan.start) / plan.step)) message.stop = plan.stop = null;
  running = true;
  send(message);
  controls();
}
function pause() { send({ does: "pause" }); }
function again() { begin(true); }
function reset() {
  engine.terminate();
  clearTimeout(watch);
  [engine, ready, rec, old, wanted] = [null, false, new Recording(), null, false];
  if (chosen) take(chosen, false); else { plan = start(); load(); }
}

function take(preset, go) {
  if (!preset.compare) old = null;
  chosen = preset;
  plan = { ...start(), set: new Map(preset.set), events: preset.events.map((event) => [...event]), stop: preset.stop ?? model.experiment.stop };
  $("rate").value = String(preset.rate ?? usual);
  $("text").textContent = preset.text ?? "";
  document.querySelectorAll("#presets button").forEach((button, i) => button.setAttribute("aria-pressed", String(model.presets[i] === preset)));
  const compared = preset.compare ? rec : null;
  if (ready) { begin(go); if (!compared) old = null; } else load();
}

// What the worker says.
const SAYS = {
  loaded() {
    ready = true;
    begin(wanted);
  },
  rows({ rows, k: at, busy, running: still }) {
    const first = rec.n === 0;
    rec.add(rows);
    [k, running] = [at, still];
    if (busy > 1 && !first) speed = 0.8 * (speed ?? (rows.length / (1 + recorded.length)) * plan.step * 1000 / busy) + 0.2 * ((rows.length / (1 + recorded.length)) * plan.step * 1000) / busy;
    if (first && wanted) { wanted = false; run(); }
    follow(false);
    controls();
    draw();
  },
  paused() {},
  event({ event: [at, , reference, value] }) {
    const { name } = model.variables.find((v) => v.reference === reference);
    plan.events = plan.events.filter((event) => event[0] !== at || event[1] !== name);
    plan.events.push([at, name, value]);
    plan.events.sort((a, b) => a[0] - b[0]);
  },
  refused({ references, k: at, text }) {
    const names = model.variables.filter((v) => references.includes(v.reference)).map((v) => v.name);
    plan.events = plan.events.filter((event) => event[0] !== at || !names.includes(event[1]));
    running = false;
    tell(`Refused: ${text}`, "wrong");
    follow(true);
    controls();
  },
  state({ state, k: at, events }) {
    saved = { state, k: at, events, plan: { ...plan, events: plan.events.map((event) => [...event]) }, n: rec.n };
    tell(`State saved at t = ${short(plan.start + at * plan.step)} s.`);
    controls();
  },
  restored({ k: at }) {
    old = rec;
    const kept = new Recording(), n = old.row(plan.start + at * plan.step);
    for (const [name, column] of old.columns) kept.columns.set(name, column.slice());
    kept.n = Math.min(old.n, n + 1);
    [rec, k, running] = [kept, at, false];
    follow(true);
    controls();
    draw();
  },
  stopped() { tell("The model ends the simulation here."); },
  fault({ text, k: at }) {
    running = false;
    tell(`${text} (t = ${short(plan.start + at * plan.step)} s). Reset begins anew.`, "wrong");
    controls();
    draw();
  },
  log({ status, text }) { if (status === "Warning") tell(text); },
};
function listen() {
  engine.onmessage = ({ data }) => {
    // What a run before has said since.
    if (data.run && data.run !== number) return;
    clearTimeout(watch);
    SAYS[data.does](data);
    if (running) alive();
  };
  engine.onerror = (event) => tell(event.message, "wrong");
}

// Starts the worker and the module.
function load() {
  if (typeof DecompressionStream === "undefined" || typeof WebAssembly === "undefined") {
    tell("This browser cannot run the model: it lacks DecompressionStream or WebAssembly. Chrome 80, Firefox 113, Safari 16.4 and later have both.", "wrong");
    return;
  }
  engine = new Worker(URL.createObjectURL(new Blob([$("worker").textContent], { type: "text/javascript" })));
  [ready, running, saved] = [false, false, null];
  listen();
  tell("Loading the model …");
  engine.postMessage({ does: "load", packed: $("module").textContent.trim(), token: model.token });
  controls();
}

// ---------------------------------------------------------------- controls of variables

// The value of a variable now: at the start, or after the changes so far.
function now(v) {
  let value = plan.set.get(v.name) ?? model.starts.find(([name]) => name === v.name)?.[1] ?? v.start;
  for (const [at, name, x] of plan.events) if (name === v.name && at <= k) value = x;
  return value;
}

const allowed = (v, x) => Number.isFinite(x) && x >= (v.min ?? -Infinity) && x <= (v.max ?? Infinity) && !(v.above && x === v.min) && !(v.below && x === v.max);

// Sets a variable: at once where it acts at once, else with a new run.
function apply(v, value) {
  if (acts(v) && k > 0) {
    send({ does: "change", kind: v.kind, reference: v.reference, value });
    const ended = plan.stop !== null && k >= Math.round((plan.stop - plan.start) / plan.step);
    if (ended) run();
    return;
  }
  plan.set.set(v.name, value);
  begin(running || k > 0);
}

const boxes = [];
function control(parent, v) {
  const row = element(parent, "div", { class: "control" });
  const id = `v${v.reference}`, label = element(row, "label", { for: id });
  // A long name breaks after its dots.
  const name = element(label, "span", { class: "name" });
  v.name.split(/(?<=[.])/).forEach((part, i) => { if (i) element(name, "wbr"); name.append(part); });
  element(label, "small", {}, v.description);
  const place = element(row, "span", { class: "value" });
  if (v.elements !== 1) {
    element(place, "output", { id }, [v.start].flat().slice(0, 6).map((x) => (typeof x === "number" ? short(x) : x)).join(", ") + (v.elements > 6 ? ", …" : ""));
    return;
  }
  let box, slider = null;
  if (v.kind === "Boolean") {
    box = element(place, "input", { id, type: "checkbox" });
    box.addEventListener("change", () => apply(v, box.checked));
  } else if (v.kind === "Enumeration") {
    box = element(place, "select", { id });
    for (const [value, name, text] of model.enumerations[v.type]) element(box, "option", { value, title: text }, name);
    box.addEventListener("change", () => apply(v, Number(box.value)));
  } else if (v.kind === "String") {
    box = element(place, "input", { id, type: "text" });
    box.addEventListener("change", () => apply(v, box.value));
  } else {
    const [unit] = scale(v), whole = !v.kind.startsWith("Float");
    box = element(place, "input", { id, type: "number", step: whole ? 1 : "any" });
    if (unit) element(place, "span", { class: "unit" }, unit);
    const judged = (text, late) => {
      const x = whole ? Math.round(meant(v, Number(text))) : meant(v, Number(text)), good = text !== "" && allowed(v, x);
      box.setAttribute("aria-invalid", String(!good));
      if (!good) tell(`${v.name}: ${limits(v)}`, "wrong");
      else if (late || acts(v)) apply(v, x);
    };
    box.addEventListener("change", () => judged(box.value, true));
    const [low, high] = v.range ?? [v.min, v.max];
    if (Number.isFinite(low) && Number.isFinite(high)) {
      const [from, to] = [seen(v, low), seen(v, high)];
      slider = element(row, "input", { type: "range", min: from, max: to, step: whole ? 1 : pleasing((to - from) / 200), "aria-label": v.name });
      slider.addEventListener("input", () => { box.value = short(Number(slider.value)); judged(slider.value, false); });
      slider.addEventListener("change", () => { if (!acts(v)) judged(slider.value, true); });
    }
  }
  const show = () => {
    const value = now(v);
    if (document.activeElement !== box) {
      if (v.kind === "Boolean") box.checked = value; else box.value = NUMBERS.test(v.kind) && v.kind !== "Enumeration" ? short(seen(v, value)) : value;
      box.removeAttribute("aria-invalid");
    }
    if (slider && document.activeElement !== slider) slider.value = seen(v, value);
  };
  boxes.push({ v, show });
  show();
}
const pleasing = (x) => { const power = 10 ** Math.floor(Math.log10(x)); return power * [1, 2, 5, 10].find((m) => m * power >= 0.999 * x); };
const limits = (v) => {
  const [unit] = scale(v), low = v.min === undefined ? "" : `${v.above ? "above" : "at least"} ${short(seen(v, v.min))} ${unit}`, high = v.max === undefined ? "" : `${v.below ? "below" : "at most"} ${short(seen(v, v.max))} ${unit}`;
  return [low, high].filter(Boolean).join(" and ") || "any finite number";
};
function follow() { for (const { show } of boxes) show(); }

function group(title, variables, open) {
  if (!variables.length) return;
  const box = element($("variables"), "details", open ? { open: "" } : {});
  element(box, "summary", {}, `${title} (${variables.length})`);
  let filled = false;
  const fill = () => {
    if (filled) return;
    filled = true;
    const rows = element(box, "div");
    if (variables.length > 12) {
      const search = element(box.insertBefore(document.createElement("p"), rows), "input", { type: "search", placeholder: "Search", "aria-label": `Search in ${title}` });
      search.addEventListener("input", () => {
        const text = search.value.toLowerCase();
        [...rows.children].forEach((row, i) => { row.hidden = !`${variables[i].name} ${variables[i].description}`.toLowerCase().includes(text); });
      });
    }
    variables.forEach((v) => control(rows, v));
  };
  if (open) fill(); else box.addEventListener("toggle", fill);
}

// ---------------------------------------------------------------- plots

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const curve = (name) => differences.get(name)?.like ?? byName.get(name);
const view = { from: null, to: null, at: null };
let plots = [], planes = [], drawing = false;

function draw() {
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    $("time").textContent = `t = ${(plan.start + k * plan.step).toFixed(Math.min(6, Math.max(3, Math.ceil(-Math.log10(plan.step)))))} s`;
    $("speed").textContent = speed ? `this computer: ${speed < 10 ? speed.toFixed(1) : Math.round(speed)}\u00d7 real time` : "";
    // One left edge, so that times stand below each other.
    const seen = plots.filter((plot) => plot.scale()), left = Math.max(...seen.map((plot) => plot.wide));
    seen.forEach((plot) => plot.draw(left));
    planes.forEach((plane) => plane.draw());
  });
}

class Plot {
  constructor({ title, curves }) {
    Object.assign(this, { title, curves: [...curves] });
    this.box = element($("plots"), "figure");
    this.head = element(this.box, "figcaption");
    this.canvas = element(this.box, "canvas", { tabindex: 0, role: "img" });
    new ResizeObserver(draw).observe(this.canvas);
    this.listen();
    this.heading();
  }
  heading() {
    this.head.replaceChildren();
    const [first] = this.curves, unit = first ? scale(curve(first))[0] : "";
    element(this.head, "b", {}, this.title || first);
    this.readings = this.curves.map((name, i) => {
      const button = element(this.head, "button", { type: "button", title: "Remove this curve", class: "curve" });
      element(button, "span", { class: "swatch", style: `background:${model.inks[i % model.inks.length]}` });
      button.append(name);
      const value = element(button, "output");
      button.addEventListener("click", () => { this.curves.splice(i, 1); if (this.curves.length) { this.heading(); draw(); } else this.remove(); });
      return () => { const row = rec.row(view.at); value.textContent = row < 0 ? "" : reading(curve(name), rec.columns.get(name)[row]); };
    });
    if (unit) element(this.head, "small", {}, `[${unit}]`);
    const more = names().filter((name) => !this.curves.includes(name) && scale(curve(name))[0] === unit);
    if (more.length) {
      const add = element(this.head, "select", { "aria-label": "Add a curve" });
      element(add, "option", { value: "" }, "+");
      more.forEach((name) => element(add, "option", {}, name));
      add.addEventListener("change", () => { this.curves.push(add.value); this.heading(); draw(); });
    }
    element(this.head, "button", { type: "button", class: "close", "aria-label": `Remove the plot ${this.title || first}` }, "\u2715").addEventListener("click", () => this.remove());
    this.canvas.setAttribute("aria-label", `${this.title}: ${this.curves.join(", ")} over time`);
  }
  remove() { this.box.remove(); plots = plots.filter((plot) => plot !== this); }

  listen() {
    const { canvas } = this;
    let begun = null;
    const time = (event) => this.from + ((event.clientX - canvas.getBoundingClientRect().left - this.left) / this.across) * (this.to - this.from);
    canvas.addEventListener("pointerdown", (event) => { if (!event.button && event.pointerType === "mouse") { begun = time(event); canvas.setPointerCapture(event.pointerId); } });
    canvas.addEventListener("pointermove", (event) => { view.at = time(event); this.chosen = begun === null ? null : [begun, view.at]; draw(); });
    canvas.addEventListener("pointerup", (event) => {
      if (begun === null) return;
      const [a, b] = [begun, time(event)].sort((one, other) => one - other);
      [begun, this.chosen] = [null, null];
      if ((b - a) / (this.to - this.from) > 0.01) [view.from, view.to] = [a, b];
      draw();
    });
    canvas.addEventListener("pointerleave", () => { if (begun === null) { view.at = null; draw(); } });
    const all = () => { [view.from, view.to] = [null, null]; draw(); };
    canvas.addEventListener("dblclick", all);
    canvas.addEventListener("blur", () => { view.at = null; draw(); });
    canvas.addEventListener("keydown", (event) => {
      const by = (this.to - this.from) / 100, at = view.at ?? this.to;
      const keys = { ArrowLeft: () => { view.at = Math.max(this.from, at - by); }, ArrowRight: () => { view.at = Math.min(this.to, at + by); }, Escape: all };
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
      draw();
    });
  }

  x(t) { return this.left + (this.across * (t - this.from)) / (this.to - this.from); }
  y(v) { return this.bottom - ((this.bottom - this.top) * (v - this.low)) / (this.high - this.low); }

  // The ranges of the axes; false if there is nothing to draw.
  scale() {
    const { canvas } = this, ratio = devicePixelRatio || 1, [w, h] = [canvas.clientWidth, canvas.clientHeight];
    if (!w || !rec.n) return false;
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) [canvas.width, canvas.height] = [Math.round(w * ratio), Math.round(h * ratio)];
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, w, h);
    const end = plan.stop ?? Math.max(rec.time[rec.n - 1], plan.start + 10 * plan.step);
    this.from = view.from ?? (rec.time[0] > plan.start ? rec.time[0] : plan.start);
    this.to = view.to ?? Math.max(end, rec.time[rec.n - 1]);
    this.runs = [[rec, false], ...($("overlay").checked && old ? [[old, true]] : [])];
    let [low, high] = [Infinity, -Infinity];
    for (const [run] of this.runs) for (const name of this.curves) {
      const values = run.columns.get(name), v = curve(name), time = run.time.subarray(0, run.n);
      const [first, past] = [Math.max(0, find(time, this.from) - 1), Math.min(run.n, find(time, this.to) + 1)];
      for (let i = first; i < past; i++) { const x = seen(v, values[i]); if (x < low) low = x; if (x > high) high = x; }
    }
    if (!(low <= high)) [low, high] = [0, 0];
    const margin = Math.max(0.06 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high))) || 1;
    [this.low, this.high, this.top, this.bottom] = [low - margin, high + margin, 6, h - 20];
    const [values, decimals] = ticks(this.low, this.high, 4);
    [this.values, this.labels] = [values, values.map((x) => onAxis(x, decimals))];
    // Curves of one enumeration have the names of its items on the axis.
    const types = new Set(this.curves.map((name) => curve(name).type)), [type] = types;
    if (types.size === 1 && type) {
      const items = model.enumerations[type].filter(([x]) => x >= low && x <= high);
      [this.values, this.labels] = [items.map(([x]) => x), items.map(([, name]) => name)];
    }
    pen.font = "12px system-ui, sans-serif";
    this.wide = 10 + Math.max(24, ...this.labels.map((label) => pen.measureText(label).width));
    return true;
  }

  draw(left) {
    const pen = this.canvas.getContext("2d");
    [this.left, this.across] = [left, this.canvas.clientWidth - left - 10];
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [style("--ink"), style("--line"), 1];
    const line = (a, b, c, d) => { pen.beginPath(); pen.moveTo(a, b); pen.lineTo(c, d); pen.stroke(); };
    [pen.textAlign, pen.textBaseline] = ["right", "middle"];
    this.values.forEach((x, i) => { line(this.left, this.y(x), this.left + this.across, this.y(x)); pen.fillText(this.labels[i], this.left - 5, this.y(x)); });
    const [times, digits] = ticks(this.from, this.to, Math.max(3, this.across / 80));
    [pen.textAlign, pen.textBaseline] = ["center", "top"];
    for (const t of times) { line(this.x(t), this.top, this.x(t), this.bottom); pen.fillText(onAxis(t, digits), this.x(t), this.bottom + 5); }
    pen.save();
    pen.beginPath();
    pen.rect(this.left, this.top - 2, this.across, this.bottom - this.top + 4);
    pen.clip();
    for (const [run, dashed] of this.runs) this.curves.forEach((name, i) => {
      pen.strokeStyle = model.inks[i % model.inks.length];
      [pen.lineWidth, pen.globalAlpha] = [1.5, dashed ? 0.6 : 1];
      pen.setLineDash(dashed ? [5, 4] : []);
      this.line(pen, run, name);
    });
    [pen.globalAlpha] = [1];
    pen.setLineDash([]);
    if (this.chosen) { pen.fillStyle = style("--accent"); pen.globalAlpha = 0.2; const [a, b] = this.chosen.map((t) => this.x(t)); pen.fillRect(Math.min(a, b), this.top, Math.abs(b - a), this.bottom - this.top); pen.globalAlpha = 1; }
    if (view.at !== null) { pen.strokeStyle = style("--faint"); line(this.x(view.at), this.top, this.x(view.at), this.bottom); }
    pen.restore();
    this.readings.forEach((read) => read());
  }

  // Of each half pixel the first, the lowest, the highest and the last point.
  line(pen, run, name) {
    const values = run.columns.get(name), v = curve(name), time = run.time.subarray(0, run.n);
    const [first, past] = [Math.max(0, find(time, this.from) - 1), Math.min(run.n, find(time, this.to) + 1)];
    const at = (i) => [this.x(time[i]), this.y(seen(v, values[i]))];
    let up = true;
    const to = (i) => { if (!Number.isFinite(values[i])) { up = true; return; } const [x, y] = at(i); if (up) pen.moveTo(x, y); else pen.lineTo(x, y); up = false; };
    pen.beginPath();
    for (let i = first; i < past;) {
      const pixel = Math.floor(2 * this.x(time[i]));
      let [begin, low, high] = [i, i, i];
      for (; i < past && Math.floor(2 * this.x(time[i])) === pixel; i++) { if (values[i] < values[low]) low = i; if (values[i] > values[high]) high = i; }
      for (const point of [...new Set([begin, Math.min(low, high), Math.max(low, high), i - 1])]) to(point);
    }
    pen.stroke();
  }
}

// ---------------------------------------------------------------- vectors

class Plane {
  constructor({ title, arrows }, i) {
    this.arrows = arrows;
    const box = element($("planes"), "figure", { class: "plane" });
    element(box, "figcaption").append(element(document.createElement("span"), "b", {}, title));
    this.canvas = element(box, "canvas", { role: "img", "aria-label": `${title}: ${arrows.map((arrow) => arrow.name).join(", ")}` });
    const list = element(box, "p", { class: "legend" });
    // The first one also shows the differences, as large figures.
    this.readings = i ? [] : [...differences.values()].map((d) => {
      const item = element(list, "span", { class: "reading" }, `${d.name} `), value = element(item, "b");
      return (row) => { value.textContent = `${shown(seen(d.like, rec.columns.get(d.name)[row]))} ${scale(d.like)[0]}`; };
    });
    arrows.forEach(({ name }, i) => { const item = element(list, "span"); element(item, "span", { class: "swatch", style: `background:${model.inks[i % model.inks.length]}` }); item.append(name); });
    new ResizeObserver(draw).observe(this.canvas);
  }
  // A sum of names, numbers and products of both.
  sum(terms, row) {
    const one = (part) => (typeof part === "number" ? part : rec.columns.get(part)?.[row] ?? Number(now(byName.get(part))));
    return terms.reduce((sum, term) => sum + [term].flat().reduce((product, part) => product * one(part), 1), 0);
  }
  draw() {
    const { canvas } = this, ratio = devicePixelRatio || 1, size = canvas.clientWidth, row = rec.row(view.at);
    if (!size || row < 0) return;
    this.readings.forEach((read) => read(row));
    [canvas.width, canvas.height] = [size * ratio, size * ratio];
    const pen = canvas.getContext("2d"), middle = size / 2, radius = 0.94 * middle;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.strokeStyle = style("--line");
    for (const share of [0.5, 1]) { pen.beginPath(); pen.arc(middle, middle, share * radius, 0, 7); pen.stroke(); }
    pen.beginPath();
    pen.moveTo(middle - radius, middle); pen.lineTo(middle + radius, middle);
    pen.moveTo(middle, middle - radius); pen.lineTo(middle, middle + radius);
    pen.stroke();
    const sums = this.arrows.map(({ d, q }) => [this.sum(d, row), this.sum(q, row)]);
    // A longer vector reaches the circle too, and with it those of its scale.
    if (this.of !== rec) [this.of, this.reach] = [rec, new Map(this.arrows.map(({ full }) => [full, full]))];
    this.arrows.forEach(({ full }, i) => { const length = Math.hypot(...sums[i]); if (length > this.reach.get(full)) this.reach.set(full, length); });
    this.arrows.forEach(({ angle, full, thin }, i) => {
      const turn = angle ? this.sum([angle], row) : 0, [x, y] = sums[i].map((sum) => sum / this.reach.get(full));
      const [a, b] = [x * Math.cos(turn) - y * Math.sin(turn), x * Math.sin(turn) + y * Math.cos(turn)];
      if (!Number.isFinite(a + b)) return;
      const [tipX, tipY] = [middle + radius * a, middle - radius * b], length = Math.hypot(a, b) * radius, along = Math.atan2(-b, a);
      pen.strokeStyle = pen.fillStyle = model.inks[i % model.inks.length];
      pen.lineWidth = thin ? 1.5 : 3;
      pen.setLineDash(thin ? [5, 4] : []);
      if (length > 1) { pen.beginPath(); pen.moveTo(middle, middle); pen.lineTo(tipX - 6 * Math.cos(along), tipY - 6 * Math.sin(along)); pen.stroke(); }
      pen.setLineDash([]);
      const wing = (side) => [tipX - 11 * Math.cos(along + side), tipY - 11 * Math.sin(along + side)];
      pen.beginPath();
      pen.moveTo(tipX, tipY); pen.lineTo(...wing(0.4)); pen.lineTo(...wing(-0.4)); pen.fill();
    });
  }
}

// ---------------------------------------------------------------- address, CSV

const names = () => [...recorded.map((v) => v.name), ...differences.keys()];
const coded = (name) => encodeURIComponent(name).replace(/[+]/g, "%2B");
function address() {
  const parts = [];
  const value = (name, x) => coded(textOf(byName.get(name), x));
  if (plan.set.size) parts.push(`set=${[...plan.set].map(([name, x]) => `${coded(name)}:${value(name, x)}`).join(",")}`);
  parts.push(`do=${plan.events.map(([at, name, x]) => `${at}:${coded(name)}:${value(name, x)}`).join(",")}`);
  parts.push(`plot=${plots.map((plot) => plot.curves.map(coded).join("+")).join(",")}`);
  parts.push(`stop=${plan.stop ?? "none"}`, `rate=${$("rate").value}`, `step=${plan.step}`);
  return `#${parts.join("&")}`;
}
// The plan of an address; errors in it are shown once, and the rest is used.
function read(hash) {
  const given = new Map(hash.replace(/^#/, "").split("&").map((part) => [part.split("=")[0], part.slice(part.indexOf("=") + 1)])), wrong = [];
  const list = (key) => (given.get(key) ?? "").split(",").filter(Boolean);
  const value = (name, text) => {
    const v = byName.get(name), wanted = v && (v.causality === "input" || v.causality === "parameter") && v.elements === 1;
    const x = wanted ? valueOf(v, text) : undefined;
    if (x === undefined || (typeof x === "number" && !allowed(v, x))) { wrong.push(`${name}:${text}`); return undefined; }
    return x;
  };
  const name = (text) => { try { return decodeURIComponent(text); } catch { return text; } };
  for (const part of list("set")) {
    const [key, text = ""] = part.split(":"), x = value(name(key), name(text));
    if (x !== undefined) plan.set.set(name(key), x);
  }
  for (const part of list("do")) {
    const [at, key = "", text = ""] = part.split(":"), x = value(name(key), name(text));
    if (!/^\d+$/.test(at) || (x !== undefined && !acts(byName.get(name(key))))) wrong.push(part);
    else if (x !== undefined) plan.events.push([Number(at), name(key), x]);
  }
  const number = (key, good) => { if (!given.has(key)) return undefined; const x = Number(given.get(key)); if (good(x)) return x; wrong.push(`${key}=${given.get(key)}`); return undefined; };
  plan.step = number("step", (x) => x > 0 && Number.isFinite(x)) ?? plan.step;
  plan.stop = given.get("stop") === "none" ? null : number("stop", (x) => x > plan.start && Number.isFinite(x)) ?? plan.stop;
  const wish = number("rate", (x) => x >= 0 && Number.isFinite(x));
  if (wish !== undefined) choose(wish);
  if (given.has("plot")) {
    const wished = list("plot").map((part) => part.split("+").map(name).filter((each) => names().includes(each) || (wrong.push(each), false))).filter((part) => part.length);
    if (wished.length) { [...plots].forEach((plot) => plot.remove()); plots = wished.map((curves) => new Plot({ title: "", curves })); }
  }
  for (const key of given.keys()) if (key && !["set", "do", "plot", "stop", "rate", "step"].includes(key)) wrong.push(key);
  return { go: given.has("do"), wrong };
}
function csv() {
  const columns = [{ name: "time", unit: "s" }, ...recorded], lines = [line(columns.map(heading))];
  for (let i = 0; i < rec.n; i++) lines.push(line(columns.map(({ name }) => rec.columns.get(name)[i])));
  const link = element(document.body, "a", { href: URL.createObjectURL(new Blob(lines, { type: "text/csv" })), download: `${model.title}.csv` });
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

// ---------------------------------------------------------------- the page

function controls() {
  $("run").textContent = running ? "Pause" : "Run";
  for (const id of ["run", "step", "steps", "again", "save", "csv", "link"]) $(id).disabled = !ready;
  $("step").disabled = $("steps").disabled = !ready || running;
  $("back").disabled = !saved;
}
const usual = Number(((model.experiment.stop - model.experiment.start) / 10).toPrecision(3));
function choose(x) {
  if (![...$("rate").options].some((option) => Number(option.value) === x)) element($("rate"), "option", { value: x }, `${x}\u00d7`);
  $("rate").value = [...$("rate").options].find((option) => Number(option.value) === x).value;
}

function open() {
  for (const [value, text] of [[0.1, "1/10 of real time"], [0.25, "1/4 of real time"], [1, "real time"], [5, "5\u00d7 real time"], [usual, `10 s for ${short(model.experiment.stop - model.experiment.start)} s`], [0, "as fast as possible"]]) {
    if (![...$("rate").options].some((option) => Number(option.value) === value)) element($("rate"), "option", { value }, text);
  }
  $("rate").value = String(usual);
  for (const preset of model.presets) element($("presets"), "button", { type: "button", "aria-pressed": "false" }, preset.title).addEventListener("click", () => take(preset, true));
  const chosenNames = [...model.inputs, ...model.parameters], rest = settable.filter((v) => !chosenNames.includes(v.name));
  group("Chosen", chosenNames.map((name) => byName.get(name)), true);
  group("Inputs", rest.filter((v) => v.causality === "input"), !chosenNames.length);
  group("Parameters that act at once", rest.filter((v) => v.causality === "parameter" && acts(v)), false);
  group("Parameters from the start", rest.filter((v) => v.causality === "parameter" && !acts(v)), false);
  plots = model.plots.map((plot) => new Plot(plot));
  planes = model.planes.map((plane, i) => new Plane(plane, i));
  for (const name of names()) element($("add"), "option", {}, name);
  $("add").addEventListener("change", () => { plots.push(new Plot({ title: "", curves: [$("add").value] })); $("add").value = ""; draw(); });
  $("run").addEventListener("click", () => (running ? pause() : run()));
  $("step").addEventListener("click", () => send({ does: "step", n: 1 }));
  $("steps").addEventListener("click", () => send({ does: "step", n: 10 }));
  $("reset").addEventListener("click", reset);
  $("again").addEventListener("click", again);
  $("rate").addEventListener("change", () => { if (running) run(); });
  $("save").addEventListener("click", () => send({ does: "save" }));
  $("back").addEventListener("click", () => { plan = { ...saved.plan, set: new Map(saved.plan.set), events: saved.plan.events.map((event) => [...event]) }; send({ does: "restore", state: saved.state, k: saved.k, events: saved.events }); });
  $("csv").addEventListener("click", csv);
  $("link").addEventListener("click", async () => {
    const hash = address();
    try { history.replaceState(null, "", hash); } catch { location.hash = hash; }
    try { await navigator.clipboard.writeText(location.href); tell("The address repeats this run, bit for bit; it is copied."); } catch { tell("The address of the page repeats this run, bit for bit."); }
  });
  $("overlay").addEventListener("change", draw);
  $("licenses").addEventListener("toggle", async () => {
    const bytes = Uint8Array.from(atob($("license").textContent.trim()), (c) => c.charCodeAt(0));
    $("licenses").querySelector("pre").textContent ||= await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  const hash = location.hash;
  if (hash.length > 1) {
    const { go, wrong } = read(hash);
    wanted = go;
    load();
    if (wrong.length) { const told = SAYS.loaded; SAYS.loaded = () => { told(); tell(`Not used from the address: ${wrong.join(", ")}`, "wrong"); SAYS.loaded = told; }; }
  } else if (model.presets.length) take(model.presets[0], false);
  else load();
}
open();
