// A Runge-Kutta solver of Eq. 8 in JavaScript, which knows flipproof only by files.
//
//   flipproof certify "cmd:node eq8.mjs {scenario} {times} {start} {effort} {out}" --equation eq8
//   flipproof certify csv:answers --equation eq8 --refined-by dt --order 4      (writes the questions)
//   node eq8.mjs answers && flipproof certify csv:answers

import { existsSync, readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";

/** Return tables and numbers of a scenario file: [table] and key = value, of the simple kind that flipproof writes. */
function readToml(path) {
  const tables = {};
  let table = tables;
  for (const line of readFileSync(path, "utf8").split(/\r?\n/)) {
    const head = line.match(/^\s*\[(\w+)\]/);
    const pair = line.match(/^\s*(\w+)\s*=\s*(.+?)\s*(#.*)?$/);
    if (head) table = tables[head[1]] = {};
    else if (pair) table[pair[1]] = JSON.parse(pair[2]);
  }
  return tables;
}

const readColumn = (path) => readFileSync(path, "utf8").trim().split(/\s+/).slice(1).map(Number);

/** Return rows [t, theta, omega, r_0, ..., v_0, ...] at the times asked. */
function solve({ scenario, bottle }, times, start, dt) {
  const n = start.length;
  const m = scenario.water_mass / n;
  const total = scenario.water_mass + bottle.mass;
  const height = (scenario.water_mass / bottle.capacity) * bottle.length / n; // of a slice
  const [low, high] = [height / 2, bottle.length - height / 2];
  const own = bottle.mass * (bottle.radius ** 2 / 2 + bottle.length ** 2 / 12);

  function centreAndInertia(y) {
    let sum = 0;
    for (let i = 1; i <= n; i++) sum += y[i];
    const centre = (m * sum + bottle.mass * bottle.length / 2) / total;
    let inertia = own + bottle.mass * (bottle.length / 2 - centre) ** 2;
    for (let i = 1; i <= n; i++) inertia += m * (y[i] - centre) ** 2;
    return [centre, inertia];
  }

  let y = [scenario.theta0, ...start, ...start.map(() => 0)];
  const momentum = centreAndInertia(y)[1] * scenario.omega0;

  function slope(y) {
    const [centre, inertia] = centreAndInertia(y);
    const omega = momentum / inertia;
    const d = new Array(2 * n + 1).fill(0);
    d[0] = omega;
    if (scenario.frozen) return d;
    let mean = 0;
    for (let i = 1; i <= n; i++) mean += m * y[n + i] / total;
    for (let i = 1; i <= n; i++) {
      const [r, v] = [y[i], y[n + i]];
      const a = omega ** 2 * (r - centre) + scenario.gravity * Math.cos(y[0]) - (scenario.drag / m) * (v - mean);
      if ((r >= high && a > 0 && v >= 0) || (r <= low && a < 0 && v <= 0)) continue; // rests on an end
      d[i] = v;
      d[n + i] = a;
    }
    return d;
  }

  const along = (y, h, k) => y.map((x, i) => x + h * k[i]);

  function step(y, h) {
    const k1 = slope(y);
    const k2 = slope(along(y, h / 2, k1));
    const k3 = slope(along(y, h / 2, k2));
    const k4 = slope(along(y, h, k3));
    const next = y.map((x, i) => x + (h / 6) * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]));
    for (let i = 1; i <= n; i++) { // rebounds wait for the end of the step
      const side = next[i] > high ? 1 : next[i] < low ? -1 : 0;
      if (!side) continue;
      if (side * next[n + i] > 0) next[n + i] *= -scenario.restitution;
      if (Math.abs(next[n + i]) < 1e-3) next[n + i] = 0;
      next[i] = side > 0 ? high : low;
    }
    return next;
  }

  let t = 0;
  return times.map((when) => {
    const steps = Math.ceil((when - t) / dt - 1e-9);
    for (let k = 0; k < steps; k++) y = step(y, (when - t) / steps);
    t = when;
    return [when, y[0], momentum / centreAndInertia(y)[1], ...y.slice(1)];
  });
}

function answer(scenario, times, start, effort, out) {
  const r = readColumn(start);
  const header = ["t", "theta", "omega", ...r.map((_, i) => `r_${i}`), ...r.map((_, i) => `v_${i}`)];
  const rows = solve(readToml(scenario), readColumn(times), r, effort);
  writeFileSync(out, [header, ...rows].map((row) => row.join(",")).join("\n") + "\n");
}

const [first, ...rest] = process.argv.slice(2);
if (rest.length) {
  const [times, start, effort, out] = rest;
  answer(first, times, start, Number(effort), out);
} else {
  for (const name of readdirSync(first).sort()) {
    const at = (file) => join(first, name, file);
    if (!existsSync(at("effort.txt")) || existsSync(at("answer.csv"))) continue;
    answer(at("scenario.toml"), at("times.csv"), at("start.csv"), Number(readFileSync(at("effort.txt"), "utf8")), at("answer.csv"));
  }
}
