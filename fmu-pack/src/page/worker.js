"use strict";
// Runs the module of an FMU: one instance of Co-Simulation, what it records, and its states. Messages in and out are those of
// `run.js`; every time is start + k * step, a product and never a sum.

const STATUS = ["OK", "Warning", "Discard", "Error", "Fatal"];
const ARRAYS = {
  Float64: Float64Array, Float32: Float32Array, Int8: Int8Array, UInt8: Uint8Array, Int16: Int16Array, UInt16: Uint16Array,
  Int32: Int32Array, UInt32: Uint32Array, Int64: BigInt64Array, UInt64: BigUint64Array, Enumeration: BigInt64Array,
  Boolean: Uint8Array, String: Uint32Array,
};
const PAGE = 65536;
// A table takes functions of WebAssembly only: this module imports and exports one of the logger's type.
const LOGGER = new Uint8Array([
  0, 97, 115, 109, 1, 0, 0, 0, 1, 8, 1, 96, 4, 127, 127, 127, 127, 0, 2, 7, 1, 1, 97, 1, 98, 0, 0, 7, 5, 1, 1, 99, 0, 0,
]);

// What the FMU refuses, in its own words.
class Refusal extends Error {}

class Fmu {
  constructor(module, token, log) { Object.assign(this, { module, token, log, api: null, instance: 0, arena: 0, room: 0 }); }

  // A new instance of the model. A trap leaves the module unusable: then it gets a new memory too.
  open() {
    if (this.instance) this.api.fmi3FreeInstance(this.instance);
    this.instance = 0;
    if (!this.api) {
      this.api = new WebAssembly.Instance(this.module, {}).exports;
      [this.room, this.arena] = [2, this.api.memory.grow(2) * PAGE];
      const logger = new WebAssembly.Instance(new WebAssembly.Module(LOGGER), { a: { b: (_, status, category, text) => this.logged(status, category, text) } });
      const table = this.api.__indirect_function_table;
      this.logger = table.grow(1);
      table.set(this.logger, logger.exports.c);
    }
    this.used = 0;
    this.said = "";
    const name = this.put("instance"), token = this.put(this.token);
    this.instance = this.api.fmi3InstantiateCoSimulation(name, token, 0, 0, 1, 0, 0, 0, 0, 0, this.logger, 0);
    this.used = 0;
    if (!this.instance) throw new Refusal(this.said || "the FMU gives no instance");
  }

  // Drops the module after a trap, whose words are those of the panic, or of the engine.
  fault(error) {
    let text = error.message;
    if (error instanceof WebAssembly.RuntimeError) {
      const said = this.api?.fmu_fault?.();
      text = said ? this.text(said) : `the model's code ended: ${text}`;
      [this.api, this.instance] = [null, 0];
    }
    return text;
  }

  // Room for so many bytes, until the next call. Memory that grows detaches every view, so none is kept.
  take(bytes) {
    const at = Math.ceil(this.used / 8) * 8;
    this.used = at + bytes;
    const pages = Math.ceil(this.used / PAGE);
    if (pages > this.room) {
      const more = this.api.memory.grow(pages) * PAGE;
      if (at) throw new Refusal("too much at once for the memory of the page");
      [this.arena, this.room] = [more, pages];
    }
    return this.arena + at;
  }

  view(Array, at, n) { return new Array(this.api.memory.buffer, at, n); }

  put(text) {
    const bytes = new TextEncoder().encode(text), at = this.take(bytes.length + 1);
    const place = this.view(Uint8Array, at, bytes.length + 1);
    place.set(bytes);
    place[bytes.length] = 0;
    return at;
  }

  text(at) {
    const bytes = new Uint8Array(this.api.memory.buffer);
    return new TextDecoder().decode(bytes.subarray(at, bytes.indexOf(0, at)));
  }

  logged(status, category, text) {
    // The standard's escape for a number sign.
    const said = this.text(text).replace(/##/g, "#");
    if (status > 1) this.said = said;
    if (status > 0) this.log(STATUS[status], this.text(category), said);
  }

  // Calls a function of FMI, with its arguments in the arena.
  call(name, ...given) {
    this.said = "";
    const status = this.api[`fmi3${name}`](this.instance, ...given);
    this.used = 0;
    if (status > 1) throw new Refusal(this.said || `fmi3${name} returns ${STATUS[status] ?? status}`);
  }

  set(kind, reference, value) {
    const values = [value].flat(), Array = ARRAYS[kind];
    const list = this.take(4);
    this.view(Uint32Array, list, 1)[0] = reference;
    const texts = kind === "String" ? values.map((text) => this.put(text)) : null;
    const at = this.take(Array.BYTES_PER_ELEMENT * values.length);
    this.view(Array, at, values.length).set(texts ?? values.map((x) => (Array.BYTES_PER_ELEMENT === 8 && Array !== Float64Array ? BigInt(x) : Number(x))));
    this.call(kind === "Enumeration" ? "SetInt64" : `Set${kind}`, list, 1, at, values.length);
  }

  // The values of several references, as numbers.
  get(kind, references, out, at) {
    const n = references.length, Array = ARRAYS[kind], list = this.take(4 * n);
    this.view(Uint32Array, list, n).set(references);
    const from = this.take(Array.BYTES_PER_ELEMENT * n);
    this.call(kind === "Enumeration" ? "GetInt64" : `Get${kind}`, list, n, from, n);
    const values = this.view(Array, from, n);
    for (let i = 0; i < n; i++) out[at + i] = Number(values[i]);
  }

  initialize(start) {
    this.call("EnterInitializationMode", 0, 0, start, 0, 0);
    this.call("ExitInitializationMode");
  }

  // One step; true if the FMU ends the simulation.
  step(t, h) {
    const at = this.take(16);
    this.call("DoStep", t, h, 1, at, at + 1, at + 2, at + 8);
    return this.view(Uint8Array, at, 3)[1] !== 0;
  }

  // The state as bytes.
  save() {
    const place = this.take(4);
    this.view(Uint32Array, place, 1)[0] = 0;
    this.call("GetFMUState", place);
    const state = this.view(Uint32Array, place, 1)[0];
    const size = this.take(4);
    this.call("SerializedFMUStateSize", state, size);
    const n = this.view(Uint32Array, size, 1)[0], bytes = this.take(n);
    this.call("SerializeFMUState", state, bytes, n);
    const copy = this.view(Uint8Array, bytes, n).slice();
    this.free(state);
    return copy;
  }

  restore(saved) {
    const place = this.take(8 + saved.length), bytes = place + 8;
    this.view(Uint8Array, bytes, saved.length).set(saved);
    this.call("DeserializeFMUState", bytes, saved.length, place);
    const state = this.view(Uint32Array, place, 1)[0];
    try { this.call("SetFMUState", state); } finally { this.free(state); }
  }

  free(state) {
    const place = this.take(4);
    this.view(Uint32Array, place, 1)[0] = state;
    this.call("FreeFMUState", place);
  }
}

const SLICE = 12;
// Every message names the run that it belongs to.
const post = (message, transfer = []) => self.postMessage({ run, ...message }, transfer);
let run = 0, fmu = null, plan = null, k = 0, next = 0, rate = 0, running = false, origin = null, timer = 0, before = null, busy = 0;
let rows = [], width = 1;

// Appends a row: the time, then the columns.
function record() {
  const at = rows.length;
  rows.length += width;
  rows[at] = plan.start + k * plan.step;
  let place = at + 1;
  for (const { kind, references } of plan.groups) {
    fmu.get(kind, references, rows, place);
    place += references.length;
  }
}

function flush() {
  const sent = Float64Array.from(rows);
  rows = [];
  post({ does: "rows", rows: sent, k, busy, running }, [sent.buffer]);
  busy = 0;
}

function begin(given, number) {
  run = number;
  plan = { ...given, events: [...given.events].sort((a, b) => a[0] - b[0]) };
  [k, next, running, before, busy, rows] = [0, 0, false, null, 0, []];
  width = 1 + plan.groups.reduce((n, group) => n + group.references.length, 0);
  clearTimeout(timer);
  fmu.open();
  for (const [kind, reference, value] of plan.set) fmu.set(kind, reference, value);
  fmu.initialize(plan.start);
  record();
  flush();
}

const last = () => (plan.stop === null ? Infinity : Math.round((plan.stop - plan.start) / plan.step));

// One step, with the changes that are due. Refused changes of a user leave the run where it was.
function advance() {
  while (next < plan.events.length && plan.events[next][0] <= k) {
    const [, kind, reference, value] = plan.events[next++];
    fmu.set(kind, reference, value);
  }
  try {
    if (fmu.step(plan.start + k * plan.step, plan.step)) {
      running = false;
      post({ does: "stopped" });
    }
  } catch (error) {
    if (!before || !(error instanceof Refusal)) throw error;
    running = false;
    fmu.restore(before.state);
    plan.events = plan.events.filter((event) => !before.events.includes(event));
    next = plan.events.filter((event) => event[0] < k).length;
    post({ does: "refused", references: before.events.map((event) => event[2]), k, text: error.message });
    before = null;
    return;
  }
  before = null;
  k += 1;
  record();
}

function work() {
  const begun = performance.now();
  let due = Infinity;
  if (rate > 0) {
    // More than a quarter of a second behind: the clock gives way.
    origin ??= { at: begun, k };
    due = origin.k + ((begun - origin.at) / 1000) * (rate / plan.step);
    if (due - k > (0.25 * rate) / plan.step + 1) {
      origin = { at: begun, k };
      due = k + 1;
    }
  }
  while (running && k < due && k < last() && performance.now() - begun < SLICE) advance();
  if (k >= last()) running = false;
  busy += performance.now() - begun;
  flush();
  if (running) timer = setTimeout(guarded(work), rate > 0 ? 8 : 0);
}

// A change by hand acts before step k and belongs to the run from then on.
function change({ kind, reference, value }) {
  before ??= { state: fmu.save(), events: [] };
  try {
    fmu.set(kind, reference, value);
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    fmu.restore(before.state);
    for (const event of before.events) fmu.set(...event.slice(1));
    post({ does: "refused", references: [reference], k, text: error.message });
    return;
  }
  const event = [k, kind, reference, value];
  const same = (other) => other[0] === k && other[2] === reference;
  plan.events = plan.events.filter((other) => !same(other));
  before.events = before.events.filter((other) => !same(other));
  before.events.push(event);
  next = plan.events.filter((other) => other[0] <= k).length;
  plan.events.splice(next++, 0, event);
  post({ does: "event", event });
}

const DOES = {
  async load({ packed, token }) {
    const begun = performance.now();
    const bytes = Uint8Array.from(atob(packed), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    const unpacked = await new Response(stream).arrayBuffer(), unpack = performance.now() - begun;
    fmu = new Fmu(await WebAssembly.compile(unpacked), token, (status, category, text) => post({ does: "log", status, category, text }));
    post({ does: "loaded", size: unpacked.byteLength, unpack, compile: performance.now() - begun - unpack });
  },
  begin: ({ plan, number }) => begin(plan, number),
  run(message) {
    [rate, origin, running] = [message.rate, null, true];
    if ("stop" in message) plan.stop = message.stop;
    clearTimeout(timer);
    work();
  },
  pause() {
    running = false;
    clearTimeout(timer);
    flush();
  },
  step({ n }) {
    running = true;
    for (let i = 0; i < n && running; i++) advance();
    running = false;
    flush();
  },
  change,
  save() { post({ does: "state", state: fmu.save(), k, events: plan.events }); },
  restore({ state, k: at, events }) {
    clearTimeout(timer);
    fmu.restore(state);
    [k, running, before] = [at, false, null];
    plan.events = events;
    next = events.filter((event) => event[0] < k).length;
    post({ does: "restored", k });
  },
};

function told(error) {
  running = false;
  const text = fmu ? fmu.fault(error) : error.message;
  if (plan && rows.length) flush();
  post({ does: "fault", text, k });
}

// Every way into the code above: a fault is reported, not thrown.
const guarded = (work) => (...given) => {
  try {
    const result = work(...given);
    if (result instanceof Promise) result.catch(told);
  } catch (error) {
    told(error);
  }
};

self.onmessage = guarded(({ data }) => DOES[data.does](data));
