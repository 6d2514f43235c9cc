"use strict";
// Draws the figures of the page: curves with zoom, legend switches and values at the cursor.

// Numbers as 4 planes of bytes per array: differences of the bits of 32-bit floats, zigzag, deflated, base64.
async function unpack(text, lengths) {
  const packed = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  let at = 0;
  return lengths.map((n) => {
    const bits = new Int32Array(n);
    for (let k = 0, last = 0; k < n; k++) {
      const z = bytes[at + k] | (bytes[at + n + k] << 8) | (bytes[at + 2 * n + k] << 16) | (bytes[at + 3 * n + k] << 24);
      last = (last + ((z >>> 1) ^ -(z & 1))) | 0;
      bits[k] = last;
    }
    at += 4 * n;
    return new Float32Array(bits.buffer);
  });
}

const make = (parent, name, attributes = {}, text = "") => {
  const svg = ["svg", "g", "path", "text", "rect", "clipPath", "title"].includes(name);
  const element = svg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.textContent = text;
  return parent.appendChild(element);
};
const put = (element, attributes) => Object.entries(attributes).forEach(([key, value]) => element.setAttribute(key, value));

// A range of the horizontal axis that panels share, and the cursor there.
class View {
  constructor(from, to) { Object.assign(this, { full: [from, to], from, to, at: null, panels: [] }); }
  zoom(from, to) {
    const least = (this.full[1] - this.full[0]) * 1e-6;
    [from, to] = [Math.max(from, this.full[0]), Math.min(to, this.full[1])];
    if (to - from >= least) Object.assign(this, { from, to });
    this.draw();
  }
  around(at, factor) { this.zoom(at - (at - this.from) * factor, at + (this.to - at) * factor); }
  shift(share) {
    const by = share * (this.to - this.from);
    const kept = Math.min(Math.max(by, this.full[0] - this.from), this.full[1] - this.to);
    this.zoom(this.from + kept, this.to + kept);
  }
  get zoomed() { return this.from > this.full[0] || this.to < this.full[1]; }
  draw() {
    const panels = this.panels.filter((panel) => panel.scale());
    // One left edge, so that times stand below each other.
    this.left = 14 + 7 * Math.max(...panels.map((panel) => panel.wide));
    panels.forEach((panel) => panel.draw());
    this.changed();
  }
  point(at) { this.at = at; this.panels.forEach((panel) => panel.point()); this.changed(); }
}

class Panel {
  constructor(parent, data, view, name) {
    Object.assign(this, { data, view, height: 210 });
    view.panels.push(this);
    this.svg = make(parent, "svg", { class: "plot", height: this.height, tabindex: 0, role: "img", "aria-label": name });
    const clip = `clip-${++Panel.count}`;
    this.clip = make(make(this.svg, "clipPath", { id: clip }), "rect");
    this.axes = make(this.svg, "g");
    const inside = make(this.svg, "g", { "clip-path": `url(#${clip})` });
    for (const curve of data.curves) {
      curve.path = make(inside, "path", { class: "curve", stroke: curve.ink, "stroke-opacity": curve.opacity, "stroke-dasharray": curve.dashed ? "6 4" : "none" });
      curve.end = curve.lost ? make(this.svg, "path", { class: "lost", stroke: curve.ink }) : null;
    }
    this.chosen = make(this.svg, "rect", { class: "chosen", visibility: "hidden" });
    this.cursor = make(this.svg, "path", { class: "cursor", visibility: "hidden" });
    this.listen();
    new ResizeObserver(() => view.draw()).observe(this.svg);
  }

  listen() {
    const { svg, view } = this;
    let begun = null;
    const time = (event) => {
      const share = (event.clientX - svg.getBoundingClientRect().left - this.left) / this.across;
      return view.from + Math.min(1, Math.max(0, share)) * (view.to - view.from);
    };
    svg.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      begun = time(event);
      svg.setPointerCapture(event.pointerId);
    });
    svg.addEventListener("pointermove", (event) => {
      view.point(time(event));
      if (begun !== null) {
        const [a, b] = [begun, view.at].map((t) => this.x(t)).sort((one, other) => one - other);
        put(this.chosen, { x: a, width: b - a, y: this.top, height: this.bottom - this.top, visibility: "visible" });
      }
    });
    const end = (event, zooms) => {
      if (begun === null) return;
      const range = [begun, time(event)].sort((one, other) => one - other);
      begun = null;
      this.chosen.setAttribute("visibility", "hidden");
      if (zooms && this.x(range[1]) - this.x(range[0]) > 5) view.zoom(...range);
    };
    svg.addEventListener("pointerup", (event) => end(event, true));
    svg.addEventListener("pointercancel", (event) => end(event, false));
    svg.addEventListener("pointerleave", () => { if (begun === null && document.activeElement !== svg) view.point(null); });
    svg.addEventListener("dblclick", () => view.zoom(...view.full));
    svg.addEventListener("blur", () => view.point(null));
    svg.addEventListener("keydown", (event) => {
      const middle = (view.from + view.to) / 2, at = view.at ?? middle, step = (view.to - view.from) / 100;
      const keys = {
        "+": () => view.around(at, 0.5), "=": () => view.around(at, 0.5), "-": () => view.around(at, 2),
        Escape: () => view.zoom(...view.full), 0: () => view.zoom(...view.full),
        ArrowLeft: () => (event.shiftKey ? view.shift(-0.2) : view.point(Math.max(view.from, at - step))),
        ArrowRight: () => (event.shiftKey ? view.shift(0.2) : view.point(Math.min(view.to, at + step))),
      };
      if (!keys[event.key] || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      keys[event.key]();
    });
  }

  x(t) { return this.left + (this.across * (t - this.view.from)) / (this.view.to - this.view.from); }
  y(v) { return this.bottom - ((this.bottom - this.top) * (v - this.low)) / (this.high - this.low); }

  // What of a curve is in view: from the point before to the point after.
  range({ x, y }) {
    return [Math.max(0, find(x, this.view.from) - 1), Math.min(y.length, find(x, this.view.to) + 1)];
  }

  // The range of the vertical axis; false if nothing can be seen.
  scale() {
    if (!this.svg.clientWidth) return false;
    let [low, high] = [Infinity, -Infinity];
    for (const curve of this.data.curves.filter((c) => !c.hidden)) {
      const [first, last] = this.range(curve);
      for (let k = first; k < last; k++) {
        const v = curve.y[k];
        if (v < low && v > -Infinity) low = v;
        if (v > high && v < Infinity) high = v;
      }
    }
    if (!(low <= high)) [low, high] = [0, 0];
    const margin = Math.max(0.06 * (high - low), 1e-3 * Math.max(Math.abs(low), Math.abs(high))) || 1;
    Object.assign(this, { low: low - margin, high: high + margin, top: 8, bottom: this.height - 36 });
    [this.values, this.decimals] = ticks(this.low, this.high, 5);
    this.labels = this.values.map((v) => onAxis(v, this.decimals));
    this.wide = Math.max(3, ...this.labels.map((label) => label.length));
    return true;
  }

  draw() {
    this.left = this.view.left;
    this.across = this.svg.clientWidth - this.left - 18;
    const right = this.left + this.across;
    put(this.clip, { x: this.left, y: this.top - 2, width: this.across, height: this.bottom - this.top + 4 });
    this.axes.replaceChildren();
    this.values.forEach((v, k) => {
      make(this.axes, "path", { class: "grid", d: `M${this.left} ${this.y(v)}H${right}` });
      make(this.axes, "text", { x: this.left - 7, y: this.y(v) + 4, "text-anchor": "end" }, this.labels[k]);
    });
    const most = Math.max(3, this.across / 70);
    const [times, texts] = this.data.log ? decades(this.view.from, this.view.to, most) : ticks(this.view.from, this.view.to, most);
    times.forEach((t, k) => {
      make(this.axes, "path", { class: "grid", d: `M${this.x(t)} ${this.top}V${this.bottom}` });
      make(this.axes, "text", { x: this.x(t), y: this.bottom + 16, "text-anchor": "middle" }, this.data.log ? texts[k] : onAxis(t, texts));
    });
    make(this.axes, "text", { x: (this.left + right) / 2, y: this.height - 4, "text-anchor": "middle" }, this.data.label);
    for (const curve of this.data.curves) {
      curve.path.setAttribute("d", curve.hidden ? "" : this.line(curve));
      if (curve.lost) curve.end.setAttribute("d", curve.hidden ? "" : this.mark(curve));
    }
    this.point();
  }

  // Every point, or where there are many the lowest and the highest of each pixel.
  line(curve) {
    const { x, y } = curve, [first, last] = this.range(curve);
    let d = "", pen = "M";
    const add = (k) => { d += `${pen}${this.x(x[k]).toFixed(2)} ${this.y(y[k]).toFixed(2)}`; pen = "L"; };
    if (last - first < 4 * this.across) {
      for (let k = first; k < last; k++) if (Number.isFinite(y[k])) add(k); else pen = "M";
      return d;
    }
    for (let k = first; k < last;) {
      const pixel = Math.floor(this.x(x[k]));
      let low = -1, high = -1, gap = false;
      for (; k < last && Math.floor(this.x(x[k])) === pixel; k++) {
        if (!Number.isFinite(y[k])) { gap = true; continue; }
        if (low < 0 || y[k] < y[low]) low = k;
        if (high < 0 || y[k] > y[high]) high = k;
      }
      if (low >= 0) {
        add(Math.min(low, high));
        if (low !== high) add(Math.max(low, high));
      }
      if (gap) pen = "M";
    }
    return d;
  }

  // A cross where the drive is lost.
  mark({ x, y }) {
    const k = y.length - 1, at = this.x(x[k]);
    if (k < 0 || at < this.left - 1 || at > this.left + this.across + 1) return "";
    return `M${at - 5} ${this.y(y[k]) - 5}l10 10m0 -10l-10 10`;
  }

  point() {
    const { at, from, to } = this.view, visible = at !== null && at >= from && at <= to && this.left;
    this.cursor.setAttribute("visibility", visible ? "visible" : "hidden");
    if (visible) this.cursor.setAttribute("d", `M${this.x(at)} ${this.top}V${this.bottom}`);
  }
}
Panel.count = 0;

// The value of a curve at the point nearest to t.
function near({ x, y }, t) {
  let k = find(x, t);
  if (k > 0 && (k === x.length || t - x[k - 1] < x[k] - t)) k--;
  return k < y.length ? y[k] : NaN;
}

// Names that hide their curves and tell the values at the cursor; `groups` are the curves of each name.
function legend(parent, groups, view, redraw) {
  const list = make(parent, "div", { class: groups.length > 8 ? "legend many" : "legend", role: "group", "aria-label": "Curves" });
  return groups.map((curves) => {
    const [{ name, ink, dashed, opacity, lost }] = curves;
    const button = make(list, "button", { type: "button", "aria-pressed": "true", title: "Show or hide" });
    const dash = make(button, "svg", { "aria-hidden": "true" });
    make(dash, "path", { d: "M0 5H20", stroke: ink, "stroke-width": 3, "stroke-opacity": opacity, "stroke-dasharray": dashed ? "5 3" : "none" });
    button.append(name + (lost ? ` \u2715 lost at ${shown(lost)} s` : ""));
    // Room for the values, so that nothing moves when they come.
    const value = make(button, "output", { style: `width:${9 * curves.length}ch` });
    button.addEventListener("click", () => {
      const hidden = !curves[0].hidden;
      for (const curve of curves) curve.hidden = hidden;
      button.setAttribute("aria-pressed", String(!hidden));
      redraw();
    });
    return () => { value.textContent = view.at === null ? "" : curves.map((curve) => shown(near(curve, view.at))).join(" \u00b7 "); };
  });
}

async function show(place) {
  const data = JSON.parse(place.querySelector("script").textContent);
  const arrays = await unpack(data.values, data.lengths);
  const axes = data.axes.map(([high, low]) => Float64Array.from(arrays[high], (x, k) => x + arrays[low][k]));
  const views = new Map();
  const view = (from, to) => views.get(`${from},${to}`) ?? views.set(`${from},${to}`, new View(from, to)).get(`${from},${to}`);
  const bar = make(place, "div", { class: "bar" });
  const reset = make(bar, "button", { type: "button", disabled: "" }, "Show all");
  const at = make(bar, "output");
  for (const panel of data.panels) {
    for (const curve of panel.curves) {
      curve.x = axes[curve.x];
      curve.y = arrays[curve.y];
      if (curve.lost) curve.lost = curve.x[curve.y.length - 1];
    }
    panel.label = data.label;
  }
  // Where all panels have the same names, one legend is for all.
  const names = data.panels.map((panel) => panel.curves.map((curve) => curve.name).join("\n"));
  const first = view(...data.panels[0].window);
  const together = names.length > 1 && names.every((name) => name === names[0]);
  const readings = [];
  const of = (panel) => view(...panel.window);
  const redraw = () => views.forEach((each) => each.draw());
  if (together) {
    const group = (_, k) => data.panels.map((panel) => panel.curves[k]);
    readings.push(...legend(place, data.panels[0].curves.map(group), first, redraw));
  }
  const panels = make(place, "div", { class: "panels", style: `--columns:${data.columns}` });
  for (const panel of data.panels) {
    const box = make(panels, "div", { class: "panel" });
    const title = panel.title && panel.unit ? `${panel.title} [${panel.unit}]` : panel.title || panel.unit;
    make(box, "h3", {}, title);
    if (!together) readings.push(...legend(box, panel.curves.map((curve) => [curve]), of(panel), redraw));
    panel.drawn = new Panel(box, panel, of(panel), `${title}: ${panel.curves.map((curve) => curve.name).join(", ")}`);
  }
  const changed = () => {
    const pointed = [...views.values()].find((each) => each.at !== null);
    const [quantity, unit] = data.label.split(" in ");
    const value = () => shown(pointed.panels[0].data.log ? 10 ** pointed.at : pointed.at);
    at.textContent = pointed ? `${quantity === "time" ? "t" : quantity} = ${value()} ${unit ?? ""}` : "";
    reset.disabled = ![...views.values()].some((each) => each.zoomed);
    readings.forEach((read) => read());
  };
  views.forEach((each) => { each.changed = changed; });
  reset.addEventListener("click", () => views.forEach((each) => each.zoom(...each.full)));
  redraw();
}

const help = "Drag to zoom, double click to show all; a name hides its curve. Keys: + \u2212 zoom, \u2190 \u2192 read values, with Shift move, Esc show all.";
document.querySelectorAll(".figure").forEach((place, k) => {
  if (k === 0) make(place, "p", { class: "notes" }, help);
  show(place).catch((error) => make(place, "p", {}, `This browser cannot draw the plot: ${error.message}`));
});
