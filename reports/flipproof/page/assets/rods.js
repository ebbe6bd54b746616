// Water as infinitely many rods that cannot overlap and do not bounce (ode_reference/rods.py); joins live.js.
//   cap | pile p |    free water, x = a A(t) + z(t)    | pile q | base at B from C_M       J omega is constant
// Below the threshold nothing moves; above it water parts, and stays on the pile that it meets.
window.flipproofLive.rods = (thrown, points = 1000, seen = null) => {
  const { bottle: { length, radius, mass, capacity }, fill, gamma, omega0, duration } = thrown;
  const drag = 2 * gamma, water = fill * capacity, total = water + mass, depth = fill * length, density = water / depth;
  const below = ((water * depth) / 2 + (mass * length) / 2) / total, above = depth - below;
  const own = mass * (radius * radius / 2 + length * length / 12);
  const lying = (ratio) => (Math.sqrt(mass * mass + density * (mass * length + 2 * total * ratio)) - mass) / density;
  const piles = (grown, z, arrived) => {
    if (!arrived) {
      const base = lying(grown > 0 ? z / grown : 0);
      return { base, cap: 0, foot: below + grown * (below - base) + z };
    }
    const piled = depth - (length - depth) / grown;
    const pulled = ((length - piled) * (below - above)) / 2 + z * (depth - piled);
    const foot = length / 2 - (density * pulled) / (mass + density * piled), base = below + (below + z - foot) / grown;
    return { base, cap: piled - base, foot };
  };
  const inertia = (grown, z, { base, cap, foot }) => {
    const top = foot - length, a = 1 + grown;
    const free = ((a * (below - base) + z) ** 3 + (a * (above - cap) - z) ** 3) / a;
    const cubes = foot ** 3 - (foot - base) ** 3 + (top + cap) ** 3 - top ** 3 + free;
    return own + mass * (foot - length / 2) ** 2 + (density * cubes) / 3;
  };
  const momentum = inertia(0, 0, piles(0, 0, false)) * omega0;
  const spin = (grown, z, arrived) => momentum / inertia(grown, z, piles(grown, z, arrived));
  const slope = ([grown, rate, z, drift], arrived) => {
    const at = piles(grown, z, arrived), low = below - at.base, high = above - at.cap, pull = (momentum / inertia(grown, z, at)) ** 2;
    const free = (low + high) * ((rate * (low - high)) / 2 + drift), speed = (-density * free) / (mass + density * (at.base + at.cap));
    return [rate, pull * (1 + grown) - drag * rate, drift, pull * z - drag * (drift - speed)];
  };
  const along = (y, k, t) => y.map((value, i) => value + t * k[i]);
  const step = (y, t, arrived) => {
    const k1 = slope(y, arrived), k2 = slope(along(y, k1, t / 2), arrived), k3 = slope(along(y, k2, t / 2), arrived);
    const k4 = slope(along(y, k3, t), arrived);
    return y.map((value, i) => value + (t / 6) * (k1[i] + 2 * (k2[i] + k3[i]) + k4[i]));
  };
  const room = ([grown, , z]) => z - (1 + grown) * above - piles(grown, z, false).foot + length;
  const parts = window.flipproofLive.cuts(duration / (points - 1), 20 * Math.abs(omega0), drag * (1 + water / mass));
  const dt = duration / (points - 1) / parts, computed = parts <= window.flipproofLive.MOST;
  const omega = new Float64Array(points).fill(computed ? omega0 : NaN), spreads = computed && depth < length && depth > lying(0);
  let y = [0, 0, 0, 0], arrived = false;
  // `seen` hears the piles at base and cap, and where the free water between them begins and ends, from the cap.
  const keep = (k) => {
    const [grown, , z] = y, at = piles(grown, z, arrived), a = 1 + grown, top = at.foot - length;
    if (spreads) omega[k] = spin(grown, z, arrived);
    if (seen) seen(spreads ? { base: at.base, cap: at.cap, from: z - a * (above - at.cap) - top, to: z + a * (below - at.base) - top } : { base: depth, cap: 0, from: 0, to: 0 }, -top);
  };
  keep(0);
  for (let k = 1; k < points; k++) {
    for (let part = 0; spreads && part < parts; part++) {
      let next = step(y, dt, arrived);
      if (!arrived && room(next) < 0) {
        let [low, high] = [0, dt];
        for (let i = 0; i < 40; i++) [low, high] = room(step(y, (low + high) / 2, false)) < 0 ? [low, (low + high) / 2] : [(low + high) / 2, high];
        arrived = true;
        next = step(step(y, high, false), dt - high, true);
      }
      y = next;
    }
    keep(k);
  }
  return omega;
};
