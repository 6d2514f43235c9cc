// What every axis needs: round places, numbers as texts, the place of a time in a column.

// Index of the first of x that is not below t.
function find(x, t) {
  let low = 0, high = x.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (x[middle] < t) low = middle + 1; else high = middle;
  }
  return low;
}

// Round places for the lines of an axis, and the decimals of their numbers.
function ticks(low, high, most) {
  const rough = (high - low) / most, power = 10 ** Math.floor(Math.log10(rough));
  const step = power * [1, 2, 5, 10].find((k) => k * power >= 0.999 * rough);
  const places = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step && places.length < 50; k++) places.push(k * step);
  return [places, Math.min(12, Math.max(0, -Math.floor(Math.log10(step * 1.001))))];
}

// Places of a logarithmic axis and their texts, some of them empty; between close numbers, those of a linear axis.
function decades(low, high, most) {
  const places = [], texts = [], short = high - low < 1.5;
  for (let power = Math.floor(low); power <= high; power++) {
    for (let digit = 1; digit < 10; digit++) {
      const x = power + Math.log10(digit);
      if (x < low - 1e-9 || x > high + 1e-9) continue;
      places.push(x);
      texts.push(digit === 1 || (short && (digit === 2 || digit === 5)) ? shown(digit * 10 ** power) : "");
    }
  }
  if (texts.filter((text) => text).length > 1) return [places, texts];
  const [numbers, decimals] = ticks(10 ** low, 10 ** high, most);
  return [numbers.map(Math.log10), numbers.map((x) => onAxis(x, decimals))];
}

const minus = (text) => text.replace(/-/g, "\u2212");
const onAxis = (x, decimals) => minus(Math.abs(x) >= 1e6 || (decimals > 6 && x) ? x.toExponential(2) : (x + 0).toFixed(decimals));
const shown = (x) => {
  if (!Number.isFinite(x)) return "\u2013";
  const size = Math.abs(x);
  return minus(size >= 1e6 || (size > 0 && size < 1e-4) ? x.toExponential(3) : String(Number(x.toPrecision(5))));
};
