// The data block of the page, and what all programs share: arrays, colours, round numbers.
"use strict";
const palpate = {};

palpate.data = JSON.parse(document.getElementById("report-data").textContent);

// Little-endian single precision out of base64; every browser that runs this is little-endian.
palpate.bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer;
palpate.floats = (text) => new Float32Array(palpate.bytes(text));
palpate.indices = (text) => new Uint32Array(palpate.bytes(text));

// A colour of the style sheet, which differs on light and on dark ground.
palpate.ink = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();

// Blue inside, grey on the surface, red outside: the colours of the pictures that Rust draws (render/shade.rs).
palpate.residualColour = (t) => {
  const s = Math.max(-1, Math.min(1, t));
  const end = s >= 0 ? [180, 4, 38] : [39, 66, 190];
  return end.map((c) => 205 + (c - 205) * Math.abs(s));
};

palpate.roundUp = (x) => {
  const power = Math.pow(10, Math.floor(Math.log10(x)));
  return [1, 2, 5, 10].map((f) => f * power).find((r) => r * (1 + 1e-9) >= x) || 10 * power;
};

// Round numbers from lo to hi, about so many. On a logarithmic axis powers of ten; with few of these, twice and five times them as well.
palpate.ticks = (lo, hi, count, logarithmic) => {
  const within = (v) => v >= lo * (1 - 1e-9 * Math.sign(lo)) && v <= hi * (1 + 1e-9 * Math.sign(hi));
  if (!logarithmic) {
    const step = palpate.roundUp((hi - lo) / count);
    const all = [];
    for (let k = Math.ceil(lo / step - 1e-9); k * step <= hi + 1e-9 * step; k += 1) all.push(k * step);
    return all;
  }
  const [first, last] = [Math.floor(Math.log10(lo)), Math.ceil(Math.log10(hi))];
  const every = Math.max(1, Math.ceil((Math.log10(hi) - Math.log10(lo)) / count));
  const decades = [];
  for (let d = first; d <= last; d += 1) decades.push(d);
  const whole = decades.map((d) => Math.pow(10, d)).filter(within);
  if (whole.length > 2) return decades.filter((d) => d % every === 0).map((d) => Math.pow(10, d)).filter(within);
  const more = decades.flatMap((d) => [1, 2, 5].map((f) => f * Math.pow(10, d))).filter(within);
  return more.length > 2 ? more : palpate.ticks(lo, hi, count, false).filter((v) => v > 0);
};

// A number with a few digits, without an E.
palpate.number = (v) => {
  if (v === null || v === undefined || !Number.isFinite(v)) return "–";
  if (v === 0) return "0";
  const size = Math.abs(v);
  const raise = (text) => [...text].map((c) => (c === "-" ? "⁻" : "⁰¹²³⁴⁵⁶⁷⁸⁹"[Number(c)])).join("");
  const plain = (x) => String(Number(x.toPrecision(4))).replace("-", "−");
  if (size >= 1e-3 && size < 1e6) return plain(v);
  const power = Math.floor(Math.log10(size) + 1e-12);
  return plain(v / Math.pow(10, power)) + "·10" + raise(String(power));
};

palpate.millimetres = (x) => (x === null || x === undefined || !Number.isFinite(x) ? "–" : palpate.number(Number((x * 1e3).toPrecision(3))) + " mm");

// An element with attributes and children.
palpate.element = (name, attributes = {}, ...children) => {
  const e = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (value !== null && value !== false) e.setAttribute(key, value === true ? "" : value);
  }
  e.append(...children);
  return e;
};
