// Charts to be touched: curves come and go by buttons that tell their values at a cursor; a part of the time is chosen
// by dragging, by buttons or by + and -. What stands in them is drawn by chart.js.
window.flipproofTouch = (() => {
  "use strict";
  const chart = window.flipproofChart;

  // The value of a line at x, linear between its points; NaN outside.
  function valueAt({ x, y }, at) {
    let low = 0, high = x.length - 1;
    if (!(at >= x[low] && at <= x[high])) return NaN;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (x[middle] <= at) low = middle;
      else high = middle;
    }
    return y[low] + ((y[high] - y[low]) * (at - x[low])) / (x[high] - x[low]);
  }

  // Lays a chart into `svg` and its buttons behind it. A plot is that of chart.draw, with {y: {percent}, start: cursor},
  // lines with {off: true} not shown at first, and lines `behind` that tell no values; `moved` hears where the reader
  // puts the cursor; `change` takes other numbers for the same lines.
  function touch(svg, height, plot, moved = () => {}) {
    const whole = [plot.x.low, plot.x.high], hidden = new Set(plot.lines.filter((line) => line.off).map((line) => line.name));
    let [low, high] = whole, at = plot.start ?? (whole[0] + whole[1]) / 2, scales = null, dragged = null;
    const tools = document.createElement("div");
    tools.className = "chart-tools";
    svg.after(tools);
    const button = (words, act) => {
      const made = document.createElement("button");
      made.type = "button";
      made.append(...words);
      made.addEventListener("click", act);
      tools.append(made);
      return made;
    };
    const told = new Map();
    for (const line of plot.lines) {
      const value = document.createElement("output"), name = line.words ?? line.label ?? line.name;
      value.setAttribute("aria-live", "off");
      told.set(line.name, value);
      const made = button([chart.sample(line), " ", ...chart.indexed(name), " ", value], () => {
        if (!hidden.delete(line.name)) hidden.add(line.name);
        made.setAttribute("aria-pressed", String(!hidden.has(line.name)));
        draw();
      });
      made.setAttribute("aria-pressed", String(!hidden.has(line.name)));
      made.dataset.toggle = line.name;
    }
    const nearer = button(["Zoom in"], () => zoom(0.5)), farther = button(["Zoom out"], () => zoom(2));
    const when = document.createElement("span"), said = document.createElement("p");
    when.className = "soft";
    said.className = "unseen";
    said.setAttribute("role", "status");
    tools.append(when, said);

    const text = (value) => {
      if (!Number.isFinite(value)) return "–";
      if (plot.y.percent && value < 0.11 * plot.y.low) return `< ${Number((10 * plot.y.low).toPrecision(2))} %`; // the curve's floor
      return plot.y.percent ? `${Number((100 * value).toPrecision(2))} %` : chart.shown(value, plot.y.digits ?? 3);
    };
    const seen = () => plot.lines.filter((line) => !hidden.has(line.name));

    // The vertical axis of a part of the time fits what is seen there.
    function vertical() {
      if (plot.y.log || high - low >= whole[1] - whole[0]) return plot.y;
      let [least, most] = [Infinity, -Infinity];
      for (const { x, y } of seen()) {
        for (let k = 0; k < x.length; k++) if (x[k] >= low && x[k] <= high && Number.isFinite(y[k])) [least, most] = [Math.min(least, y[k]), Math.max(most, y[k])];
      }
      const room = 0.05 * (most - least) || 0.01;
      return most >= least ? { ...plot.y, low: least - room, high: most + room } : plot.y;
    }

    function draw() {
      scales = chart.draw(svg, height, { ...plot, x: { ...plot.x, low, high }, y: vertical(), lines: [...(plot.behind ?? []), ...seen()] });
      scales.cursor = chart.element("g", {}, svg);
      chart.element("path", { class: "chart-cursor", d: `M0 ${scales.top}V${scales.bottom}` }, scales.cursor);
      for (const line of seen()) chart.element("circle", { class: "chart-dot", r: 4.5, style: `fill: ${chart.colour(line)}` }, scales.cursor);
      scales.chosen = chart.element("rect", { class: "chart-chosen", y: scales.top, height: scales.bottom - scales.top, width: 0 }, svg);
      nearer.disabled = high - low < (whole[1] - whole[0]) / 200;
      farther.disabled = high - low >= whole[1] - whole[0];
      show();
    }

    function show() {
      if (!scales) return;
      when.textContent = `Values at t = ${chart.shown(at, 3)} s. Drag across the chart, or press a button, to zoom.`;
      scales.cursor.setAttribute("visibility", at >= low && at <= high ? "visible" : "hidden");
      scales.cursor.firstChild.setAttribute("transform", `translate(${scales.x(at)} 0)`);
      for (const line of plot.lines) told.get(line.name).textContent = hidden.has(line.name) ? "" : text(valueAt(line, at));
      seen().forEach((line, k) => {
        const y = scales.y(valueAt(line, at)), dot = scales.cursor.children[k + 1], inside = y >= scales.top && y <= scales.bottom;
        dot.setAttribute("visibility", inside ? "inherit" : "hidden");
        if (inside) [["cx", scales.x(at)], ["cy", y]].forEach(([name, place]) => dot.setAttribute(name, place));
      });
    }
    function put(place, bySelf = true) {
      at = Math.max(whole[0], Math.min(whole[1], place));
      show();
      if (bySelf) moved(at);
    }
    function look(from, to) {
      const wide = Math.min(to - from, whole[1] - whole[0]);
      low = Math.max(whole[0], Math.min(whole[1] - wide, from));
      high = low + wide;
      draw();
    }
    const zoom = (factor) => look(at - (factor * (high - low)) / 2, at + (factor * (high - low)) / 2);

    const under = (event) => {
      const share = (event.clientX - svg.getBoundingClientRect().left - scales.left) / (scales.right - scales.left);
      return low + Math.max(0, Math.min(1, share)) * (high - low);
    };
    svg.addEventListener("pointerdown", (event) => {
      if (event.pointerType === "mouse" && event.button === 0) dragged = under(event);
      else put(under(event));
    });
    svg.addEventListener("pointermove", (event) => {
      if (!scales) return;
      put(under(event));
      if (dragged === null) return;
      const [from, to] = [dragged, at].sort((a, b) => a - b).map(scales.x);
      scales.chosen.setAttribute("x", from);
      scales.chosen.setAttribute("width", to - from);
    });
    window.addEventListener("pointerup", () => {
      const from = dragged;
      dragged = null;
      if (from === null || !scales) return;
      scales.chosen.setAttribute("width", 0);
      if (Math.abs(scales.x(at) - scales.x(from)) > 8) look(Math.min(from, at), Math.max(from, at));
    });
    svg.addEventListener("dblclick", () => look(...whole));
    svg.addEventListener("keydown", (event) => {
      const part = (high - low) / (event.shiftKey ? 10 : 100);
      const act = {
        ArrowLeft: () => put(at - part), ArrowRight: () => put(at + part), Home: () => put(low), End: () => put(high),
        "+": () => zoom(0.5), "-": () => zoom(2), 0: () => look(...whole),
      }[event.key];
      if (!act || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      act();
      said.textContent = `${plot.x.label} ${chart.shown(at, 4)}: ` + seen().map((line) => `${line.words ?? line.label ?? line.name} ${text(valueAt(line, at))}`).join(", ");
    });
    svg.tabIndex = 0;
    svg.classList.add("chart-touched");
    chart.onWidth(svg, draw);
    draw();
    return { put: (place) => put(place, false), change: (other) => { Object.assign(plot, other); draw(); } };
  }

  // Numbers of the page's figures: 16 bits between the least and the largest of a figure, the last of them for none.
  function numbers(text, { low, high }) {
    return Array.from(chart.numbers(text, Uint16Array), (part) => (part === 65535 ? NaN : low + ((high - low) * part) / 65534));
  }

  function figure(source) {
    const { t, label, x, y, lines, ...range } = JSON.parse(source.textContent), svg = source.parentElement.querySelector("svg");
    const times = Array.from({ length: t.count }, (_, k) => t.low + ((t.high - t.low) * k) / (t.count - 1));
    touch(svg, 360, {
      x: { low: t.low, high: t.high, label: x }, y,
      lines: lines.map((line, k) => ({ ...line, tint: k, x: times, y: numbers(line.values, range).map((value) => (y.log ? 10 ** value : value)) })),
    });
  }
  // Drawn as soon as it is unfolded.
  window.addEventListener("load", () => {
    for (const source of document.querySelectorAll(".touch > script")) {
      const fold = source.closest("details");
      const open = () => {
        if (!fold.open) return;
        fold.removeEventListener("toggle", open);
        figure(source);
      };
      fold.addEventListener("toggle", open);
      open();
    }
  });
  return { touch, valueAt };
})();
