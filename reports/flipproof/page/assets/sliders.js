// The sliders of "Throw it yourself": what they say is solved by live.js and drawn at once; the address keeps it.
(() => {
  "use strict";
  const root = document.getElementById("sliders");
  if (!root) return;
  const { g, theta0, fill, gamma, e, omega0, ...fixed } = JSON.parse(document.getElementById("live-data").textContent);
  const start = { g, theta0, fill, gamma, e, omega0 }, scale = { theta0: Math.PI / 180, fill: 0.01 };
  const chart = window.flipproofChart, live = window.flipproofLive, { program, eq8, free, column, rods } = live;
  const find = (name) => root.querySelector(`[data-testid="live-${name}"]`);
  const inputs = [...root.querySelectorAll("input")];
  const names = { "published-python": "program", eq8: "Eq. 8", "free-flight": "free flight", column: "column", rods: "rods" };
  let thrown = { ...start }, drawn = {}, waiting = false, touched = null, doubting = 0;

  // The program makes its 1000 steps; of the equations as many points as a frame of 16 ms allows.
  const solvers = { "published-python": [program, 1000], eq8: [eq8, 251], "free-flight": [free, 251, null, 1], column: [column, 251], rods: [rods, 251] };
  const flown = (set) => Object.fromEntries(Object.entries(solvers).map(([name, [solve, ...how]]) => [name, solve({ ...fixed, ...set }, ...how)]));
  // The throw with the gravity of the report is solved anew when something else than gravity is changed.
  let usual = { key: "" };
  function unchanged(set) {
    const key = JSON.stringify(set);
    if (usual.key !== key) {
      const curves = flown(set);
      usual = { key, curves, lines: lines(curves, () => ({ faint: true })) };
    }
    return usual;
  }
  // Of curves with more and with fewer points, at the times of the one with fewer.
  const percent = (one, other) => {
    const at = (curve, share) => curve[Math.round(share * (curve.length - 1))], last = Math.min(one.length, other.length) - 1;
    let worst = 0;
    for (let k = 0; k <= last; k++) worst = Math.max(worst, Math.abs((at(one, k / last) - at(other, k / last)) / thrown.omega0));
    return live.percent(worst);
  };

  const times = new Map();
  function line(name, whole) { // of the program every third point
    const omega = name === "published-python" ? whole.filter((_, k) => k % 3 === 0) : whole, { length } = omega;
    if (!times.has(length)) times.set(length, Array.from(omega, (_, k) => (k * fixed.duration) / (length - 1)));
    return { name, x: times.get(length), y: omega.map((value) => value / thrown.omega0) };
  }
  const lines = (curves, look) => Object.keys(names).map((name) => ({ ...line(name, curves[name]), ...look(name) }));

  function draw() {
    const began = performance.now(), changed = thrown.g !== start.g;
    const { curves: before, lines: behind } = unchanged({ ...thrown, g: start.g });
    // Free flight, column and rods are solved again too: that they do not change is what is to be seen.
    const now = changed ? flown(thrown) : before;
    const plot = { behind: changed ? behind : [], lines: lines(now, (name) => ({ label: names[name] })) };
    const high = [...plot.behind, ...plot.lines].reduce((most, { y }) => Math.max(most, ...y.filter(Number.isFinite)), 1);
    const y = { low: 0, high: Math.min(6, high), label: "angular velocity ω / ω₀ [1]" };
    if (touched) touched.change({ ...plot, y });
    else touched = window.flipproofTouch.touch(find("omega"), 290, { x: { low: 0, high: fixed.duration, label: "time t [s]" }, y, right: 84, ...plot });
    for (const input of inputs) {
      input.value = thrown[input.name] / (scale[input.name] ?? 1);
      const text = `${chart.shown(Number(input.value), Number(input.dataset.digits))}${input.dataset.unit === "°" ? "" : " "}${input.dataset.unit}`.trim();
      input.previousElementSibling.querySelector("output").textContent = text;
      input.setAttribute("aria-valuetext", text);
    }
    const apart = (from) => Object.keys(names).filter((name) => now[name] !== from(name)).map((name) => `${names[name]} ${percent(now[name], from(name))}`);
    find("said").textContent = changed
      ? `With g = ${chart.shown(thrown.g, 2)} instead of ${chart.shown(start.g, 2)} m/s², ω moves by at most, as shares of ω₀: ${apart((name) => before[name]).join(", ")}.`
      : `The largest differences from free flight are, as shares of ω₀: ${apart(() => now["free-flight"]).join(", ")}.`;
    const leaving = plot.lines.filter(({ y }) => y.some((value) => value > 6)).length;
    if (leaving) find("said").textContent += ` ${leaving > 1 ? `${leaving} curves leave` : "One curve leaves"} the chart at 6 ω₀.`;
    clearTimeout(doubting);
    doubting = setTimeout(doubt, 300, now["free-flight"]);
    drawn = { thrown: { ...fixed, ...thrown }, curves: now, before, milliseconds: performance.now() - began };
  }
  // Where recoil lets rests decide the order of impacts, twins of free flight, with other steps, rests and last digits of
  // filling and spin, become other flights: twice as far as they part is how uncertain it is.
  function doubt(omega) {
    const set = { ...fixed, ...thrown }, rest = live.restSpeed(set);
    const twins = [[{}, rest / 10], [{ omega0: set.omega0 * (1 + 1e-9) }, rest], ...[1e-8, 1e-7].map((less) => [{ fill: set.fill * (1 - less) }, rest])];
    const apart = twins.map(([change, slow]) => live.farthest(omega, free({ ...set, ...change }, 251, null, 2, slow)));
    const band = (2 * Math.max(...apart)) / Math.abs(thrown.omega0);
    if (band > 0.005) find("said").textContent += ` Free flight is uncertain by about ${live.percent(band)}: rounding decides the order of impacts.`;
  }
  function set(change) {
    thrown = { ...thrown, ...change };
    if (!waiting) requestAnimationFrame(() => { waiting = false; draw(); });
    waiting = true;
  }
  const remember = () => window.flipproofState.link("live", Object.fromEntries(Object.entries(thrown).filter(([name, value]) => value !== start[name])));
  for (const input of inputs) {
    input.addEventListener("input", () => set({ [input.name]: Number(input.value) * (scale[input.name] ?? 1) }));
    input.addEventListener("change", remember);
  }
  find("reset").addEventListener("click", () => { set(start); remember(); });
  function recall() {
    const asked = { ...start }, linked = window.flipproofState.linked("live");
    for (const { name, min, max } of inputs) { // what lies beyond a slider is its end
      const unit = scale[name] ?? 1, value = Number(linked[name] ?? NaN);
      if (Number.isFinite(value)) asked[name] = Math.min(max * unit, Math.max(min * unit, value));
    }
    set(asked);
  }
  window.addEventListener("hashchange", () => { if (location.hash.startsWith("#live?")) recall(); });
  window.addEventListener("load", () => setTimeout(recall, 0));

  // A slider finer than a finger wants has a coarser step for the arrow keys.
  for (const slider of document.querySelectorAll("input[data-keys]")) {
    slider.addEventListener("keydown", (event) => {
      const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
      if (!way) return;
      event.preventDefault();
      slider.value = String(Number(slider.value) + way * Number(slider.dataset.keys));
      for (const kind of ["input", "change"]) slider.dispatchEvent(new Event(kind, { bubbles: true }));
    });
  }

  // What a test, or a curious reader at the console, may ask.
  window.flipproofSliders = { drawn: () => drawn, set: (change) => { thrown = { ...thrown, ...change }; draw(); return drawn; } };
})();
