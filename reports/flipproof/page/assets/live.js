// Three solvers in the reader's browser, and the sliders that set what they throw: the published program's own step;
// Eq. 8 and free flight by Runge-Kutta steps of order 4 that end at every impact.
//   cap  y = -wall |------ o -- o - C_M ---- o -- o -| y = +wall  base     y = r - L/2; a slice at rest has side = +1, -1
window.flipproofLive = (() => {
  "use strict";
  const PART = [1 / 2, 1 / 2, 1, 0], WEIGHT = [1 / 6, 1 / 3, 1 / 3, 1 / 6], ENDS = [1, -1]; // of Runge and Kutta; base and cap

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

  // One stage of a step, for all slices: writes accelerations a, and places and speeds after a time `part` of the next stage.
  function stage(y, v, at, speeds, side, a, nextY, nextV, part, { spring, centre, push }, drag) {
    for (let i = 0; i < y.length; i++) {
      const speed = speeds[i], pull = side[i] ? 0 : spring * (at[i] - centre) + push - drag * speed;
      a[i] = pull;
      nextY[i] = y[i] + part * speed;
      nextV[i] = v[i] + part * pull;
    }
  }
  // Writes places and speeds after a whole step of four stages.
  function combine(y, v, [v0, v1, v2, v3], [a0, a1, a2, a3], h, nextY, nextV) {
    for (let i = 0; i < y.length; i++) {
      nextY[i] = y[i] + (h / 6) * (v0[i] + 2 * (v1[i] + v2[i]) + v3[i]);
      nextV[i] = v[i] + (h / 6) * (a0[i] + 2 * (a1[i] + a2[i]) + a3[i]);
    }
  }

  // In how many parts a step between two points is cut. Spin, weight and drag each want short steps [1/s]: long flights, in
  // which errors grow, and strong drag, which pulls a light bottle along, get more. What wants more than MOST is not computed.
  const MOST = 400;
  const cuts = (step, ...rates) => Math.max(1, Math.ceil(step * Math.max(...rates) * (1 - 1e-9)));
  const percent = (share) => (Number.isFinite(share) ? `${Number((100 * (share < 1e-8 ? 0 : share)).toPrecision(share < 1 ? 2 : 3))} %` : "not computable");

  const farthest = (one, other) => one.reduce((most, value, k) => Math.max(most, Math.abs(value - other[k])), 0);

  const restSpeed = ({ omega0, bottle }) => Math.max(1e-5, 1e-3 * Math.min(1, (Math.abs(omega0) * bottle.length) / 5.6));

  // Omega of Eq. 8, or of free flight, at equal times. A slice slower than `rest` that its end presses on rests there;
  // in free flight `rest` is a share of the speeds in the throw.
  // `seen` hears at each of these times the places of the slices, the angle and the centre of mass. Numbers are NaN, and
  // nothing moves, if the steps would be too short.
  function flow(thrown, free, points = 1000, seen = null, least = free ? 2 : 1, rest = free ? restSpeed(thrown) : 1e-5) {
    const { n, m, M, mass, wall, y, v, inertia, momentum, gamma, g, e, theta0, duration, omega0, bottle } = prepared(thrown);
    const spinning = Math.abs(omega0), falling = free ? 0 : Math.sqrt(Math.abs(g) / bottle.length);
    const rates = [20 * spinning * Math.max(1, (spinning * duration) / 12.5), 50 * falling * Math.max(1, (falling * duration) / 3)];
    const wanted = Math.max(least, cuts(duration / (points - 1), ...rates, 2 * gamma * (free ? 1 + (m * n) / mass : 1)));
    const parts = Math.min(wanted, MOST);
    const side = y.map((place) => (Math.abs(place) === wall ? Math.sign(place) : 0)), ratio = m / mass, drag = 2 * gamma;
    const rows = () => Array.from({ length: 5 }, () => new Float64Array(n)), [ys, vs, as] = [rows(), rows(), rows()];
    const omega = new Float64Array(points), y1 = ys[4], v1 = vs[4];
    // Omega, and the acceleration (y - centre) spring + push - drag v of all free slices: kept in one object, since a browser
    // makes a new number at every change of a variable that functions share.
    const felt = { spin: 0.5, spring: 0.5, centre: 0.5, push: 0.5, began: 0.5 }, hits = [];
    let theta = theta0, resting = 0, sides = 0;

    // Counts slices at rest, and those at the base less those at the cap; called when one comes to rest or leaves.
    function count() {
      resting = sides = 0;
      for (const end of side) { resting += end * end; sides += end; }
    }
    const rests = (end) => resting + end * sides > 0;

    // Sets what is felt, from sums over all slices; returns omega.
    function weigh(at, speeds, angle) {
      let first = 0, second = 0, speed = 0;
      for (let i = 0; i < n; i++) {
        first += at[i];
        second += at[i] * at[i];
        speed += speeds[i];
      }
      const body = mass + m * resting;
      const spin = momentum / inertia(first, second, (m * first) / M);
      felt.spin = spin;
      felt.spring = spin * spin;
      felt.centre = free ? (m * wall * sides) / body : (m * first) / M;
      felt.push = free ? (-drag * m * speed) / body : g * Math.cos(angle) + (drag * m * speed) / M;
      return spin;
    }
    const pressure = (end) => end * (felt.spring * (end * wall - felt.centre) + felt.push);
    // Writes places and speeds after a time h to y1 and v1; returns the angle.
    function step(h) {
      let angle = theta;
      for (let k = 0; k < 4; k++) {
        const at = k ? ys[k] : y, speeds = k ? vs[k] : v, a = as[k], nextY = ys[k + 1], nextV = vs[k + 1], part = PART[k] * h;
        angle += WEIGHT[k] * h * weigh(at, speeds, k ? theta + PART[k - 1] * h * felt.spin : theta);
        if (!k) felt.began = felt.spin;
        stage(y, v, at, speeds, side, a, nextY, nextV, part, felt, drag);
      }
      combine(y, v, [v, vs[1], vs[2], vs[3]], as, h, y1, v1);
      return angle;
    }
    // When, as a share x of h, slice i first is beyond its end on the cubic y + x (b + x (c2 + x c3)); 2 if never, or not
    // before another slice is.
    function crossing(i, h, before) {
      const end = Math.sign(y1[i]), from = end * y[i] - wall, to = end * y1[i] - wall, b = h * end * v[i], d = h * end * v1[i];
      if (to <= 0 && !(b > 0 && d < 0)) return 2;
      const c2 = 3 * (to - from) - 2 * b - d, c3 = b + d - 2 * (to - from), beyond = (x) => from + x * (b + x * (c2 + x * c3)) > 0;
      // Who turns back within the step is farthest out where its speed is zero.
      let low = 0, high = to > 0 ? 1 : Math.min(1, b / (Math.sqrt(Math.max(0, c2 * c2 - 3 * c3 * b)) - c2));
      if (!beyond(high) || (before < high && !beyond(before))) return 2;
      for (let k = 0; k < 54; k++) {
        const middle = (low + high) / 2;
        if (beyond(middle)) high = middle;
        else low = middle;
      }
      // Who stands on its end and is hardly pushed is looked at again when the step is over.
      return high < 1e-9 && Math.abs(b) < 1e-9 * wall ? 1 : high;
    }
    // Slices that touch one end together rebound; the tube gains V toward it, and takes along who rests on the other end.
    function rebound(end) {
      const speed = (i) => Math.abs(v[i]);
      let sum = 0, weight = 1, loose = 0, body = 1;
      for (let i = 0; i < n; i++) if (side[i] === -end) weight += ratio;
      if (hits.length > 1) hits.sort((i, j) => speed(j) - speed(i));
      for (const i of hits) {
        if (!free || (1 + e) * speed(i) * weight <= ratio * sum) continue;
        sum += (1 + e) * speed(i);
        weight += ratio;
      }
      const V = (ratio * sum) / weight;
      for (let i = 0; i < n; i++) {
        if (hits.includes(i)) v[i] = -end * ((1 + e) * speed(i) > V ? e * speed(i) : V - speed(i));
        else if (!side[i]) v[i] -= end * V;
        else if (side[i] === end && V) { side[i] = 0; v[i] = -end * V; }
      }
      // Who is slow and pressed on comes to rest, at the expense of the tube.
      count();
      weigh(y, v, theta);
      for (let i = 0; i < n; i++) {
        if (!side[i] && Math.abs(y[i]) === wall && Math.abs(v[i]) < rest && pressure(Math.sign(y[i])) >= 0) {
          loose += v[i];
          side[i] = Math.sign(y[i]);
          v[i] = 0;
        }
        if (side[i]) body += ratio;
      }
      count();
      const share = free ? (ratio * loose) / body : 0;
      if (share) for (let i = 0; i < n; i++) if (!side[i]) v[i] -= share;
    }
    // Slices at rest leave when their end would have to pull them.
    function release() {
      for (const end of ENDS) {
        if (!rests(end)) continue;
        weigh(y, v, theta);
        if (pressure(end) >= 0) continue;
        for (let i = 0; i < n; i++) if (side[i] === end) side[i] = 0;
        count();
      }
    }

    const centred = () => (m * y.reduce((sum, place) => sum + place, 0)) / M;
    const keep = (k) => { omega[k] = weigh(y, v, theta); seen?.(y, theta, centred()); };
    count();
    release();
    keep(0);
    if (wanted > MOST) {
      for (let k = 1; k < points; k++) keep(k);
      return omega.fill(NaN);
    }
    for (let k = 1; k <= (points - 1) * parts; k++) {
      let left = duration / ((points - 1) * parts);
      for (let tries = 0; left > 0 && tries < 1000; tries++) {
        const ends = ENDS.filter(rests);
        if (ends.length) weigh(y, v, theta);
        const pressed = ends.map(pressure), angle = step(left), turn = felt.began * left;
        let when = 1, struck = -1;
        if (ends.length) weigh(y1, v1, angle);
        ends.forEach((end, k) => {
          if (pressure(end) < 0) when = Math.min(when, pressed[k] / (pressed[k] - pressure(end)) + 1e-6);
        });
        for (let i = 0; i < n; i++) {
          if (side[i] || (Math.abs(y1[i]) <= wall && v[i] * v1[i] > 0)) continue;
          const here = crossing(i, left, when);
          if (here < when || (here === when && struck < 0)) { when = here; struck = i; }
        }
        for (let i = 0; i < n && when < 1; i++) {
          const way = y1[i] - y[i], b = left * v[i], d = left * v1[i], c2 = 3 * way - 2 * b - d, c3 = b + d - 2 * way;
          v[i] = (b + when * (2 * c2 + 3 * when * c3)) / left;
          y[i] += when * (b + when * (c2 + when * c3));
        }
        if (when === 1) { y.set(y1); v.set(v1); }
        theta += when * (turn + when * (angle - theta - turn));
        left -= when * left;
        for (const end of struck < 0 ? [] : ENDS) {
          hits.length = 0;
          for (let i = 0; i < n; i++) {
            if (end * y[i] > 0 && (i === struck || (!side[i] && end * y[i] >= wall * (1 - 1e-9) && end * v[i] > 0))) hits.push(i);
          }
          for (const i of hits) y[i] = end * wall;
          if (hits.length) rebound(end);
        }
        release();
      }
      if (k % parts === 0) keep(k / parts);
    }
    return omega;
  }

  return { MOST, cuts, percent, farthest, restSpeed, program, eq8: (thrown, ...how) => flow(thrown, false, ...how), free: (thrown, ...how) => flow(thrown, true, ...how) };
})();
