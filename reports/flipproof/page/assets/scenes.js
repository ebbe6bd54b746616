// The bottles of the story: each scene throws one or two of them, solved by live.js, and has one control that changes it.
(() => {
  "use strict";
  const { g, theta0, fill, gamma, e, omega0, ...fixed } = JSON.parse(document.getElementById("live-data").textContent);
  const start = { ...fixed, g, theta0, fill, gamma, e, omega0 }, chart = window.flipproofChart, live = window.flipproofLive;
  const NAMES = { eq8: "Eq. 8", free: "free flight", rods: "rods", still: "Eq. 8 without gravity", bare: "Eq. 8 without gravity and drag" };
  const COLOURS = { eq8: "eq8", free: "free-flight", rods: "rods", still: "eq8", bare: "eq8" };
  const FRAMES = 251, SLOW = 9;
  const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const { percent, farthest } = live;

  // A flight as frames: omega / omega_0, angle, centre of mass and water, both from the cap.
  function flight(solver, thrown) {
    const half = thrown.bottle.length / 2, share = (omega) => omega / thrown.omega0, theta = new Float64Array(FRAMES), centre = [], water = [];
    if (solver === "rods") {
      const omega = live.rods(thrown, FRAMES, (piles, place) => { water.push(piles); centre.push(place); });
      theta[0] = thrown.theta0;
      for (let k = 1; k < FRAMES; k++) theta[k] = theta[k - 1] + ((omega[k - 1] + omega[k]) / 2) * (thrown.duration / (FRAMES - 1));
      return { spin: omega.map(share), theta, centre, water };
    }
    const bare = solver === "bare", set = bare || solver === "still" ? { ...thrown, g: 0, gamma: bare ? 0 : thrown.gamma } : thrown;
    const omega = live[set === thrown ? solver : "eq8"](set, FRAMES, (y, angle, place) => {
      theta[water.length] = angle;
      water.push(Float64Array.from(y, (at) => at + half));
      centre.push(place + half);
    });
    return { spin: omega.map(share), theta, centre, water };
  }

  function scene(root) {
    const solvers = root.dataset.bottles.split(" "), usual = start;
    const [BOTTLES, CURVES] = root.closest(".idea") ? [165, 85] : [235, 95];
    const canvas = root.querySelector("canvas"), slider = root.querySelector("input"), button = root.querySelector(".gravity");
    const said = root.querySelector("[role=status]"), pen = canvas.getContext("2d");
    let thrown = usual, before = null, now = [], frame = FRAMES - 1, playing = 0;
    const solve = () => { now = solvers.map((solver) => flight(solver, thrown)); };

    function bottle(at, flown, scale, [x, y], k, shade = 1) {
      const { length, radius } = fixed.bottle, half = radius * scale, tall = length * scale;
      const height = Math.max(1.5, (thrown.fill * tall) / start.slices);
      pen.save();
      pen.translate(x, y);
      pen.rotate(-flown.theta[k]);
      pen.translate(0, -flown.centre[k] * scale);
      pen.fillStyle = style("--water-low");
      const water = flown.water[k];
      const block = (from, to, dense) => { pen.globalAlpha = dense * shade; pen.fillRect(1 - half, from * scale, 2 * half - 2, Math.max(0, to - from) * scale); };
      if (at === "rods") {
        const free = Math.max(0, thrown.fill * length - water.base - water.cap), room = water.to - water.from;
        block(0, water.cap, 0.8);
        block(length - water.base, length, 0.8);
        if (room > 0) block(water.from, water.to, 0.8 * Math.min(1, free / room));
      } else {
        pen.globalAlpha = 0.45 * shade;
        for (const place of water) pen.fillRect(1 - half, place * scale - height / 2, 2 * half - 2, height);
      }
      pen.globalAlpha = shade;
      pen.strokeStyle = style("--ink");
      pen.lineWidth = 2;
      pen.strokeRect(-half, 0, 2 * half, tall);
      pen.strokeRect(-0.4 * half, -0.3 * half, 0.8 * half, 0.3 * half);
      pen.restore();
    }
    // On its way over the picture: a parabola, or a straight line where gravity is off or no solver knows it.
    function place(share, left, wide, reach) {
      const bent = solvers.every((solver) => solver === "still" || solver === "bare") ? 0 : Math.min(1, thrown.g / 9.81), rise = Math.max(24, BOTTLES - 22 - 1.6 * reach);
      return [left + reach + share * (wide - 2 * reach), 22 + (BOTTLES - 22) / 2 + bent * rise * (4 * (share - 0.5) ** 2 - 0.5)];
    }
    function draw() {
      const width = canvas.parentElement.clientWidth, height = BOTTLES + CURVES, ratio = window.devicePixelRatio || 1;
      if (!width) return;
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
      pen.setTransform(ratio, 0, 0, ratio, 0, 0);
      const wide = width / solvers.length, scale = Math.min(106, 0.4 * wide) / Math.max(fixed.bottle.length, 2 * fixed.bottle.radius), reach = 0.85 * fixed.bottle.length * scale;
      const high = Math.max(1, ...[...now, ...(before ?? [])].flatMap(({ spin }) => [...spin]).filter(Number.isFinite)) * 1.05;
      const down = (value) => height - 18 - (value / high) * (CURVES - 30);
      const across = (k, left) => left + 8 + (k / (FRAMES - 1)) * (wide - 22);
      solvers.forEach((solver, j) => {
        const left = j * wide, flown = now[j], colour = style(`--solver-${COLOURS[solver]}`);
        pen.strokeStyle = style("--line");
        pen.lineWidth = 1.5;
        pen.beginPath();
        for (let k = 0; k <= 40; k++) pen.lineTo(...place(k / 40, left, wide, reach));
        pen.moveTo(left + 8, height - 18);
        pen.lineTo(left + wide - 14, height - 18);
        pen.stroke();
        const ghosts = wide < 330 ? 125 : 50;
        for (let k = 0; k < frame - 20; k += ghosts) bottle(solver, flown, scale, place(k / (FRAMES - 1), left, wide, reach), k, 0.4);
        bottle(solver, flown, scale, place(frame / (FRAMES - 1), left, wide, reach), frame);
        const curve = (spin, end, faint) => {
          pen.globalAlpha = faint ? 0.4 : 1;
          pen.strokeStyle = faint ? style("--soft") : colour;
          pen.lineWidth = faint ? 4 : 2;
          pen.beginPath();
          for (let k = 0; k <= end; k++) pen.lineTo(across(k, left), down(spin[k]));
          pen.stroke();
          pen.globalAlpha = 1;
        };
        if (before) curve(before[j].spin, FRAMES - 1, true);
        curve(flown.spin, frame, false);
        pen.font = `600 14px ${getComputedStyle(canvas).fontFamily}`;
        pen.fillStyle = colour;
        pen.fillText(NAMES[solver], left + 8, 16);
        pen.font = `12px ${getComputedStyle(canvas).fontFamily}`;
        pen.fillStyle = style("--soft");
        const share = Number.isFinite(flown.spin[frame]) ? `${(100 * flown.spin[frame]).toFixed(0)} %` : percent(NaN), time = `${(fixed.duration * frame / (FRAMES - 1)).toFixed(2)} s`;
        const spin = `${time}: spin ${share}`, whole = `${spin} of the initial spin`;
        pen.fillText(pen.measureText(whole).width < wide - 22 ? whole : spin, left + 8, height - 6);
      });
    }
    function stop() { cancelAnimationFrame(playing); playing = 0; }
    function play() {
      stop();
      if (matchMedia("(prefers-reduced-motion: reduce)").matches) { frame = FRAMES - 1; draw(); return; }
      const began = performance.now();
      const next = (time) => {
        frame = Math.max(0, Math.min(FRAMES - 1, Math.round(((time - began) / 1000 / SLOW / fixed.duration) * (FRAMES - 1))));
        draw();
        playing = frame < FRAMES - 1 ? requestAnimationFrame(next) : 0;
      };
      playing = requestAnimationFrame(next);
    }
    function told() {
      if (!before) return;
      const moved = now.map(({ spin }, j) => farthest(spin, before[j].spin));
      if (slider) said.textContent = now.map((_, j) => `${NAMES[solvers[j]]}: ω/ω₀ moves by up to ${percent(moved[j])}.`).join(" ") + " Grey: the first throw.";
      else said.textContent = thrown.g === usual.g
        ? root.dataset.asked
        : `Gravity is ${thrown.g ? "on (grey: off)" : "off (grey: on)"}. This moves the spin of Eq. 8 by up to ${percent(moved[0])} of the initial spin, that of free flight by ${percent(moved[1])}. Gravity makes bottle and water fall together: in flight it cannot move one against the other.`;
      root.dataset.moved = moved.map((share) => share.toPrecision(6)).join(" ");
    }
    function set(change) {
      if (!now.length) solve();
      before ??= now;
      thrown = { ...thrown, ...change };
      solve();
      told();
    }
    button?.addEventListener("click", () => {
      set({ g: thrown.g ? 0 : usual.g || 9.81 });
      button.setAttribute("aria-checked", String(thrown.g !== 0));
      play();
    });
    slider?.addEventListener("input", () => {
      const { unit, digits } = slider.dataset, value = Number(slider.value);
      slider.closest("label").querySelector("output").textContent = `${chart.shown(value, Number(digits))}${unit === "°" ? "" : " "}${unit}`.trim();
      stop();
      frame = FRAMES - 1;
      set({ [slider.name]: value * ({ "%": 0.01, "°": Math.PI / 180 }[unit] ?? 1) });
      draw();
    });
    root.querySelector(".again").addEventListener("click", play);
    // Solved and thrown once, when it is first seen.
    new IntersectionObserver((entries, watcher) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      watcher.disconnect();
      solve();
      draw();
      chart.onWidth(canvas.parentElement, draw);
      play();
    }, { threshold: 0.3 }).observe(root);
    window.addEventListener("beforeprint", () => { stop(); frame = FRAMES - 1; if (!now.length) solve(); draw(); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (now.length) draw(); });
  }
  for (const root of document.querySelectorAll(".scene")) scene(root);
})();
