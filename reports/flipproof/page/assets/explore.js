// The sliders: one of the throws that were computed, its curves, and its cell of the validity map.
(() => {
  "use strict";
  const root = document.getElementById("explore");
  const source = document.getElementById("explore-data");
  if (!root || !source) return;
  root.classList.add("explore-alive");
  const data = JSON.parse(source.textContent);
  const chart = window.flipproofChart;

  const MISSING = 0xffff;
  const MISSING_RUNG = 0xff;
  const COLOURS = ["#d9d9d9", "#f4b183", "#f7e08a", "#bfa6d9", "#9cc9ea", "#98d3bc", "#e8a9c4"];
  const HEIGHT = 250;
  const ROW = 26; // px of a row of the map
  const EDGE = { left: 46, right: 4, top: 22, bottom: 36 };

  const find = (name) => root.querySelector(`[data-testid="explore-${name}"]`);
  const known = (step) => (whole) => (whole === MISSING ? NaN : whole * step);
  const unpacked = (texts, step) => Object.fromEntries(Object.entries(texts).map(
    ([name, text]) => [name, Array.from(chart.numbers(text, Uint16Array), known(step))]));
  const omega = unpacked(data.omega, data.omega_step);
  const plateau = unpacked(data.plateau, data.plateau_step);
  const shares = data.shares && unpacked(data.shares, data.share_step);
  const dominant = chart.bytes(data.dominant);
  const times = Array.from({ length: data.points }, (_, k) => (k * data.duration) / (data.points - 1));
  const highest = Math.max(1, ...Object.values(omega).flat().filter(Number.isFinite));
  const free = data.solvers.at(-1);
  const letters = "ABCDEFGHIJ";
  const sliders = { fill: data.fills, gamma: data.gammas, restitution: data.restitutions };
  const percent = (share, digits = 1) => (Number.isFinite(share) ? `${chart.shown(100 * share, digits)} %` : "not computed");
  const signed = (share, digits = 1) => (share >= 0 && Number.isFinite(share) ? "+" : "") + percent(share, digits);
  const number = (value) => (Number.isFinite(value) ? chart.shown(value, 4) : "–");

  const chosen = (name) => Number(find(name).value);
  const placeOf = (restitution, gamma, fill) => (restitution * data.gammas.length + gamma) * data.fills.length + fill;
  const place = () => placeOf(chosen("restitution"), chosen("gamma"), chosen("fill"));
  const words = {
    fill: (value) => `${chart.shown(100 * value, 0)} %`,
    gamma: (value) => `${value} /s`,
    restitution: (value) => `${value}`,
  };

  function mistakes(at) {
    return data.rungs.map((name, k) => ({
      name, letter: letters[k], colour: COLOURS[k % COLOURS.length],
      share: shares ? shares[name][at] - 1 : plateau[data.ladder[k + 1]][at] - plateau[data.ladder[k]][at],
    }));
  }

  function show() {
    const at = place();
    for (const name of Object.keys(sliders)) {
      const text = words[name](sliders[name][chosen(name)]);
      find(`${name}-value`).textContent = text;
      find(name).setAttribute("aria-valuetext", text);
    }
    root.dataset.place = String(at);
    drawCurves(at);
    fillValues(at);
    drawMap();
    fillMistakes(at);
    say(at);
  }

  function drawCurves(at) {
    chart.draw(find("omega"), HEIGHT, {
      x: { low: 0, high: data.duration, label: "time t [s]" },
      y: { low: 0, high: highest, label: "angular velocity ω / ω₀ [1]" },
      lines: data.solvers.map((name) => ({ name, x: times, y: omega[name].slice(at * data.points, (at + 1) * data.points) })),
    });
  }

  function fillValues(at) {
    for (const row of find("values").tBodies[0].rows) {
      const name = row.dataset.solver;
      const off = plateau[name][at] - plateau[free][at];
      const values = [number(plateau[name][at]), name === free ? "–" : signed(off), number(omega[name][(at + 1) * data.points - 1])];
      values.forEach((value, column) => (row.cells[column + 1].textContent = value));
    }
  }

  function drawMap() {
    const svg = find("map");
    const width = Math.max(240, Math.round(svg.clientWidth || svg.parentElement.clientWidth));
    const rows = data.gammas.length;
    const height = EDGE.top + rows * ROW + EDGE.bottom;
    const cell = (width - EDGE.left - EDGE.right) / data.fills.length;
    svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    svg.setAttribute("height", height);
    svg.replaceChildren();
    const corner = (gamma, fill) => ({ x: EDGE.left + fill * cell, y: EDGE.top + (rows - 1 - gamma) * ROW });
    chart.words("γ [1/s]", { x: 2, y: 12 }, svg);
    chart.words("filling M_w / M_max", { x: width - EDGE.right, y: height - 4, "text-anchor": "end" }, svg);
    data.gammas.forEach((gamma, k) => {
      chart.words(String(gamma), { x: EDGE.left - 6, y: corner(k, 0).y + ROW / 2 + 4, "text-anchor": "end" }, svg);
      data.fills.forEach((_, fill) => {
        const at = placeOf(chosen("restitution"), k, fill);
        const rung = dominant[at];
        const { x, y } = corner(k, fill);
        const box = chart.element("rect", {
          class: "explore-cell", x, y, width: cell, height: ROW, fill: rung === MISSING_RUNG ? "none" : COLOURS[rung % COLOURS.length],
        }, svg);
        box.addEventListener("click", () => choose({ gamma: k, fill }));
        const hint = rung === MISSING_RUNG ? data.problems[at] ?? "not computed" : `${data.rungs[rung]}: ${signed(mistakes(at)[rung].share)}`;
        chart.element("title", {}, box).textContent = hint;
        chart.words(rung === MISSING_RUNG ? "–" : letters[rung], { class: "explore-letter", x: x + cell / 2, y: y + ROW / 2 + 4 }, svg);
      });
    });
    data.fills.forEach((fill, k) => {
      if (cell < 30 && k % 2 === 0) return;
      chart.words(chart.shown(fill, 1), { x: corner(0, k).x + cell / 2, y: EDGE.top + rows * ROW + 15, "text-anchor": "middle" }, svg);
    });
    const here = corner(chosen("gamma"), chosen("fill"));
    const frame = { x: here.x + 1, y: here.y + 1, width: cell - 2, height: ROW - 2 };
    chart.element("rect", { class: "explore-halo", ...frame }, svg);
    chart.element("rect", { class: "explore-here", "data-testid": "explore-here", ...frame }, svg);
  }

  function choose(indices) {
    for (const [name, index] of Object.entries(indices)) find(name).value = String(index);
    show();
  }

  function fillMistakes(at) {
    const found = mistakes(at);
    const largest = Math.max(...found.map((mistake) => Math.abs(mistake.share)).filter(Number.isFinite), 1e-9);
    find("mistakes").tBodies[0].replaceChildren(...found.map((mistake, k) => {
      const row = document.createElement("tr");
      if (k === dominant[at]) row.style.fontWeight = "700";
      row.insertCell().textContent = `${mistake.letter} ${mistake.name}${k === dominant[at] ? " (largest)" : ""}`;
      const share = row.insertCell();
      share.className = "number";
      share.textContent = signed(mistake.share, 2);
      const bar = document.createElement("span");
      bar.className = "explore-bar";
      bar.style.width = `${Number.isFinite(mistake.share) ? (100 * Math.abs(mistake.share)) / largest : 0}%`;
      bar.style.background = mistake.colour;
      const last = row.insertCell();
      last.style.width = "40%";
      last.append(bar);
      return row;
    }));
  }

  function say(at) {
    const [fill, gamma, restitution] = ["fill", "gamma", "restitution"].map((name) => find(`${name}-value`).textContent);
    const problem = data.problems[at];
    const rung = dominant[at];
    const errors = data.solvers.slice(0, -1).map(
      (name) => `${name} misses free flight by ${percent(Math.abs(plateau[name][at] - plateau[free][at]))} of ω₀`);
    const cell = rung === MISSING_RUNG ? `The map has no answer here: ${problem}.`
      : `The largest ${data.measure} here: ${data.rungs[rung]}, ${signed(mistakes(at)[rung].share)} of ω₀.`;
    find("said").textContent = `Filled to ${fill}, γ = ${gamma}, e = ${restitution}: on the plateau ${errors.join(", ")}. ${cell}`;
  }

  function fillKeys() {
    for (const item of find("legend").children) item.prepend(chart.sample(item.dataset.solver));
    for (const row of find("values").tBodies[0].rows) row.cells[0].prepend(chart.sample(row.dataset.solver), " ");
    find("key").replaceChildren(...data.rungs.map((name, k) => {
      const item = document.createElement("li");
      const patch = document.createElement("b");
      patch.textContent = letters[k];
      patch.style.background = COLOURS[k % COLOURS.length];
      item.append(patch, name);
      return item;
    }));
  }

  fillKeys();
  for (const name of Object.keys(sliders)) find(name).addEventListener("input", show);
  chart.onWidth(root, show);
  show();

  // What a test, or a curious reader at the console, may ask.
  window.flipproofExplore = {
    place,
    curve: (name) => omega[name].slice(place() * data.points, (place() + 1) * data.points),
    plateau: (name) => plateau[name][place()],
    dominant: () => data.rungs[dominant[place()]] ?? null,
  };
})();
