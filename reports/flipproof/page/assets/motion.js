// The player of the flights: bottles on a canvas, traces with a common cursor, controls. State: one time.
(() => {
  "use strict";
  const root = document.getElementById("motion");
  const source = document.getElementById("motion-data");
  if (!root || !source) return;
  root.classList.add("motion-alive");
  root.querySelector("details").open = false;
  const data = JSON.parse(source.textContent);
  const chart = window.flipproofChart;

  const MOMENT = 1e-6; // seconds within which impacts count as one moment
  const STROBE = 0.05; // seconds between the faint outlines
  const LONGEST_STEP = 250; // ms of real time after which a sleeping page does not catch up
  const TALK = 1500; // ms between two sentences to a screen reader while playing
  const QUIET = 300; // ms between two sentences otherwise
  const REFRESH = 100; // ms between two updates of the table while playing
  const NARROWEST = 190; // px of a bottle's cell before bottles go into two rows
  const TRACE_HEIGHT = 190;
  const BRIGHT = 0.5; // opacity of one slice

  const parts = new Map([...root.querySelectorAll("[data-testid]")].map((node) => [node.dataset.testid, node]));
  const find = (name) => parts.get(`motion-${name}`);
  const stage = find("stage");
  const pen = stage.getContext("2d");
  const reach = data.frames - 1;
  const frameTime = data.duration / reach;

  const flights = data.flights.map(unpacked);
  const box = extent();
  const state = { time: 0, playing: false, rate: Number(find("rate").value), view: "lab", visible: new Set(flights.map((f) => f.name)) };
  let colours = {};
  let scales = [];
  let places = new Map();
  let width = 0; // of the stage [px]; to ask for it at every frame would lay the page out anew
  let drawn = 0;
  let before = null;
  let talked = -Infinity;
  let refreshed = -Infinity;
  let waiting = 0;

  // ---------------------------------------------------------------- data

  function unpacked(packed) {
    const flight = {
      name: packed.name, words: packed.words, status: packed.status, reached: packed.reached, slices: packed.drawn.length, numbers: packed.drawn,
      theta: chart.numbers(packed.theta, Float32Array), omega: chart.numbers(packed.omega, Float32Array),
      centre: chart.numbers(packed.r_cm, Float32Array), r: chart.numbers(packed.r, Int16Array), moments: null,
    };
    if (packed.impacts) {
      const time = chart.numbers(packed.impacts.time, Float32Array);
      const slice = chart.numbers(packed.impacts.slice, Uint32Array);
      const end = chart.numbers(packed.impacts.end, Int16Array);
      const speed = chart.numbers(packed.impacts.speed, Float32Array);
      flight.moments = [];
      for (let k = 0; k < time.length; k++) {
        const last = flight.moments.at(-1);
        if (last && time[k] - last.time < MOMENT) last.hits.push(k);
        else flight.moments.push({ time: time[k], hits: [k] });
      }
      flight.tell = (k) => `slice ${slice[k]} hits the ${end[k] > 0 ? "base" : "cap"} at ${chart.shown(speed[k], 3)} m/s`;
    }
    return flight;
  }

  // The two frames around a time and the share of the second; a flight that ended early stays at its last frame.
  function between(flight, time) {
    const exact = Math.min(Math.max(time / frameTime, 0), flight.reached - 1);
    const k = Math.min(Math.floor(exact), Math.max(flight.reached - 2, 0));
    return { k, next: Math.min(k + 1, flight.reached - 1), share: exact - k };
  }

  function mixed(values, place) {
    return values[place.k] + (values[place.next] - values[place.k]) * place.share;
  }

  // Lab-frame state of a bottle [m, rad]: C_M on the parabola, cap and base along u_r = (sin θ, −cos θ).
  function posture(flight, time) {
    const place = between(flight, time);
    const t = Math.min(time, (flight.reached - 1) * frameTime);
    const theta = mixed(flight.theta, place);
    const r = mixed(flight.centre, place);
    const [vx, vy] = data.launch_velocity;
    const centre = [data.release[0] + vx * t, data.release[1] + vy * t - 0.5 * data.gravity * t * t];
    const along = [Math.sin(theta), -Math.cos(theta)];
    const at = (distance) => [centre[0] + distance * along[0], centre[1] + distance * along[1]];
    return { theta, omega: mixed(flight.omega, place), r, centre, cap: at(-r), base: at(data.length - r), place };
  }

  function extent() {
    const found = { left: Infinity, right: -Infinity, low: Infinity, high: -Infinity };
    for (const flight of flights) {
      flight.paths = [];
      for (let k = 0; k < flight.reached; k++) {
        const { cap, base } = posture(flight, k * frameTime);
        flight.paths.push(base);
        for (const [x, y] of [cap, base]) {
          found.left = Math.min(found.left, x - data.radius);
          found.right = Math.max(found.right, x + data.radius);
          found.low = Math.min(found.low, y - data.radius);
          found.high = Math.max(found.high, y + data.radius);
        }
      }
    }
    return found;
  }

  // ---------------------------------------------------------------- the stage

  function readColours() {
    const style = getComputedStyle(root);
    const read = (name, otherwise) => style.getPropertyValue(name).trim() || otherwise;
    colours = {
      ink: read("--ink", "#000"), soft: read("--soft", "#555"), line: read("--line", "#ccc"), paper: read("--paper", "#fff"),
      glass: read("--glass", "#555"), low: read("--water-low", "#0b5cad"), high: read("--water-high", "#35b0c4"),
    };
    for (const flight of flights) {
      flight.colour = read(`--solver-${flight.name}`, read("--solver-other", "#8f3a84"));
      flight.tints = Array.from({ length: flight.slices }, (_, i) => blend(colours.low, colours.high, i / Math.max(flight.slices - 1, 1)));
    }
  }

  function blend(first, second, share) {
    const parts = (colour) => [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
    const [a, b] = [parts(first), parts(second)];
    return `rgb(${a.map((value, k) => Math.round(value + (b[k] - value) * share)).join(" ")})`;
  }

  function layout() {
    const shown = flights.filter((flight) => state.visible.has(flight.name));
    const count = Math.max(shown.length, 1);
    const rows = Math.ceil(count / Math.max(Math.floor(width / NARROWEST), 2));
    const columns = Math.ceil(count / rows);
    const cell = { width: width / columns, label: 26 };
    const natural = (cell.width * (box.high - box.low)) / (box.right - box.left);
    cell.height = Math.min(Math.max(natural, 150), 380) + cell.label;
    return { shown, columns, rows, cell, width, height: Math.round(rows * cell.height) };
  }

  function resize(plan) {
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(plan.width * ratio), Math.round(plan.height * ratio)];
    if (stage.width !== width || stage.height !== height) {
      stage.width = width;
      stage.height = height;
      stage.style.height = `${plan.height}px`;
    }
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, plan.width, plan.height);
  }

  function draw() {
    const plan = layout();
    resize(plan);
    places = new Map();
    plan.shown.forEach((flight, k) => {
      const corner = { x: (k % plan.columns) * plan.cell.width, y: Math.floor(k / plan.columns) * plan.cell.height };
      drawName(flight, corner, plan.cell);
      (state.view === "lab" ? drawInLab : drawUpright)(flight, corner, plan.cell);
    });
    drawn += 1;
  }

  function drawName(flight, corner, cell) {
    pen.font = "600 13px system-ui, sans-serif";
    pen.textBaseline = "middle";
    pen.fillStyle = flight.colour;
    pen.fillText(flight.words, corner.x + 8, corner.y + cell.label / 2 + 2, cell.width - 12);
    if (corner.x > 0) {
      pen.strokeStyle = colours.line;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.moveTo(corner.x + 0.5, corner.y + 6);
      pen.lineTo(corner.x + 0.5, corner.y + cell.height - 6);
      pen.stroke();
    }
  }

  function drawInLab(flight, corner, cell) {
    const room = { width: cell.width - 12, height: cell.height - cell.label - 8 };
    const scale = Math.min(room.width / (box.right - box.left), room.height / (box.high - box.low));
    const shift = [corner.x + cell.width / 2 - (scale * (box.left + box.right)) / 2, corner.y + cell.label + scale * box.high];
    const screen = ([x, y]) => [shift[0] + scale * x, shift[1] - scale * y];
    const line = (points) => {
      pen.beginPath();
      points.forEach((point, k) => (k ? pen.lineTo(...screen(point)) : pen.moveTo(...screen(point))));
      pen.stroke();
    };
    const now = posture(flight, state.time);

    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1.2;
    pen.setLineDash([2, 4]);
    line(Array.from({ length: 61 }, (_, k) => posture(flight, (k * data.duration) / 60).centre));
    pen.setLineDash([]);
    pen.globalAlpha = 0.28;
    for (let t = 0; t < state.time - 1e-9; t += STROBE) {
      const past = posture(flight, t);
      inBottle(screen(past.cap), past.theta, () => outline(scale, flight.colour, 1));
    }
    pen.globalAlpha = 0.9;
    pen.strokeStyle = flight.colour;
    pen.lineWidth = 1.4;
    line([...flight.paths.slice(0, now.place.k + 1), now.base]);
    pen.globalAlpha = 1;
    inBottle(screen(now.cap), now.theta, () => {
      water(flight, now.place, scale);
      outline(scale, colours.glass, 1.8);
      cross(now.r * scale);
    });
    places.set(flight.name, { ...now, pixel: screen(now.base) });
  }

  function drawUpright(flight, corner, cell) {
    const room = cell.height - cell.label - 34;
    const scale = room / data.length;
    const now = posture(flight, state.time);
    const cap = [corner.x + cell.width / 2, corner.y + cell.label + 18];
    inBottle(cap, 0, () => {
      water(flight, now.place, scale);
      outline(scale, colours.glass, 1.8);
      cross(now.r * scale);
    });
    pen.font = "12px system-ui, sans-serif";
    pen.fillStyle = colours.soft;
    const beside = cap[0] + data.radius * scale + 8;
    pen.fillText("cap", beside, cap[1]);
    pen.fillText("base", beside, cap[1] + data.length * scale);
    pen.fillStyle = colours.ink;
    pen.fillText("C_M", beside, cap[1] + now.r * scale);
    places.set(flight.name, { ...now, pixel: [cap[0], cap[1] + data.length * scale] });
  }

  // Runs `paint` with the origin at the cap and the second axis from cap to base.
  function inBottle(cap, theta, paint) {
    pen.save();
    pen.translate(...cap);
    pen.rotate(-theta);
    paint();
    pen.restore();
  }

  function outline(scale, colour, width) {
    const [radius, length] = [data.radius * scale, data.length * scale];
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.strokeRect(-radius, 0, 2 * radius, length);
    pen.strokeRect(-0.35 * radius, -0.22 * radius, 0.7 * radius, 0.22 * radius);
  }

  function water(flight, place, scale) {
    const height = Math.max((data.slice_height * data.slices * scale) / Math.max(flight.slices, 1), 1);
    const width = 2 * data.radius * scale - 2;
    const pace = data.position_step * data.length * scale;
    const [here, next] = [place.k * flight.slices, place.next * flight.slices];
    pen.globalAlpha = BRIGHT;
    for (let i = 0; i < flight.slices; i++) {
      const r = flight.r[here + i] + (flight.r[next + i] - flight.r[here + i]) * place.share;
      pen.fillStyle = flight.tints[i];
      pen.fillRect(-width / 2, r * pace - height / 2, width, height);
    }
    pen.globalAlpha = 1;
  }

  function cross(y) {
    for (const [colour, width] of [[colours.paper, 4], [colours.ink, 1.8]]) {
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.beginPath();
      pen.moveTo(-5, y);
      pen.lineTo(5, y);
      pen.moveTo(0, y - 5);
      pen.lineTo(0, y + 5);
      pen.stroke();
    }
  }

  // ---------------------------------------------------------------- traces

  function drawTraces() {
    const shown = flights.filter((flight) => state.visible.has(flight.name));
    scales = [
      trace(find("omega"), shown, "angular velocity ω [rad/s]", (flight, k) => flight.omega[k], true),
      trace(find("theta"), shown, "angle θ [°]", (flight, k) => (flight.theta[k] * 180) / Math.PI, false),
    ];
    moveCursors();
  }

  function trace(svg, shown, label, value, fromZero) {
    const lines = shown.map((flight) => ({
      name: flight.name,
      x: Array.from({ length: flight.reached }, (_, k) => k * frameTime),
      y: Array.from({ length: flight.reached }, (_, k) => value(flight, k)),
    }));
    const all = lines.flatMap((line) => line.y);
    let [low, high] = all.length ? [Math.min(...all), Math.max(...all)] : [0, 1];
    if (fromZero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    if (high - low < 1e-9) [low, high] = [low - 1, high + 1];
    const scale = chart.draw(svg, TRACE_HEIGHT, {
      x: { low: 0, high: data.duration, label: "time t [s]" }, y: { low, high: high + 0.04 * (high - low), label }, lines,
    });
    const cursor = chart.element("path", { class: "chart-cursor", d: `M0 ${scale.top}V${scale.bottom}`, "data-testid": "motion-cursor" }, svg);
    const dots = shown.map((flight) =>
      chart.element("circle", { class: "chart-dot", r: 4.5, style: `fill: ${chart.colour(flight)}` }, svg));
    return { ...scale, svg, cursor, dots, shown, value: label.includes("θ") ? (now) => (now.theta * 180) / Math.PI : (now) => now.omega };
  }

  function moveCursors() {
    for (const scale of scales) {
      scale.cursor.setAttribute("transform", `translate(${scale.x(state.time).toFixed(2)} 0)`);
      scale.shown.forEach((flight, k) => {
        const now = places.get(flight.name) ?? posture(flight, state.time);
        const time = Math.min(state.time, (flight.reached - 1) * frameTime);
        scale.dots[k].setAttribute("transform", `translate(${scale.x(time).toFixed(2)} ${scale.y(scale.value(now)).toFixed(2)})`);
      });
    }
  }

  // ---------------------------------------------------------------- words and numbers

  function showTime() {
    moveCursors();
    find("time").textContent = `t = ${state.time.toFixed(4)} s`;
    const scrub = find("scrub");
    scrub.value = String(Math.round(state.time / frameTime));
    scrub.setAttribute("aria-valuetext", `${state.time.toFixed(4)} seconds`);
    markState();
  }

  function markState() {
    Object.assign(root.dataset, {
      time: state.time.toFixed(7), playing: String(state.playing), view: state.view, rate: String(state.rate),
      solvers: [...state.visible].join(" "),
    });
  }

  function fillTable() {
    const body = find("values").tBodies[0];
    const shown = flights.filter((flight) => state.visible.has(flight.name));
    if (body.rows.length !== shown.length || shown.some((flight, k) => body.rows[k].dataset.solver !== flight.name)) {
      body.replaceChildren(...shown.map((flight) => {
        const row = document.createElement("tr");
        row.dataset.solver = flight.name;
        const name = row.insertCell();
        name.className = "name";
        name.append(chart.sample(flight), ` ${flight.words}`);
        for (let k = 0; k < 4; k++) row.insertCell().className = "number";
        return row;
      }));
    }
    shown.forEach((flight, k) => {
      const now = posture(flight, state.time);
      const values = [
        chart.shown((now.theta * 180) / Math.PI, 1), chart.shown(now.omega, 3), chart.shown(now.omega / data.omega0, 4),
        chart.shown(now.r / data.length, 4),
      ];
      values.forEach((value, column) => (body.rows[k].cells[column + 1].textContent = value));
    });
  }

  function summary() {
    const shown = flights.filter((flight) => state.visible.has(flight.name));
    const each = shown.map((flight) => {
      const now = posture(flight, state.time);
      return `${flight.words} θ ${chart.shown((now.theta * 180) / Math.PI, 0)}°, ω ${chart.shown(now.omega, 2)} rad/s`;
    });
    return `t = ${state.time.toFixed(3)} s: ${each.join("; ") || "no bottle chosen"}.`;
  }

  // At once if the last sentence is some time past, else when it is: a dragged slider must not chatter.
  function say(text) {
    window.clearTimeout(waiting);
    const wait = QUIET - (performance.now() - talked);
    if (wait > 0) {
      waiting = window.setTimeout(() => say(text), wait);
      return;
    }
    talked = performance.now();
    find("said").textContent = text;
  }

  // ---------------------------------------------------------------- time

  function seek(time, impact) {
    state.time = Math.min(Math.max(time, 0), data.duration);
    draw();
    showTime();
    fillTable();
    find("note").textContent = impact ?? "";
    say(impact ?? summary());
  }

  function setPlaying(playing) {
    if (playing && state.time >= data.duration) state.time = 0;
    find("note").textContent = "";
    state.playing = playing;
    before = null;
    find("play").textContent = playing ? "Pause" : "Play";
    showTime();
    if (playing) requestAnimationFrame(tick);
    else seek(state.time);
  }

  function tick(now) {
    if (!state.playing) return;
    if (before !== null) state.time += Math.min(now - before, LONGEST_STEP) / 1000 / state.rate;
    before = now;
    if (state.time >= data.duration) {
      state.time = data.duration;
      setPlaying(false);
      return;
    }
    draw();
    // The page around the bottles follows at every second frame: half its price, and no eye sees it.
    if (drawn % 2) markState();
    else showTime();
    if (now - refreshed > REFRESH) {
      refreshed = now;
      fillTable();
    }
    if (now - talked > TALK) say(summary());
    requestAnimationFrame(tick);
  }

  function stepFrame(direction) {
    pause();
    const exact = state.time / frameTime;
    const frame = direction > 0 ? Math.floor(exact + 1e-6) + 1 : Math.ceil(exact - 1e-6) - 1;
    seek(Math.min(Math.max(frame, 0), reach) * frameTime);
  }

  function stepImpact(direction) {
    pause();
    const flight = flights.find((each) => each.name === find("impacts-of").value);
    const moments = flight?.moments ?? [];
    const half = MOMENT / 2;
    const k = direction > 0
      ? moments.findIndex((moment) => moment.time > state.time + half)
      : moments.findLastIndex((moment) => moment.time < state.time - half);
    if (k < 0) {
      find("note").textContent = flight?.moments ? `${flight.words}: no ${direction > 0 ? "later" : "earlier"} impact.` : "This solver knows contacts, not impacts.";
      say(find("note").textContent);
      return;
    }
    const { time, hits } = moments[k];
    const others = hits.length > 1 ? ` and ${hits.length - 1} more at once` : "";
    seek(time, `${flight.words}, moment ${k + 1} of ${moments.length} with impacts, t = ${time.toFixed(5)} s: ${flight.tell(hits[0])}${others}.`);
  }

  function pause() {
    if (state.playing) setPlaying(false);
  }

  function setView(view) {
    state.view = view;
    find("view").value = view;
    seek(state.time);
  }

  // ---------------------------------------------------------------- controls

  find("play").addEventListener("click", () => setPlaying(!state.playing));
  find("previous-frame").addEventListener("click", () => stepFrame(-1));
  find("next-frame").addEventListener("click", () => stepFrame(1));
  find("previous-impact").addEventListener("click", () => stepImpact(-1));
  find("next-impact").addEventListener("click", () => stepImpact(1));
  find("view").addEventListener("change", (event) => setView(event.target.value));
  find("rate").addEventListener("change", (event) => {
    state.rate = Number(event.target.value);
    showTime();
  });
  find("scrub").addEventListener("input", (event) => {
    pause();
    seek(Number(event.target.value) * frameTime);
  });
  find("solvers").addEventListener("change", (event) => {
    if (event.target.checked) state.visible.add(event.target.value);
    else state.visible.delete(event.target.value);
    drawTraces();
    seek(state.time);
  });

  root.addEventListener("keydown", (event) => {
    const target = event.target;
    const kind = target.type === "checkbox" || target.type === "range" ? target.type : target.tagName;
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    if (kind === "SELECT" || kind === "SUMMARY" || target.classList.contains("scroll")) return;
    const pressed = kind === "BUTTON" || kind === "checkbox";
    const acts = {
      " ": pressed ? null : () => setPlaying(!state.playing),
      ArrowLeft: event.shiftKey ? () => stepImpact(-1) : kind === "range" ? null : () => stepFrame(-1),
      ArrowRight: event.shiftKey ? () => stepImpact(1) : kind === "range" ? null : () => stepFrame(1),
      Home: kind === "range" ? null : () => (pause(), seek(0)),
      End: kind === "range" ? null : () => (pause(), seek(data.duration)),
      v: () => setView(state.view === "lab" ? "bottle" : "lab"),
      V: () => setView(state.view === "lab" ? "bottle" : "lab"),
    };
    const act = acts[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  });

  for (const name of ["omega", "theta"]) {
    const svg = find(name);
    const follow = (event) => {
      const scale = scales[name === "omega" ? 0 : 1];
      const along = event.clientX - svg.getBoundingClientRect().left;
      pause();
      seek(((along - scale.left) / (scale.right - scale.left)) * data.duration);
    };
    svg.addEventListener("pointerdown", (event) => {
      svg.setPointerCapture(event.pointerId);
      follow(event);
    });
    svg.addEventListener("pointermove", (event) => event.buttons && follow(event));
  }

  // ---------------------------------------------------------------- beginning

  root.querySelectorAll("label[data-solver]").forEach((label) => label.append(chart.sample({ name: label.dataset.solver })));
  const knowing = flights.find((flight) => flight.moments);
  find("impacts-of").value = (flights.find((flight) => flight.name === "free-flight" && flight.moments) ?? knowing ?? flights[0]).name;
  for (const name of ["previous-impact", "next-impact"]) find(name).disabled = !knowing;

  const repaint = () => {
    width = stage.clientWidth;
    readColours();
    draw();
  };
  for (const query of ["(prefers-color-scheme: dark)", "print"]) window.matchMedia(query).addEventListener("change", repaint);
  chart.onWidth(root, () => {
    width = stage.clientWidth;
    drawTraces();
    draw();
  });

  width = stage.clientWidth;
  readColours();
  draw();
  drawTraces();
  showTime();
  fillTable();

  // What a test, or a curious reader at the console, may ask.
  window.flipproofMotion = {
    positions: () => Object.fromEntries([...places].map(([name, now]) => [name, {
      cap: now.cap, base: now.base, centre: now.centre, theta: now.theta, omega: now.omega, pixel: now.pixel,
    }])),
    seek: (time) => seek(time),
    draw,
    drawn: () => drawn,
  };
})();
