// Line charts in SVG, drawn at the width they have, so that text keeps its size; and numbers out of base64.
window.flipproofChart ??= (() => {
  "use strict";
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const DASHES = { "published-python": "9 3", "eq8": "9 3 2 3", "free-flight": "", "pymunk": "2 3" };
  const OTHER_DASH = "5 5";
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

  function words(text, attributes, parent) {
    const made = element("text", attributes, parent);
    made.textContent = text;
    return made;
  }

  // Returns a step of 1, 2 or 5 times a power of ten that divides a range into about `count` parts.
  function niceStep(range, count) {
    const rough = range / count;
    const power = 10 ** Math.floor(Math.log10(rough));
    return [1, 2, 5, 10].map((factor) => factor * power).find((step) => step >= rough * 0.999);
  }

  function ticks(low, high, count) {
    const step = niceStep(high - low, count);
    const found = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) found.push(k * step);
    return { found, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  }

  function shown(value, digits) {
    return value.toFixed(digits).replace(/^-0(\.0*)?$/, "0$1").replace("-", "−");
  }

  function colour(name) {
    return `var(--solver-${name}, var(--solver-other))`;
  }

  // Writes the labels of lines beside their ends, none over another.
  function labelEnds(svg, lines, x, y, bottom) {
    const ends = lines.filter((line) => line.label && line.y.length).map((line) => ({ line, at: y(line.y.at(-1)) }));
    ends.sort((a, b) => a.at - b.at);
    ends.forEach((end, k) => { if (k) end.at = Math.max(end.at, ends[k - 1].at + 15); });
    const over = Math.max(0, (ends.at(-1)?.at ?? 0) - bottom);
    for (const { line, at } of ends) {
      words(line.label, { class: "chart-label", x: x + 6, y: at - over + 4, style: `fill: ${colour(line.name)}` }, svg);
    }
  }

  // Draws {x: {low, high, label}, y: {low, high, label}, right, lines: [{name, x, y, label, faint}]}; returns both scales.
  function draw(svg, height, plot) {
    const right = plot.right ?? MARGIN.right;
    const width = Math.max(240, Math.round(svg.clientWidth || svg.parentElement.clientWidth));
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    svg.replaceChildren();
    const inner = { width: width - MARGIN.left - right, height: height - MARGIN.top - MARGIN.bottom };
    const x = (value) => MARGIN.left + ((value - plot.x.low) / (plot.x.high - plot.x.low)) * inner.width;
    const y = (value) => MARGIN.top + (1 - (value - plot.y.low) / (plot.y.high - plot.y.low)) * inner.height;
    const bottom = MARGIN.top + inner.height;

    const down = ticks(plot.y.low, plot.y.high, Math.max(3, Math.floor(inner.height / 24)));
    for (const value of down.found) {
      element("path", { class: "chart-grid", d: `M${MARGIN.left} ${y(value)}h${inner.width}` }, svg);
      words(shown(value, down.digits), { x: MARGIN.left - 6, y: y(value) + 4, "text-anchor": "end" }, svg);
    }
    const along = ticks(plot.x.low, plot.x.high, Math.max(3, Math.floor(inner.width / 70)));
    for (const value of along.found) {
      element("path", { class: "chart-axis", d: `M${x(value)} ${bottom}v4` }, svg);
      words(shown(value, along.digits), { x: x(value), y: bottom + 16, "text-anchor": "middle" }, svg);
    }
    element("path", { class: "chart-axis", d: `M${MARGIN.left} ${bottom}h${inner.width}` }, svg);
    words(plot.y.label, { x: 2, y: 12 }, svg);
    words(plot.x.label, { x: MARGIN.left + inner.width, y: height - 4, "text-anchor": "end" }, svg);

    for (const line of plot.lines) {
      let path = "";
      for (let k = 0; k < line.y.length; k++) {
        if (Number.isFinite(line.y[k])) path += `${path ? "L" : "M"}${x(line.x[k]).toFixed(1)} ${y(line.y[k]).toFixed(1)}`;
      }
      element("path", {
        class: line.faint ? "chart-line chart-faint" : "chart-line", d: path, "data-line": line.name, "stroke-dasharray": DASHES[line.name] ?? OTHER_DASH,
        style: `stroke: ${colour(line.name)}`,
      }, svg);
    }
    labelEnds(svg, plot.lines, MARGIN.left + inner.width, y, bottom);
    return { x, y, top: MARGIN.top, bottom, left: MARGIN.left, right: MARGIN.left + inner.width };
  }

  // A sample of a solver's line, for legends.
  function sample(name) {
    const svg = element("svg", { width: 34, height: 10, viewBox: "0 0 34 10", "aria-hidden": "true", class: "chart-sample" });
    element("path", {
      d: "M1 5h32", "stroke-width": 2.4, fill: "none", "stroke-dasharray": DASHES[name] ?? OTHER_DASH,
      style: `stroke: ${colour(name)}`,
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

  return { numbers, bytes, element, words, draw, sample, shown, colour, onWidth };
})();
