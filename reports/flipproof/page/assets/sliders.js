// The sliders of "Switch gravity off": what they say is solved by live.js and drawn at once; the address keeps it.
(() => {
  "use strict";
  const root = document.getElementById("sliders");
  if (!root) return;
  const { g, theta0, fill, gamma, e, omega0, ...fixed } = JSON.parse(document.getElementById("live-data").textContent);
  const start = { g, theta0, fill, gamma, e, omega0 };
  const scale = { theta0: Math.PI / 180, fill: 0.01 };
  const chart = window.flipproofChart, solve = window.flipproofLive;
  const find = (name) => root.querySelector(`[data-testid="live-${name}"]`);
  const inputs = [...root.querySelectorAll("input")];
  const names = { "published-python": "program", eq8: "Eq. 8", "free-flight": "free flight" };
  let thrown = { ...start }, drawn = {};

  const flown = (set) => ({
    "published-python": solve.program({ ...fixed, ...set }),
    eq8: solve.eq8({ ...fixed, ...set }),
    "free-flight": solve.free({ ...fixed, ...set }),
  });
  // The throw with the gravity of the report is solved anew when something else than gravity is changed.
  let usual = { key: "", curves: null };
  const unchanged = (set) => {
    const key = JSON.stringify(set);
    if (usual.key !== key) usual = { key, curves: flown(set) };
    return usual.curves;
  };
  const times = (count) => Array.from({ length: count }, (_, k) => (k * fixed.duration) / (count - 1));
  const farthest = (one, other) => one.reduce((most, value, k) => Math.max(most, Math.abs(value - other[k])), 0) / thrown.omega0;
  const percent = (share) => `${Number((100 * share).toPrecision(2))} %`;

  function draw() {
    const began = performance.now();
    const changed = thrown.g !== start.g, before = unchanged({ ...thrown, g: start.g });
    // Free flight is solved again too: that it does not change is what is to be seen.
    const now = changed ? flown(thrown) : before;
    const line = (name, omega, more) => ({ name, x: times(omega.length), y: Array.from(omega, (value) => value / thrown.omega0), ...more });
    const lines = Object.keys(now).map((name) => line(name, now[name], { label: names[name] }));
    if (changed) lines.unshift(...Object.keys(now).map((name) => line(name, before[name], { faint: true })));
    const high = lines.reduce((most, { y }) => Math.max(most, ...y.filter(Number.isFinite)), 1);
    chart.draw(find("omega"), 340, {
      x: { low: 0, high: fixed.duration, label: "time t [s]" },
      y: { low: 0, high: Math.min(3, high), label: "angular velocity ω / ω₀ [1]" },
      right: 84,
      lines,
    });
    for (const input of inputs) {
      const value = thrown[input.name] / (scale[input.name] ?? 1);
      input.value = value;
      const text = `${chart.shown(value, Number(input.dataset.digits))} ${input.dataset.unit}`.trim();
      input.previousElementSibling.querySelector("output").textContent = text;
      input.setAttribute("aria-valuetext", text);
    }
    find("weightless").textContent = thrown.g === 0 ? "Gravity on" : "Gravity off";
    const moves = (name) => percent(farthest(now[name], before[name]));
    find("said").textContent = changed
      ? `With g = ${chart.shown(thrown.g, 2)} instead of ${chart.shown(start.g, 2)} m/s², ω moves by up to ${moves("eq8")} of ω₀ by Eq. 8, ${moves("published-python")} by the program, and ${moves("free-flight")} in free flight.`
      : `Eq. 8 and free flight differ by up to ${percent(farthest(now.eq8, now["free-flight"]))} of ω₀, the program and free flight by ${percent(farthest(now["published-python"], now["free-flight"]))}. Now switch gravity off.`;
    drawn = { thrown: { ...fixed, ...thrown }, curves: now, before, milliseconds: performance.now() - began };
  }

  let waiting = false;
  function set(change, remember = true) {
    thrown = { ...thrown, ...change };
    const different = Object.entries(thrown).filter(([name, value]) => value !== start[name]);
    if (remember) window.flipproofState.link("live", Object.fromEntries(different));
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  }
  for (const input of inputs) input.addEventListener("input", () => set({ [input.name]: Number(input.value) * (scale[input.name] ?? 1) }));
  find("weightless").addEventListener("click", () => set({ g: thrown.g === 0 ? start.g || 9.81 : 0 }));
  find("reset").addEventListener("click", () => set(start));
  const recall = () => {
    const asked = Object.entries(window.flipproofState.linked("live")).map(([name, text]) => [name, Number(text)]);
    set({ ...start, ...Object.fromEntries(asked.filter(([name, value]) => name in start && Number.isFinite(value))) }, false);
  };
  window.addEventListener("hashchange", () => { if (location.hash.startsWith("#live?")) recall(); });
  window.addEventListener("load", () => setTimeout(() => { recall(); chart.onWidth(find("omega"), draw); }, 0));

  // What a test, or a curious reader at the console, may ask.
  window.flipproofSliders = { drawn: () => drawn, set: (change) => { thrown = { ...thrown, ...change }; draw(); return drawn; } };
})();
