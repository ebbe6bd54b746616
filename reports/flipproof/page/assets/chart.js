// Line charts in SVG, drawn at the width they have, so that text keeps its size; and numbers out of base64.
window.flipproofChart ??= (() => {
  "use strict";
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const DASHES = {
    "published-python": "9 3", "eq8": "9 3 2 3", "free-flight": "", "pymunk": "2 3", "published-limit": "4 2", "exact-step": "12 2 1 2",
    rods: "5 5", column: "14 4",
  };
  const OTHER_DASHES = ["5 5", "", "9 3", "2 3"], TINTS = 8;
  const MARGIN = { left: 46, right: 10, top: 22, bottom: 36 };

  function bytes(text) {
    return Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  }

  // The arrays of the page are little-endian, as is every machine that browsers run on.
  function numbers(text, Kind) {
    return new Kind(bytes(text).buffer);
  }

  function element(name, attributes, parent) {
    const made = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (parent) parent.append(made);
    return made;
  }

  // Parts of a text, in turn as it is and an index of what stands before it, as CM in r_CM.
  const parts = (text) => text.split(/(?<=[A-Za-zθω])_(CM|M|w|b|f|max)(?!\w)/);

  function words(text, attributes, parent) {
    const made = element("text", attributes, parent);
    parts(text).forEach((part, k, all) => {
      if (all.length === 1) made.textContent = part;
      else element("tspan", k % 2 ? { dy: 3, "font-size": "80%" } : { dy: k ? -3 : 0 }, made).textContent = part;
    });
    return made;
  }

  // The same for a button or a paragraph.
  function indexed(text) {
    return parts(text).map((part, k) => {
      if (k % 2 === 0) return part;
      const made = document.createElement("sub");
      made.textContent = part;
      return made;
    });
  }

  // Returns a step of 1, 2 or 5 times a power of ten that divides a range into about `count` parts.
  function niceStep(range, count) {
    const rough = range / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * 0.999);
  }

  function ticks(low, high, count) {
    // A range of round-off alone has no ticks between its ends that a double could tell apart.
    const step = niceStep(Math.max(high - low, 1e-9 * Math.max(Math.abs(low), Math.abs(high)), 1e-300), count);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return { found, digits: Math.min(20, Math.max(0, -Math.floor(Math.log10(step) + 1e-9))) };
  }

  function shown(value, digits) {
    return value.toFixed(digits).replace(/^-0(\.0*)?$/, "0$1").replace("-", "−");
  }

  // A line is a solver's, or the one of a number `tint`; colours repeat with another dash.
  function colour({ name, tint }) {
    return name in DASHES || tint === undefined ? `var(--solver-${name}, var(--solver-other))` : `var(--line-${tint % TINTS})`;
  }

  function dash({ name, tint }) {
    return DASHES[name] ?? OTHER_DASHES[tint === undefined ? 0 : 1 + (Math.floor(tint / TINTS) % 3)];
  }

  const SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹";
  function power(exponent) {
    return `10${exponent < 0 ? "⁻" : ""}${[...String(Math.abs(exponent))].map((digit) => SUPERSCRIPTS[digit]).join("")}`;
  }

  // Marks of an axis as {at, words}: those of a logarithmic one stand at the powers of ten.
  function marks({ low, high, log }, count) {
    if (!log) {
      const { found, digits } = ticks(low, high, count);
      return found.map((at) => ({ at, words: shown(at, digits) }));
    }
    const found = [];
    for (let k = Math.ceil(Math.log10(low) - 1e-9); k <= Math.log10(high) + 1e-9; k++) found.push({ at: 10 ** k, words: power(k) });
    return found;
  }

  // Writes the labels of lines beside their ends, none over another.
  function labelEnds(svg, lines, x, y, top, bottom, last) {
    const ends = lines.filter((line) => line.label && line.y.length).map((line) => ({ line, at: y(line.y[Math.min(last(line), line.y.length - 1)]) }));
    for (const end of ends) end.at = Math.max(top, Math.min(bottom, Number.isFinite(end.at) ? end.at : bottom));
    ends.sort((a, b) => a.at - b.at);
    ends.forEach((end, k) => { if (k) end.at = Math.max(end.at, ends[k - 1].at + 15); });
    const over = Math.max(0, (ends.at(-1)?.at ?? 0) - bottom);
    for (const { line, at } of ends) {
      words(line.label, { class: "chart-label", x: x + 6, y: at - over + 4, style: `fill: ${colour(line)}` }, svg);
    }
  }

  // Draws {x: {low, high, label}, y: {low, high, label, log}, right, lines: [{name, x, y, label, faint}]}; returns both
  // scales. What lies outside of the axes is cut off. Axes that come again, and the path of a line that comes again with them, are kept.
  const paths = new WeakMap(), drawnAxes = new WeakMap();
  function draw(svg, height, plot) {
    const right = plot.right ?? MARGIN.right;
    const width = Math.max(240, Math.round(svg.clientWidth || svg.parentElement.clientWidth));
    const inner = { width: width - MARGIN.left - right, height: height - MARGIN.top - MARGIN.bottom };
    const bottom = MARGIN.top + inner.height, scale = plot.y.log ? Math.log10 : (value) => value;
    const x = (value) => MARGIN.left + ((value - plot.x.low) / (plot.x.high - plot.x.low)) * inner.width;
    const y = (value) => MARGIN.top + (1 - (scale(value) - scale(plot.y.low)) / (scale(plot.y.high) - scale(plot.y.low))) * inner.height;

    const axes = [width, height, right, ...[plot.x, plot.y].flatMap((axis) => [axis.low, axis.high, axis.log, axis.label])].join(" ");
    if (drawnAxes.get(svg) === axes) while (svg.lastChild !== svg.firstChild) svg.lastChild.remove();
    else {
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("height", height);
      svg.replaceChildren();
      const frame = element("g", {}, svg);
      for (const { at, words: text } of marks(plot.y, Math.max(3, Math.floor(inner.height / 24)))) {
        element("path", { class: "chart-grid", d: `M${MARGIN.left} ${y(at)}h${inner.width}` }, frame);
        words(text, { x: MARGIN.left - 6, y: y(at) + 4, "text-anchor": "end" }, frame);
      }
      for (const { at, words: text } of marks(plot.x, Math.max(3, Math.floor(inner.width / 70)))) {
        element("path", { class: "chart-axis", d: `M${x(at)} ${bottom}v4` }, frame);
        words(text, { x: x(at), y: bottom + 16, "text-anchor": "middle" }, frame);
      }
      element("path", { class: "chart-axis", d: `M${MARGIN.left} ${bottom}h${inner.width}` }, frame);
      words(plot.y.label, { x: 2, y: 12 }, frame);
      words(plot.x.label, { x: MARGIN.left + inner.width, y: height - 4, "text-anchor": "end" }, frame);
      drawnAxes.set(svg, axes);
    }

    const place = { x: MARGIN.left, y: MARGIN.top - 2, width: inner.width, height: inner.height + 4 };
    const window = element("svg", { ...place, viewBox: Object.values(place).join(" ") }, svg);
    // One point beyond each end of the axis, so that lines reach it.
    const first = (line) => Math.max(0, line.x.findIndex((value) => value >= plot.x.low) - 1);
    const last = (line) => {
      const beyond = line.x.findIndex((value) => value >= plot.x.high);
      return beyond < 0 ? line.x.length - 1 : beyond;
    };
    const tenth = (pixels) => Math.round(10 * pixels) / 10;
    for (const line of plot.lines) {
      let path = "";
      if (paths.get(line)?.axes === axes) ({ path } = paths.get(line));
      else {
        for (let k = first(line), end = Math.min(last(line), line.y.length - 1); k <= end; k++) {
          if (Number.isFinite(line.y[k])) path += `${path ? "L" : "M"}${tenth(x(line.x[k]))} ${tenth(y(line.y[k]))}`;
        }
        paths.set(line, { axes, path });
      }
      element("path", {
        class: line.faint ? "chart-line chart-faint" : "chart-line", d: path, "data-line": line.name, "stroke-dasharray": dash(line),
        style: `stroke: ${colour(line)}`,
      }, window);
    }
    labelEnds(svg, plot.lines, MARGIN.left + inner.width, y, MARGIN.top, bottom, last);
    return { x, y, top: MARGIN.top, bottom, left: MARGIN.left, right: MARGIN.left + inner.width };
  }

  // A sample of a line, for legends.
  function sample(line) {
    const svg = element("svg", { width: 34, height: 10, viewBox: "0 0 34 10", "aria-hidden": "true", class: "chart-sample" });
    element("path", {
      d: "M1 5h32", "stroke-width": 2.4, fill: "none", "stroke-dasharray": dash(line),
      style: `stroke: ${colour(line)}`,
    }, svg);
    return svg;
  }

  // Calls `redraw` when the width of `node` changes, not more than once a frame.
  function onWidth(node, redraw) {
    let last = 0;
    new ResizeObserver(() => {
      const width = Math.round(node.clientWidth);
      if (width === last || width === 0) return;
      last = width;
      requestAnimationFrame(redraw);
    }).observe(node);
  }

  return { numbers, bytes, element, words, indexed, draw, sample, shown, colour, onWidth };
})();
