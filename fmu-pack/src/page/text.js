"use strict";
// Values as text, in the address of a page and in its CSV file (RFC 4180, as `fmu_import::csv` writes and reads it).

// A value of a variable: an enumeration has names.
const textOf = (v, x) => String((v.kind === "Enumeration" && model.enumerations[v.type].find(([value]) => value === x)?.[1]) || x);

// The value of a text, in the unit of the variable or in the one that the page shows; undefined if it is none.
function valueOf(v, text) {
  if (v.kind === "String") return text;
  if (v.kind === "Boolean") return { true: true, false: false }[text];
  if (v.kind === "Enumeration") return model.enumerations[v.type].find(([value, name]) => name === text || String(value) === text)?.[0];
  const [, number, unit] = /^([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(.*)$/.exec(text) ?? [];
  const x = Number(number);
  if (!Number.isFinite(x) || (!v.kind.startsWith("Float") && !Number.isInteger(x))) return undefined;
  if (unit === "" || unit === v.unit) return x;
  return v.display?.[0] === unit ? (x - v.display[2]) / v.display[1] : undefined;
}

// A cell: numbers with all digits, other texts in quotation marks where needed.
function cell(x) {
  if (typeof x === "number") {
    if (!Number.isFinite(x)) return Number.isNaN(x) ? "NaN" : x > 0 ? "inf" : "-inf";
    return Object.is(x, -0) ? "-0" : String(x);
  }
  return /[",\r\n]/.test(x) ? `"${x.replace(/"/g, '""')}"` : x;
}
const line = (cells) => `${cells.map(cell).join(",")}\n`;
const heading = ({ name, unit }) => (unit ? `${name} [${unit}]` : name);
