// The map of bottles, which tells the numbers of a cell.
(() => {
  "use strict";
  const chart = window.flipproofChart;
  const find = (id) => document.querySelector(`[data-testid="${id}"]`);
  const names = { "published-python": "program", eq8: "Eq. 8", "free-flight": "free flight" };

  function map() {
    const source = document.getElementById("map-data");
    if (!source) return;
    const data = JSON.parse(source.textContent), svg = find("map-cells"), choice = find("map-solver"), said = find("map-said");
    const cells = new Map(data.cells.map((cell) => [`${data.fills.indexOf(cell.x)} ${data.dampings.indexOf(cell.y)}`, cell]));
    const at = (i, j) => cells.get(`${i} ${j}`), free = data.solvers.indexOf("free-flight");
    const off = (cell) => {
      const [one, truth] = [cell.mean[data.solvers.indexOf(choice.value)], cell.mean[free]];
      return one === null || truth === null ? NaN : Math.abs(one - truth);
    };
    // Five shades by how much, in shares of omega_0.
    const limits = [0.01, 0.03, 0.1, 0.3];
    const shade = (value) => limits.filter((limit) => value > limit).length;
    const edge = { left: 62, right: 8, top: 20, bottom: 64 };
    // The throw of the report, in cells from the first: fillings are equally spaced, drags in equal ratios.
    const thrown = [(data.thrown[0] - data.fills[0]) / (data.fills[1] - data.fills[0]), Math.log(data.thrown[1] / data.dampings[0]) / Math.log(data.dampings[1] / data.dampings[0])];
    const size = [data.fills.length, data.dampings.length];
    const shown = thrown.every((place, axis) => place >= -0.5 && place <= size[axis] - 0.5);
    let here = thrown.map((place, axis) => Math.round(Math.max(0, Math.min(size[axis] - 1, place || 0))));

    function tell(i, j) {
      here = [i, j];
      const cell = at(i, j);
      if (!cell) return;
      const value = (mean) => (mean === null ? "not computed" : `${Math.round(100 * mean)} %`);
      const means = data.solvers.map((name, k) => `${names[name]} ${value(cell.mean[k])}`).join(", ");
      const far = off(cell);
      said.textContent = `At filling ${Number(cell.x.toPrecision(3))} and γ/ω₀ = ${Number(cell.y.toPrecision(2))} the late spin, as a share of ω₀, is: ${means}. `
        + `Off free flight: ${names[choice.value]} by ${Number.isFinite(far) ? `${Number((100 * far).toPrecision(2))} %` : "an unknown part"}. Largest fair share: ${cell.which || (Number.isFinite(far) ? "none that can be told" : "unknown")}.`;
      const box = svg.querySelector(".map-here");
      box?.setAttribute("transform", svg.querySelector(`[data-cell="${i} ${j}"]`).dataset.place);
    }

    function draw() {
      const width = Math.max(280, Math.round(svg.clientWidth || svg.parentElement.clientWidth)), nx = data.fills.length, ny = data.dampings.length;
      const w = (width - edge.left - edge.right) / nx, h = Math.max(11, Math.min(20, w * 0.5)), height = edge.top + ny * h + edge.bottom;
      svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      svg.setAttribute("height", height);
      svg.replaceChildren();
      const x = (i) => edge.left + i * w, y = (j) => edge.top + (ny - 1 - j) * h;
      let borders = "";
      for (let j = 0; j < ny; j++) for (let i = 0; i < nx; i++) {
        const cell = at(i, j);
        if (!cell) continue;
        const far = off(cell), kind = Number.isFinite(far) ? `map-cell shade-${shade(far)}` : "map-cell map-unknown";
        const box = chart.element("rect", { class: kind, x: x(i), y: y(j), width: w + 0.4, height: h + 0.4, "data-cell": `${i} ${j}`, "data-off": far, "data-place": `translate(${x(i)} ${y(j)})` }, svg);
        box.addEventListener("pointerenter", () => tell(i, j));
        if (at(i + 1, j) && at(i + 1, j).which !== cell.which) borders += `M${x(i + 1)} ${y(j)}v${h}`;
        if (at(i, j + 1) && at(i, j + 1).which !== cell.which) borders += `M${x(i)} ${y(j)}h${w}`;
      }
      chart.element("path", { class: "map-border-halo", d: borders }, svg);
      chart.element("path", { class: "map-border", d: borders }, svg);
      regions(x, y, w, h);
      chart.words("drag γ/ω₀ [1], logarithmic", { x: 2, y: 12 }, svg);
      chart.words("filling M_w / M_max [1]", { x: width - edge.right, y: edge.top + ny * h + 32, "text-anchor": "end" }, svg);
      for (let fill = 0.2; fill < data.fills.at(-1) + 0.01; fill += 0.2) { // equally spaced fillings, as cells from the first
        const i = (fill - data.fills[0]) / (data.fills[1] - data.fills[0]);
        if (i >= 0) chart.words(fill.toFixed(1), { x: x(i) + w / 2, y: edge.top + ny * h + 15, "text-anchor": "middle" }, svg);
      }
      data.dampings.forEach((value, j) => { if (j % 4 === 0 || j === ny - 1) chart.words(String(Number(value.toPrecision(2))), { x: edge.left - 6, y: y(j) + h / 2 + 4, "text-anchor": "end" }, svg); });
      const key = edge.top + ny * h + 40, part = (width - edge.left - edge.right) / 5;
      ["≤ 1 % of ω₀", "≤ 3 %", "≤ 10 %", "≤ 30 %", "more"].forEach((words, k) => {
        chart.element("rect", { class: `map-cell shade-${k}`, x: edge.left + k * part, y: key, width: part, height: 8 }, svg);
        chart.words(words, { x: edge.left + (k + 0.5) * part, y: key + 21, "text-anchor": "middle" }, svg);
      });
      if (shown) {
        const [cx, cy] = [edge.left + (thrown[0] + 0.5) * w, edge.top + (ny - 0.5 - thrown[1]) * h];
        const cross = `M${cx - 6} ${cy - 6}l12 12m0-12l-12 12`;
        chart.element("path", { class: "map-throw map-throw-halo", d: cross }, svg);
        chart.element("path", { class: "map-throw", d: cross, "data-testid": "map-throw" }, svg);
        chart.words("this throw", { class: "map-name", x: cx + 10, y: cy - 6 }, svg);
      }
      chart.element("rect", { class: "map-here", width: w, height: h, transform: `translate(${x(here[0])} ${y(here[1])})` }, svg);
    }

    // Every region has the name of its change, or the number of it where there is no room.
    function regions(x, y, w, h) {
      const seen = new Set();
      for (const start of cells.keys()) {
        if (seen.has(start)) continue;
        const which = cells.get(start).which, found = [], waiting = [start];
        while (waiting.length) {
          const key = waiting.pop();
          if (seen.has(key) || cells.get(key)?.which !== which) continue;
          seen.add(key);
          const [i, j] = key.split(" ").map(Number);
          found.push([i, j]);
          waiting.push(`${i + 1} ${j}`, `${i - 1} ${j}`, `${i} ${j + 1}`, `${i} ${j - 1}`);
        }
        if (!which) continue;
        const [ci, cj] = [0, 1].map((axis) => found.reduce((sum, place) => sum + place[axis], 0) / found.length);
        const [i, j] = found.reduce((best, place) => (Math.hypot(place[0] - ci, place[1] - cj) < Math.hypot(best[0] - ci, best[1] - cj) ? place : best));
        const short = which.split(/[:,]/)[0], number = String(data.numbers[which]);
        const room = w * Math.min(...[-1, 0, 1].map((row) => found.filter((place) => place[1] === j + row).length));
        const words = room < 7 * (short.length + 3) ? number : `${number} ${short}`;
        const left = x(Math.min(...found.filter((place) => place[1] === j).map((place) => place[0])));
        const middle = words === number ? x(i) + w / 2 : Math.max(x(i) + w / 2, left + 3.6 * words.length);
        chart.words(words, { class: "map-name", x: middle, y: y(j) + h / 2 + 4, "text-anchor": "middle" }, svg);
      }
    }
    svg.addEventListener("keydown", (event) => {
      const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!move) return;
      event.preventDefault();
      tell(...here.map((place, axis) => Math.max(0, Math.min([data.fills, data.dampings][axis].length - 1, place + move[axis]))));
    });
    choice.addEventListener("change", () => { window.flipproofState.keep("map", choice.value); draw(); tell(...here); });
    if ([...choice.options].some(({ value }) => value === window.flipproofState.kept("map"))) choice.value = window.flipproofState.kept("map");
    chart.onWidth(svg, draw);
    draw();
    tell(...here);
  }

  window.addEventListener("load", () => setTimeout(map, 0));
})();
