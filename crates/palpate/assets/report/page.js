// Puts charts and views into the places that the page keeps for them, and turns them with the theme.
"use strict";

(() => {
  const root = document.documentElement;
  for (const figure of document.querySelectorAll("figure[data-chart]")) {
    const chart = palpate.data.charts.find((c) => c.key === figure.dataset.chart);
    if (!chart) continue;
    const place = palpate.element("div", { class: "live" });
    figure.prepend(place);
    figure.classList.add("drawn");
    palpate.charts.mount(place, chart);
  }
  for (const details of document.querySelectorAll("details[data-tracks]")) {
    const scene = Number(details.dataset.tracks);
    palpate.charts.explorer(details, palpate.data.charts.filter((c) => c.topic === "track" && c.scene === scene));
  }
  for (const figure of document.querySelectorAll("figure.space")) palpate.viewer.mount(figure, Number(figure.dataset.scene));

  const redraw = () => {
    palpate.charts.redraw();
    palpate.viewer.redraw();
  };
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme ? root.dataset.theme === "dark" : dark.matches);
  const button = document.getElementById("theme");
  const name = () => (button.textContent = isDark() ? "Light" : "Dark");
  button.hidden = false;
  name();
  button.addEventListener("click", () => {
    root.dataset.theme = isDark() ? "light" : "dark";
    name();
    redraw();
  });
  dark.addEventListener("change", () => {
    name();
    redraw();
  });
  // Folded parts are open on paper.
  const folded = [];
  addEventListener("beforeprint", () => document.querySelectorAll("details:not([open]):not(.explorer)").forEach((d) => {
    folded.push(d);
    d.open = true;
  }));
  addEventListener("afterprint", () => folded.splice(0).forEach((d) => (d.open = false)));
  root.dataset.ready = "true";
})();
