// Water as one column that stretches uniformly, so that it cannot overlap (ode_reference/column.py); joins live.js.
//   cap |     empty     |<------ h ------>| base     m_e h'' = omega^2 J'(h)/2 - (N alpha/3) h',   J omega is constant
// It rests at its height until spin presses its front toward the cap, and stays spread once the front is there, h = L.
window.flipproofLive.column = (thrown) => {
  "use strict";
  const { bottle: { length, radius, mass, capacity }, fill, gamma, omega0, duration } = thrown;
  const points = 1000;
  const water = fill * capacity, reduced = (water * mass) / (water + mass), rub = (2 / 3) * gamma * water;
  const own = mass * (radius * radius / 2 + length * length / 12), effective = water / 3 - (water * water) / (4 * (water + mass));
  const inertia = (h) => (water * h * h) / 12 + (reduced * (length - h) ** 2) / 4 + own;
  const growth = (h) => (water * h) / 6 - (reduced * (length - h)) / 2; // dJ/dh
  const momentum = inertia(fill * length) * omega0, spin = (h) => momentum / inertia(h);
  const pull = (h, speed) => ((spin(h) ** 2 * growth(h)) / 2 - rub * speed) / effective;
  const omega = new Float64Array(points).fill(omega0), spreads = growth(fill * length) > 0;
  const parts = window.flipproofLive.cuts(duration / (points - 1), 20 * Math.abs(omega0), rub / effective);
  if (parts > window.flipproofLive.MOST) return omega.fill(NaN);
  const dt = duration / (points - 1) / parts;
  let h = fill * length, speed = 0;
  for (let k = 1; spreads && k < points; k++) {
    for (let part = 0; part < parts && h < length; part++) {
      const a1 = pull(h, speed), v2 = speed + (dt / 2) * a1, a2 = pull(h + (dt / 2) * speed, v2);
      const v3 = speed + (dt / 2) * a2, a3 = pull(h + (dt / 2) * v2, v3), v4 = speed + dt * a3, a4 = pull(h + dt * v3, v4);
      h = Math.min(length, h + (dt / 6) * (speed + 2 * (v2 + v3) + v4));
      speed += (dt / 6) * (a1 + 2 * (a2 + a3) + a4);
    }
    omega[k] = spin(h);
  }
  return omega;
};
