"use strict";
// Values at the cursor: each loss bilinear in speed and share of the greatest torque, and from them power and efficiency.
{
  const data = JSON.parse(document.getElementById("map").textContent);
  const figures = [...document.querySelectorAll("figure.map")];
  const readings = document.querySelector(".readings"), body = readings.querySelector("tbody");
  const RPM = 30 / Math.PI, minus = (text) => text.replace(/-/g, "\u2212");
  const shown = (x) => minus(String(Number(x.toPrecision(4))));

  // The interval of an axis in which x lies, and the share of it below x.
  function cell(axis, x) {
    if (!(x >= axis[0] && x <= axis[axis.length - 1])) return null;
    let k = 1;
    while (k < axis.length - 1 && axis[k] < x) k++;
    return [k - 1, (x - axis[k - 1]) / (axis[k] - axis[k - 1])];
  }

  // Losses, limits and powers at a speed in rad/s and a torque in N.m; null out of reach.
  function read(sheet, speed, tau) {
    const row = cell(data.speed, speed);
    if (!row) return null;
    const [k, b] = row, side = tau < 0 ? 0 : 1, width = data.x.length;
    const limit = (1 - b) * sheet.limits[k][side] + b * sheet.limits[k + 1][side];
    const column = limit ? cell(data.x, (tau < 0 ? -1 : 1) * tau / limit) : null;
    if (!column) return null;
    const [j, a] = column;
    const corners = [[k, j], [k, j + 1], [k + 1, j], [k + 1, j + 1]].map(([m, n]) => sheet.losses[m * width + n]);
    if (corners.includes(null)) return null;
    const weights = [(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b];
    const losses = [0, 1, 2, 3, 4].map((n) => corners.reduce((sum, corner, m) => sum + weights[m] * corner[n], 0));
    const mechanical = tau * speed, electric = mechanical + losses.reduce((sum, x) => sum + x, 0);
    const efficiency = mechanical > 0 ? mechanical / electric : electric < 0 ? electric / mechanical : 0;
    return { losses, mechanical, electric, efficiency };
  }

  const names = ["speed", "torque", "efficiency", "p_in", "p_mech", "p_cu", "p_iron", "p_cond", "p_sw", "p_friction"];
  const units = ["rpm", "N.m", "%", "W", "W", "W", "W", "W", "W", "W"];
  const cells = names.map((name) => {
    const row = body.insertRow();
    const head = document.createElement("th");
    head.textContent = name;
    row.append(head);
    const value = row.insertCell();
    row.insertCell();
    return value;
  });

  figures.forEach((figure) => {
    const svg = figure.querySelector("svg"), sheet = data.sheets[figure.dataset.sheet];
    const [left, top, right, bottom] = svg.dataset.area.split(" ").map(Number);
    const [from, to, low, high] = svg.dataset.window.split(" ").map(Number);
    svg.setAttribute("tabindex", "0");
    const rings = ["reading", "reading inner"].map((name) => {
      const ring = document.createElementNS("http://www.w3.org/2000/svg", "circle");
      ring.setAttribute("class", name);
      ring.setAttribute("r", 5);
      ring.setAttribute("visibility", "hidden");
      return svg.appendChild(ring);
    });
    let at = [0.5 * (left + right), top + 0.3 * (bottom - top)];
    const show = () => {
      const rpm = from + (at[0] - left) / (right - left) * (to - from);
      const tau = low + (bottom - at[1]) / (bottom - top) * (high - low);
      const found = read(sheet, rpm / RPM, tau);
      const texts = [minus(rpm.toFixed(0)), shown(tau)];
      if (found) {
        const { losses, mechanical, electric, efficiency } = found;
        texts.push((100 * efficiency).toFixed(2), ...[electric, mechanical, ...losses].map(shown));
      } else texts.push("out of reach");
      cells.forEach((cell, k) => {
        cell.textContent = texts[k] ?? "\u2013";
        cell.nextSibling.textContent = found || k < 2 ? units[k] : "";
      });
      readings.hidden = false;
      rings.forEach((ring) => {
        ring.setAttribute("cx", at[0]);
        ring.setAttribute("cy", at[1]);
        ring.setAttribute("visibility", "visible");
      });
    };
    const clamp = (x, y) => [Math.min(right, Math.max(left, x)), Math.min(bottom, Math.max(top, y))];
    const point = (event) => {
      const place = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
      at = clamp(place.x, place.y);
      show();
    };
    svg.addEventListener("pointermove", point);
    svg.addEventListener("pointerdown", point);
    svg.addEventListener("focus", show);
    svg.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault();
      const by = event.shiftKey ? 20 : 4;
      at = clamp(at[0] + by * step[0], at[1] + by * step[1]);
      show();
    });
  });

  document.getElementById("sheet")?.addEventListener("change", (event) => {
    figures.forEach((figure) => { figure.hidden = figure.dataset.sheet !== event.target.value; });
    readings.hidden = true;
  });
}
