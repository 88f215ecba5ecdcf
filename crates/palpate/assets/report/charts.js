// Charts that can be zoomed and read off, in place of the drawings that the page brings along. uPlot draws them.
"use strict";

palpate.charts = (() => {
  const live = [];

  // Series have x of their own; uPlot wants one x for all. Where a series has no point nothing is drawn (undefined), where it has none
  // by measurement there is a gap (null).
  const table = (series) => {
    const gap = (y) => Array.from(y, (v) => (Number.isFinite(v) ? v : null));
    const tables = series.map((s) => [Array.from(palpate.floats(s.x)), gap(palpate.floats(s.y))]);
    // Points of one x, as two readings at one place, would be lost in a common table: they are moved apart by what nobody sees.
    const span = Math.max(...tables.flatMap((t) => t[0])) - Math.min(...tables.flatMap((t) => t[0])) || 1;
    for (const t of tables) {
      const order = t[0].map((_, k) => k).sort((a, b) => t[0][a] - t[0][b]);
      t[1] = order.map((k) => t[1][k]);
      t[0] = order.map((k) => t[0][k]);
      for (let k = 1; k < t[0].length; k += 1) if (t[0][k] <= t[0][k - 1]) t[0][k] = t[0][k - 1] + span * 1e-7;
    }
    return uPlot.join(tables, tables.map(() => [1, 2]));
  };

  const styled = (s, wide) => {
    const colour = palpate.ink(s.role);
    const base = { label: s.label || " ", stroke: colour, width: s.role === "search" ? 1.2 : 2, points: { show: false }, value: (_, v) => palpate.number(v) };
    if (s.style === "dashed") return { ...base, dash: [7, 5] };
    if (s.style === "dots") {
      return { ...base, width: 0, paths: () => null, points: { show: true, size: palpate.floats(s.x).length < 30 ? 9 : wide ? 5 : 6, stroke: colour, fill: colour } };
    }
    if (s.style === "columns") return { ...base, width: 1, fill: colour + "66", paths: uPlot.paths.bars({ size: [1, 100] }) };
    // A single point makes no line.
    if (palpate.floats(s.x).length < 2) return { ...base, points: { show: true, size: 7, fill: colour } };
    return base;
  };

  const axis = (label, size) => ({
    label,
    size,
    labelSize: 22,
    stroke: palpate.ink("ink"),
    grid: { stroke: palpate.ink("line"), width: 1 },
    ticks: { stroke: palpate.ink("line"), width: 1, size: 5 },
    font: "13px system-ui, sans-serif",
    labelFont: "13px system-ui, sans-serif",
    values: (_, all) => all.map(palpate.number),
    // Every tick that is drawn has its number, also on a logarithmic axis.
    filter: (_, all) => all,
  });

  const options = (chart, width, height) => {
    // Nothing happens between two iterations.
    const whole = chart.x === "iteration";
    const splits = (count, logarithmic, only) => (u, _, lo, hi) => (lo < hi ? palpate.ticks(lo, hi, count, logarithmic) : [lo]).filter((v) => !only || Number.isInteger(Number(v.toFixed(6))));
    const columns = chart.series.some((s) => s.style === "columns");
    // What is drawn does not touch the frame, and columns stand on it.
    const range = (_, lo, hi) => {
      if (chart.logarithmic) {
        const pad = hi > lo ? Math.pow(hi / lo, 0.06) : 1.5;
        return [lo / pad, hi * pad];
      }
      const pad = hi > lo ? 0.06 * (hi - lo) : 0.5 * Math.abs(hi) || 1e-3;
      return [columns ? Math.min(0, lo) : lo - pad, hi + pad];
    };
    const across = (_, lo, hi) => (hi > lo ? [lo - 0.02 * (hi - lo), hi + 0.02 * (hi - lo)] : [lo - 0.5 * Math.abs(lo || 1), hi + 0.5 * Math.abs(hi || 1)]);
    return {
      width,
      height,
      scales: { x: { time: false, range: across }, y: { distr: chart.logarithmic ? 3 : 1, range } },
      axes: [
        { ...axis(chart.x, 40), splits: splits(Math.max(3, Math.round(width / 110)), false, whole) },
        { ...axis(chart.y, 72), splits: splits(6, chart.logarithmic, false) },
      ],
      series: [{ label: chart.x, value: (_, v) => palpate.number(v) }, ...chart.series.map((s) => styled(s, chart.series.length > 2 || palpate.floats(s.x).length > 150))],
      cursor: { drag: { x: true, y: true, uni: 20 } },
      // The legend stands below the chart, never over its curves.
      legend: { live: true },
      padding: [10, 16, 0, 0],
    };
  };

  const draw = (entry) => {
    if (entry.plot) entry.plot.destroy();
    const width = Math.max(280, entry.place.clientWidth);
    entry.plot = new uPlot(options(entry.chart, width, Math.round(Math.min(320, 0.6 * width))), table(entry.chart.series), entry.place);
    // Series without a label share that of another.
    entry.plot.root.querySelectorAll(".u-series").forEach((row, k) => {
      if (k > 0 && !entry.chart.series[k - 1].label) row.hidden = true;
    });
  };

  // Puts a chart into a place; it follows the width of the page and the theme.
  const mount = (place, chart) => {
    place.setAttribute("role", "img");
    place.setAttribute("aria-label", chart.words);
    const entry = { place, chart, plot: null };
    draw(entry);
    new ResizeObserver(() => {
      const width = Math.max(280, place.clientWidth);
      if (entry.plot && Math.abs(entry.plot.width - width) > 2) entry.plot.setSize({ width, height: Math.round(Math.min(320, 0.6 * width)) });
    }).observe(place);
    live.push(entry);
    return entry;
  };

  // All curves of a scene, by name: most of them are only for who looks for them.
  const explorer = (details, all) => {
    const names = [...new Set(all.map((c) => c.subject))];
    const select = palpate.element("select", { "aria-label": "Which curve" }, ...names.map((n) => palpate.element("option", { value: n }, n)));
    const place = palpate.element("div", { class: "curves" });
    const show = () => {
      for (let k = live.length - 1; k >= 0; k -= 1) {
        if (place.contains(live[k].place)) {
          live[k].plot.destroy();
          live.splice(k, 1);
        }
      }
      place.replaceChildren();
      for (const c of all.filter((c) => c.subject === select.value)) {
        const div = palpate.element("div", { class: "live" });
        place.append(div);
        mount(div, c);
      }
    };
    select.addEventListener("change", show);
    details.append(palpate.element("p", {}, "Marker or point: ", select), place);
    // Drawn when they are looked for: of twenty markers there are sixty curves.
    details.addEventListener("toggle", () => details.open && !place.hasChildNodes() && show());
    details.hidden = false;
  };

  return { mount, explorer, redraw: () => live.forEach(draw), live };
})();
