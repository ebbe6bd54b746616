// Three solvers in the reader's browser, and the sliders that set what they throw: the published program's own step;
// Eq. 8 and free flight by Runge-Kutta steps of order 4 that end at every impact.
//   cap  y = -wall |------ o -- o - C_M ---- o -- o -| y = +wall  base     y = r - L/2; a slice at rest has side = +1, -1
window.flipproofLive = (() => {
  "use strict";
  const PART = [1 / 2, 1 / 2, 1, 0], WEIGHT = [1 / 6, 1 / 3, 1 / 3, 1 / 6]; // of Runge and Kutta

  // What stays the same in a flight, and its beginning. A throw: {bottle, slices, fill, gamma = alpha / (2 m), ...}, SI.
  function prepared(thrown) {
    const { length, radius, mass, capacity } = thrown.bottle, n = thrown.slices, m = (thrown.fill * capacity) / n;
    const height = (thrown.fill * length) / n, wall = length / 2 - height / 2, M = mass + m * n;
    const y = Float64Array.from({ length: n }, (_, i) => wall - i * height);
    if (Math.abs(y[n - 1] + wall) <= 1e-15 * length) y[n - 1] = -wall;
    const bottle = mass * (radius * radius / 2 + length * length / 12);
    // J about a point at `offset`, from the sums of y and y^2 (Eq. 11b to 11d).
    const inertia = (first, second, offset) => bottle + m * (second - offset * (2 * first - n * offset)) + mass * offset * offset;
    const first = y.reduce((sum, place) => sum + place, 0), second = y.reduce((sum, place) => sum + place * place, 0);
    const momentum = inertia(first, second, (m * first) / M) * thrown.omega0;
    return { ...thrown, n, m, M, mass, wall, y, v: new Float64Array(n), inertia, first, second, momentum };
  }

  // The Python program of the supplement: its sign in Eq. 9d, its lag of a step, its rebounds that wait for the grid.
  function program(thrown, steps = 1000) {
    const { n, m, M, wall, y, v, inertia, momentum, gamma, g, e, omega0, theta0, duration, ...start } = prepared(thrown);
    const dt = duration / (steps - 1), fade = Math.exp(-gamma * dt), omega = new Float64Array(steps).fill(omega0);
    let { first, second } = start, offset = (m * first) / M, spin = omega0, angle = theta0;
    for (let k = 1; k < steps; k++) {
      const centre = offset - (g * Math.cos(angle)) / (spin * spin), half = Math.sinh(0.5 * spin * dt);
      const b = (fade * Math.sinh(spin * dt)) / spin, a = Math.expm1(-gamma * dt) + gamma * b + 2 * fade * half * half;
      const c = (spin * spin - gamma * gamma) * b, d = fade * Math.cosh(spin * dt) + gamma * b;
      const moment = [first, second, offset];
      offset = (m * first) / M;
      first = second = 0;
      for (let i = 0; i < n; i++) {
        const there = y[i] + (a * (y[i] - centre) + b * v[i]), speed = c * (y[i] - centre) + d * v[i];
        const past = Math.abs(there) > wall;
        v[i] = past ? -e * speed : speed;
        if (!past) y[i] = there;
        first += y[i];
        second += y[i] * y[i];
      }
      angle += spin * dt;
      omega[k] = spin = momentum / inertia(...moment);
    }
    return omega;
  }

  // Omega of Eq. 8, or of free flight, at equal times. A slice slower than `rest` that its end presses on rests there.
  function flow(thrown, free, points = 1000, parts = free ? 2 : 1, rest = free ? 1e-3 : 1e-5) {
    const { n, m, M, mass, wall, y, v, inertia, momentum, gamma, g, e, theta0, duration } = prepared(thrown);
    const side = new Int8Array(n), ratio = m / mass, drag = 2 * gamma, omega = new Float64Array(points);
    const rows = () => Array.from({ length: 5 }, () => new Float64Array(n)), [ys, vs, as] = [rows(), rows(), rows()];
    const [y1, v1] = [ys[4], vs[4]], [va, vb, vc, vd] = vs, [aa, ab, ac, ad] = as;
    let theta = theta0, spin = 0, began = 0, spring = 0, centre = 0, push = 0, resting = 0, sides = 0;

    // Sets omega, and the acceleration (y - centre) spring + push - drag v of all free slices, from sums over all slices.
    function balance(first, second, speed, angle) {
      const body = mass + m * resting;
      spin = momentum / inertia(first, second, (m * first) / M);
      spring = spin * spin;
      centre = free ? (m * wall * sides) / body : (m * first) / M;
      push = free ? (-drag * m * speed) / body : g * Math.cos(angle) + (drag * m * speed) / M;
      return spin;
    }
    function weigh(at, speeds, angle) {
      let first = 0, second = 0, speed = 0;
      resting = sides = 0;
      for (let i = 0; i < n; i++) {
        first += at[i];
        second += at[i] * at[i];
        speed += speeds[i];
        resting += Math.abs(side[i]);
        sides += side[i];
      }
      return balance(first, second, speed, angle);
    }
    const pressure = (end) => end * (spring * (end * wall - centre) + push), presses = (end) => pressure(end) >= 0;
    // Writes places and speeds after a time h to y1 and v1; returns the angle.
    function step(h) {
      ys[0].set(y);
      vs[0].set(v);
      began = weigh(y, v, theta);
      let angle = theta + WEIGHT[0] * h * spin;
      for (let k = 0; k < 4; k++) {
        const at = ys[k], speeds = vs[k], a = as[k], nextY = ys[k + 1], nextV = vs[k + 1], part = PART[k] * h;
        let first = 0, second = 0, speed = 0;
        for (let i = 0; i < n; i++) {
          a[i] = side[i] ? 0 : spring * (at[i] - centre) + push - drag * speeds[i];
          const there = (nextY[i] = y[i] + part * speeds[i]);
          first += there;
          second += there * there;
          speed += nextV[i] = v[i] + part * a[i];
        }
        if (k < 3) angle += WEIGHT[k + 1] * h * balance(first, second, speed, theta + part * spin);
      }
      for (let i = 0; i < n; i++) {
        y1[i] = y[i] + (h / 6) * (va[i] + 2 * (vb[i] + vc[i]) + vd[i]);
        v1[i] = v[i] + (h / 6) * (aa[i] + 2 * (ab[i] + ac[i]) + ad[i]);
      }
      return angle;
    }
    // When, as a share x of h, slice i first is beyond its end on the cubic y + x (b + x (c2 + x c3)); 2 if never.
    function crossing(i, h) {
      const end = Math.sign(y1[i]), from = end * y[i] - wall, to = end * y1[i] - wall, b = h * end * v[i], d = h * end * v1[i];
      if (side[i] || (to <= 0 && !(b > 0 && d < 0))) return 2;
      const c2 = 3 * (to - from) - 2 * b - d, c3 = b + d - 2 * (to - from);
      const path = (x) => from + x * (b + x * (c2 + x * c3));
      // Who turns back within the step is farthest out where its speed is zero.
      let low = 0, high = to > 0 ? 1 : Math.min(1, b / (Math.sqrt(Math.max(0, c2 * c2 - 3 * c3 * b)) - c2));
      if (!(path(high) > 0)) return 2;
      for (let k = 0; k < 54; k++) {
        const middle = (low + high) / 2;
        if (path(middle) > 0) high = middle;
        else low = middle;
      }
      // Who stands on its end and is hardly pushed is looked at again when the step is over.
      return high < 1e-9 && Math.abs(b) < 1e-9 * wall ? 1 : high;
    }
    // Sets places and speeds to those of the cubics at the share x of a step h whose end is known.
    function turnTo(x, h) {
      for (let i = 0; i < n; i++) {
        const b = h * v[i], d = h * v1[i], c2 = 3 * (y1[i] - y[i]) - 2 * b - d, c3 = b + d - 2 * (y1[i] - y[i]);
        v[i] = (b + x * (2 * c2 + 3 * x * c3)) / h;
        y[i] += x * (b + x * (c2 + x * c3));
      }
    }
    // The velocity V that the tube gains: the zero of V - (m / M_b) sum s max(0, (1 + e) x - s V), x speeds of approach.
    function gained(hits) {
      const approach = (i) => (side[i] ? 0 : (1 + e) * Math.abs(v[i])), touching = [...hits];
      for (let i = 0; i < n; i++) if (side[i]) touching.push(i);
      let high = hits.reduce((sum, i) => sum + approach(i), 0), low = -high, V = 0;
      for (let k = 0; k < 60; k++) {
        let [off, slope] = [V, 1];
        for (const i of touching) {
          const s = Math.sign(y[i]), left = approach(i) - s * V;
          if (left > 0) [off, slope] = [off - ratio * s * left, slope + ratio];
        }
        if (Math.abs(off) <= 1e-15 * high) break;
        [low, high] = off > 0 ? [low, V] : [V, high];
        V = V - off / slope > low && V - off / slope < high ? V - off / slope : (low + high) / 2;
      }
      return V;
    }
    // All that touch at one instant rebound together; who is slow and pressed on comes to rest, at the tube's expense.
    function rebound(hits) {
      const V = free ? gained(hits) : 0, before = hits.map((i) => Math.abs(v[i]));
      let loose = 0, still = 0;
      for (let i = 0; i < n; i++) {
        if (!side[i]) v[i] -= V;
        else if (side[i] * V > 0) [side[i], v[i]] = [0, -V];
      }
      hits.forEach((i, k) => {
        const s = Math.sign(y[i]);
        v[i] = -s * ((1 + e) * before[k] > s * V ? e * before[k] : Math.max(0, s * V - before[k]));
      });
      weigh(y, v, theta);
      for (let i = 0; i < n; i++) {
        if (!side[i] && Math.abs(y[i]) === wall && Math.abs(v[i]) < rest && presses(Math.sign(y[i]))) {
          loose += v[i];
          [side[i], v[i]] = [Math.sign(y[i]), 0];
        }
        still += Math.abs(side[i]);
      }
      for (let i = 0; free && i < n; i++) if (!side[i]) v[i] -= (ratio * loose) / (1 + ratio * still);
    }
    // Slices at rest leave when their end would have to pull them.
    function release() {
      for (const end of [1, -1]) {
        if (!side.includes(end)) continue;
        weigh(y, v, theta);
        if (!presses(end)) for (let i = 0; i < n; i++) if (side[i] === end) side[i] = 0;
      }
    }

    for (let i = 0; i < n; i++) side[i] = Math.abs(y[i]) === wall ? Math.sign(y[i]) : 0;
    release();
    omega[0] = weigh(y, v, theta);
    for (let k = 1; k <= (points - 1) * parts; k++) {
      let left = duration / ((points - 1) * parts);
      for (let tries = 0; left > 0 && tries < 1000; tries++) {
        const ends = [1, -1].filter((end) => side.includes(end));
        if (ends.length) weigh(y, v, theta);
        const pressed = ends.map(pressure), angle = step(left), turn = began * left;
        let when = 1, struck = -1;
        if (ends.length) weigh(y1, v1, angle);
        ends.forEach((end, k) => {
          if (!presses(end)) when = Math.min(when, pressed[k] / (pressed[k] - pressure(end)) + 1e-6);
        });
        for (let i = 0; i < n; i++) {
          const here = crossing(i, left);
          if (here < when || (here === when && struck < 0)) [when, struck] = [here, i];
        }
        turnTo(when, left);
        theta += when * (turn + when * (angle - theta - turn));
        left -= when * left;
        const touches = (i) => i === struck || (!side[i] && Math.abs(y[i]) >= wall * (1 - 1e-9) && v[i] * y[i] > 0);
        if (struck >= 0) {
          const hits = [];
          for (let i = 0; i < n; i++) if (touches(i)) hits.push(i);
          for (const i of hits) y[i] = Math.sign(y[i]) * wall;
          rebound(hits);
        }
        release();
      }
      if (k % parts === 0) omega[k / parts] = weigh(y, v, theta);
    }
    return omega;
  }

  return { program, eq8: (thrown, ...how) => flow(thrown, false, ...how), free: (thrown, ...how) => flow(thrown, true, ...how) };
})();
