// The two pictures of the story that move: omega(t) with the water under one cursor, and the map that tells its numbers.
(() => {
  "use strict";
  const chart = window.flipproofChart;
  const find = (id) => document.querySelector(`[data-testid="${id}"]`);
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const names = { "published-python": "program", eq8: "Eq. 8", "free-flight": "free flight", pymunk: "engine" };

  function ride() {
    const source = document.getElementById("motion-data");
    if (!source || !document.getElementById("ride")) return;
    const data = JSON.parse(source.textContent), flights = data.flights.map((flight) => ({
      ...flight, omega: chart.numbers(flight.omega, Float32Array), r_cm: chart.numbers(flight.r_cm, Float32Array),
      r: chart.numbers(flight.r, Int16Array),
    }));
    const svg = find("ride-omega"), canvas = find("ride-bottles"), slider = find("ride-time"), button = find("ride-play");
    const time = (k) => (k * data.duration) / (data.frames - 1);
    const high = flights.reduce((most, { omega }) => omega.reduce((a, b) => Math.max(a, b), most), 0) / data.omega0;
    let playing = 0;
    const touched = window.flipproofTouch.touch(svg, 330, {
      x: { low: 0, high: data.duration, label: "time t [s]" },
      y: { low: 0, high: Math.min(3, Math.max(1, high)), label: "angular velocity ω / ω₀ [1]" },
      right: 84,
      lines: flights.map(({ name, omega }) => ({
        name, label: names[name] ?? name, x: Array.from(omega, (_, k) => time(k)), y: Array.from(omega, (value) => value / data.omega0),
      })),
    }, (at) => {
      slider.value = String(Math.round((at / data.duration) * (data.frames - 1)));
      tell();
    });

    function drawBottles(k) {
      const width = canvas.clientWidth, height = 330, ratio = window.devicePixelRatio || 1;
      if (canvas.width !== Math.round(width * ratio)) [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
      const pen = canvas.getContext("2d"), cell = width / flights.length, top = 40, tall = height - top - 12;
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      pen.clearRect(0, 0, width, height);
      pen.font = `600 12px ${getComputedStyle(canvas).fontFamily}`;
      pen.textAlign = "center";
      flights.forEach((flight, j) => {
        const at = Math.min(k, flight.reached - 1), wide = Math.min(64, cell - 14), left = (j + 0.5) * cell - wide / 2;
        const down = (place) => top + place * tall, thick = Math.max(1.5, (data.slice_height / data.length) * tall * 0.75);
        pen.fillStyle = style(`--solver-${flight.name}`) || style("--ink");
        pen.fillText(names[flight.name] ?? flight.name, left + wide / 2, 14);
        pen.fillText(`ω ${(flight.omega[at] / data.omega0).toFixed(2)} ω₀`, left + wide / 2, 30);
        pen.globalAlpha = 0.55;
        pen.fillStyle = style("--water-low");
        const n = flight.drawn.length;
        for (let i = 0; i < n; i++) pen.fillRect(left + 3, down(flight.r[at * n + i] * data.position_step) - thick / 2, wide - 6, thick);
        pen.globalAlpha = 1;
        pen.strokeStyle = style("--glass");
        pen.lineWidth = 2;
        pen.strokeRect(left, top, wide, tall);
        const centre = down(flight.r_cm[at] / data.length);
        pen.strokeStyle = style("--ink");
        pen.beginPath();
        pen.moveTo(left - 5, centre);
        pen.lineTo(left + wide + 5, centre);
        pen.stroke();
      });
    }

    function tell() {
      const k = Number(slider.value), said = `t = ${time(k).toFixed(3)} s`;
      drawBottles(k);
      find("ride-said").textContent = said;
      slider.setAttribute("aria-valuetext", said);
    }
    function show() {
      touched.put(time(Number(slider.value)));
      tell();
    }
    slider.addEventListener("input", show);
    button.addEventListener("click", () => {
      if (playing) { cancelAnimationFrame(playing); playing = 0; button.textContent = "Play"; return; }
      if (slider.value === slider.max) slider.value = "0";
      const from = Number(slider.value), began = performance.now();
      const next = (now) => {
        slider.value = String(Math.min(data.frames - 1, Math.round(from + ((now - began) / 1000 / data.slow / data.duration) * (data.frames - 1))));
        show();
        if (slider.value === slider.max) { playing = 0; button.textContent = "Play"; } else playing = requestAnimationFrame(next);
      };
      button.textContent = "Pause";
      playing = requestAnimationFrame(next);
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
    chart.onWidth(canvas, tell);
    show();
  }

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
      const value = (mean) => (mean === null ? "not computed" : mean.toFixed(3));
      const means = data.solvers.map((name, k) => `${names[name]} ${value(cell.mean[k])}`).join(", ");
      const far = off(cell);
      said.textContent = `Filling ${Number(cell.x.toPrecision(3))}, γ/ω₀ = ${Number(cell.y.toPrecision(2))}: mean ω/ω₀ of the second half: ${means}. `
        + `${names[choice.value]} is off by ${Number.isFinite(far) ? `${Number((100 * far).toPrecision(2))} %` : "an unknown part"} of ω₀. Largest fair share from the published program to free flight: ${cell.which || "unknown"}.`;
      const box = svg.querySelector(".map-here");
      box?.setAttribute("transform", svg.querySelector(`[data-cell="${i} ${j}"]`).dataset.place);
    }

    function draw() {
      const width = Math.max(280, Math.round(svg.clientWidth || svg.parentElement.clientWidth)), nx = data.fills.length, ny = data.dampings.length;
      const w = (width - edge.left - edge.right) / nx, h = Math.max(11, Math.min(22, w * 0.55)), height = edge.top + ny * h + edge.bottom;
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
      data.fills.forEach((fill, i) => { if (Math.abs(fill * 10 - Math.round(fill * 10)) < 1e-9 && (w > 24 || Math.round(fill * 10) % 2 === 0)) chart.words(fill.toFixed(1), { x: x(i) + w / 2, y: edge.top + ny * h + 15, "text-anchor": "middle" }, svg); });
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

  window.addEventListener("load", () => setTimeout(() => { ride(); map(); }, 0));
})();
