// Curves beside the scene: charts that share its clock; a click on one goes to that time.
"use strict";

const BOX = { width: 330, height: 190, left: 42, right: 6, top: 6, bottom: 30 };

const add = (parent, name, attributes = {}, text = "") => {
  const inSvg = parent.namespaceURI.endsWith("svg") || name === "svg";
  const node = inSvg ? document.createElementNS("http://www.w3.org/2000/svg", name) : document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  node.textContent = text;
  return parent.appendChild(node);
};

// Round numbers, about four of them, that cover a range.
const ticks = (low, high) => {
  const rough = (high - low) / 4;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((factor) => factor * power >= rough) * power;
  const first = Math.ceil(low / step - 1e-9);
  return Array.from({ length: Math.floor(high / step + 1e-9) - first + 1 }, (_, i) => (first + i) * step);
};
const short = (value) => String(Number(value.toPrecision(6)));

class Curves {
  constructor(panel, data, seek) {
    this.data = data;
    this.seek = seek;
    this.end = data.time.at(-1) || 1;
    add(panel, "h1", {}, data.title);
    for (const fact of data.facts) add(panel, "p", { class: "fact" }, fact);
    this.clock = add(panel, "p");
    const chips = add(panel, "div", { class: "chips" });
    this.charts = data.charts.map((chart) => {
      const place = add(panel, "section");
      const chip = add(chips, "button", { type: "button" }, chart.title.split(",")[0]);
      const entry = { chart, place, chip, update: null };
      chip.addEventListener("click", () => this.toggle(entry));
      if (chart.shown) this.toggle(entry);
      return entry;
    });
  }

  // Shows a chart, or takes it away.
  toggle(entry) {
    const on = entry.update === null;
    entry.chip.classList.toggle("on", on);
    entry.place.replaceChildren();
    entry.update = on ? this.draw(entry.place, entry.chart) : null;
    this.shown = null;
  }

  // Shows a time, s.
  follow(time) {
    if (time === this.shown) return;
    this.shown = time;
    const { data } = this;
    const after = data.time.findIndex((sample) => sample > time + 1e-4);
    const row = after < 0 ? data.time.length - 1 : Math.max(0, after - 1);
    for (const { update } of this.charts) update?.(time, row);
    this.clock.textContent = `${time.toFixed(2)} s of ${this.end.toFixed(2)} s`;
  }

  x(time) {
    return BOX.left + (time / this.end) * (BOX.width - BOX.left - BOX.right);
  }

  // Draws a chart; returns what shows a time and the row of its values.
  draw(place, chart) {
    const { data, end } = this;
    const known = chart.values.flat().filter((value) => value !== null);
    let low = known.reduce((a, b) => Math.min(a, b), 0);
    let high = known.reduce((a, b) => Math.max(a, b), 0);
    if (high - low < 1e-9) high = low + 1;
    // One impact must not flatten all the rest: the axis then covers the bulk, and the peak is told in words.
    const peak = high;
    const sorted = Float64Array.from(known).sort();
    const share = Math.max(0.5, Math.min(0.95, 1 - (1.5 * chart.window) / end)); // of the values that no impact touches
    const bulk = sorted[Math.floor(share * (sorted.length - 1))] ?? 0;
    if (chart.cut && bulk > 0 && high > 4 * bulk) high = 1.5 * bulk;
    const y = (value) => BOX.top + ((high - Math.min(value, high)) / (high - low)) * (BOX.height - BOX.top - BOX.bottom);

    add(place, "h2", {}, `${chart.title} (${chart.unit})`);
    if (peak > high) add(place, "p", { class: "peak" }, `beyond the scale: peak ${Number(peak.toPrecision(3))} ${chart.unit}`);
    const svg = add(place, "svg", { viewBox: `0 0 ${BOX.width} ${BOX.height}` });
    for (const value of ticks(low, high)) {
      add(svg, "line", { class: "grid", x1: BOX.left, x2: BOX.width - BOX.right, y1: y(value), y2: y(value) });
      add(svg, "text", { x: BOX.left - 4, y: y(value) + 3, "text-anchor": "end" }, short(value));
    }
    for (const time of ticks(0, end)) {
      add(svg, "line", { class: "grid", x1: this.x(time), x2: this.x(time), y1: BOX.top, y2: BOX.height - BOX.bottom });
      add(svg, "text", { x: this.x(time), y: BOX.height - BOX.bottom + 12, "text-anchor": "middle" }, short(time));
    }
    add(svg, "text", { x: BOX.width / 2, y: BOX.height - 4, "text-anchor": "middle" }, "time (s)");
    chart.values.forEach((values, k) => add(svg, "path", { class: chart.series[k].ghost ? "curve ghost" : "curve",
      stroke: chart.series[k].colour, d: this.path(values, y) }));
    const cursor = add(svg, "line", { class: "cursor", y1: BOX.top, y2: BOX.height - BOX.bottom });
    const readings = this.legend(place, chart);
    svg.addEventListener("click", (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse()).x;
      this.seek(Math.min(end, Math.max(0, ((at - this.x(0)) / (this.x(end) - this.x(0))) * end)));
    });
    return (time, row) => {
      cursor.setAttribute("x1", this.x(time));
      cursor.setAttribute("x2", this.x(time));
      readings.forEach((node, k) => {
        const value = chart.values[k][row];
        node.textContent = value === null ? "-" : value.toFixed(Math.abs(value) < 100 ? 1 : 0);
      });
    };
  }

  path(values, y) {
    let pen = "M";
    return values.map((value, i) => {
      const point = value === null ? "" : `${pen}${this.x(this.data.time[i]).toFixed(1)} ${y(value).toFixed(1)}`;
      pen = value === null ? "M" : "L";
      return point;
    }).join("");
  }

  legend(place, chart) {
    const legend = add(place, "div", { class: "legend" });
    return chart.series.map(({ name, colour, ghost }) => {
      const entry = add(legend, "span", ghost ? { class: "ghost" } : {});
      add(entry, "i").style.background = colour;
      add(entry, "span", {}, `${name} `);
      return add(entry, "span");
    });
  }
}
