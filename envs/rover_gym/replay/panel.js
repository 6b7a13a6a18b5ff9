// Curves beside viser's scene. The clock is the player's own: the value that its slider tells screen readers.
"use strict";
(() => {
  const data = JSON.parse(document.getElementById("curves").textContent);
  const panel = document.getElementById("panel");
  const end = data.time.at(-1) || 1;
  const box = { width: 330, height: 190, left: 42, right: 6, top: 6, bottom: 30 };

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

  const x = (time) => box.left + (time / end) * (box.width - box.left - box.right);

  const draw = (chart) => {
    const { series } = chart;
    const known = chart.values.flat().filter((value) => value !== null);
    let low = known.reduce((a, b) => Math.min(a, b), 0);
    let high = known.reduce((a, b) => Math.max(a, b), 0);
    if (high - low < 1e-9) high = low + 1;
    // One impact must not flatten all the rest: the axis then covers the bulk, and the peak is told in words.
    const peak = high;
    const sorted = Float64Array.from(known).sort();
    const share = Math.max(0.5, Math.min(0.95, 1 - (1.5 * chart.window) / end)); // of the values that no impact touches
    const bulk = sorted[Math.floor(share * (sorted.length - 1))] ?? 0;
    if (bulk > 0 && high > 4 * bulk) high = 1.5 * bulk;
    const y = (value) => box.top + ((high - Math.min(value, high)) / (high - low)) * (box.height - box.top - box.bottom);

    add(panel, "h2", {}, `${chart.title} (${chart.unit})`);
    const svg = add(panel, "svg", { viewBox: `0 0 ${box.width} ${box.height}` });
    for (const value of ticks(low, high)) {
      add(svg, "line", { class: "grid", x1: box.left, x2: box.width - box.right, y1: y(value), y2: y(value) });
      add(svg, "text", { x: box.left - 4, y: y(value) + 3, "text-anchor": "end" }, short(value));
    }
    for (const time of ticks(0, end)) {
      add(svg, "line", { class: "grid", x1: x(time), x2: x(time), y1: box.top, y2: box.height - box.bottom });
      add(svg, "text", { x: x(time), y: box.height - box.bottom + 12, "text-anchor": "middle" }, short(time));
    }
    add(svg, "text", { x: box.width / 2, y: box.height - 4, "text-anchor": "middle" }, "time (s)");
    chart.values.forEach((values, wheel) => {
      let pen = "M";
      const points = values.map((value, i) => {
        const point = value === null ? "" : `${pen}${x(data.time[i]).toFixed(1)} ${y(value).toFixed(1)}`;
        pen = value === null ? "M" : "L";
        return point;
      });
      add(svg, "path", { class: "curve", stroke: series[wheel].colour, d: points.join("") });
    });
    if (peak > high) {
      const place = { class: "peak", x: box.width - box.right - 2, y: box.top + 10, "text-anchor": "end" };
      add(svg, "text", place, `cut off, peak ${Number(peak.toPrecision(3))} ${chart.unit}`);
    }
    const cursor = add(svg, "line", { class: "cursor", y1: box.top, y2: box.height - box.bottom });
    const legend = add(panel, "div", { class: "legend" });
    const readings = series.map(({ name, colour }) => {
      const entry = add(legend, "span");
      add(entry, "i", { style: `background: ${colour}` });
      add(entry, "span", {}, `${name} `);
      return add(entry, "span");
    });
    svg.addEventListener("click", (event) => {
      const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse()).x;
      seek(Math.min(end, Math.max(0, ((at - x(0)) / (x(end) - x(0))) * end)));
    });
    return (time, row) => {
      cursor.setAttribute("x1", x(time));
      cursor.setAttribute("x2", x(time));
      readings.forEach((node, wheel) => {
        const value = chart.values[wheel][row];
        node.textContent = value === null ? "-" : value.toFixed(Math.abs(value) < 100 ? 1 : 0);
      });
    };
  };

  // The player takes a time that is typed into its field.
  const seek = (time) => {
    const field = document.querySelector("#root input");
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(field, time.toFixed(3));
    field.dispatchEvent(new Event("input", { bubbles: true }));
  };

  add(panel, "h1", {}, data.title);
  for (const fact of data.facts) add(panel, "p", { class: "fact" }, fact);
  add(panel, "p", {}, "Drag to orbit, right button to pan, scroll to zoom, space to pause; click a curve to go there.");
  const clock = add(panel, "p");
  const updates = data.charts.map(draw);
  let shown = null;
  const follow = () => {
    const slider = document.querySelector("#root [role=slider]");
    const time = slider === null ? 0 : Math.min(end, Number(slider.getAttribute("aria-valuenow")));
    if (time !== shown) {
      shown = time;
      const after = data.time.findIndex((sample) => sample > time + 1e-4);
      const row = after < 0 ? data.time.length - 1 : Math.max(0, after - 1);
      updates.forEach((update) => update(time, row));
      clock.textContent = `${time.toFixed(2)} s of ${end.toFixed(2)} s`;
    }
    requestAnimationFrame(follow);
  };
  follow();
})();
