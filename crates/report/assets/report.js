// The report of a ride: draws what moves, out of the numbers that stand in the page.
//
// One clock, `now`; everything else is drawn from it. Nothing is fetched. `window.bikebot` says what is shown, for tests
// and for the curious: bikebot.seek(3.2), bikebot.values(), bikebot.fps.
"use strict";
(() => {
  const page = JSON.parse(document.getElementById("numbers").textContent);
  const byId = (id) => document.getElementById(id);
  const DEGREES = 180 / Math.PI;

  // ---------------------------------------------------------------- numbers

  function bytes(text) {
    const raw = atob(text);
    const out = new Uint8Array(raw.length);
    for (let i = 0; i < raw.length; i++) out[i] = raw.charCodeAt(i);
    return out;
  }
  // Little-endian, whatever the machine.
  function numbers(text, size, read) {
    const raw = bytes(text), view = new DataView(raw.buffer);
    const out = new Float64Array(raw.length / size);
    for (let i = 0; i < out.length; i++) out[i] = read(view, i * size);
    return out;
  }
  function column(packed, count) {
    if (packed.q !== undefined) {
      return numbers(packed.q, 2, (view, at) => {
        const steps = view.getInt16(at, true);
        return steps === -32768 ? NaN : packed.o + packed.s * steps;
      });
    }
    if (packed.f !== undefined) return numbers(packed.f, 4, (view, at) => view.getFloat32(at, true));
    return new Float64Array(count).fill(packed.c ?? NaN);
  }
  const line = (packed) => ({ n: packed.n, x: column(packed.x, packed.n), y: column(packed.y, packed.n) });

  function variable(raw) {
    let at = 0;
    return () => {
      let value = 0, factor = 1;
      while (at < raw.length) {
        const byte = raw[at++];
        value += (byte & 127) * factor;
        factor *= 128;
        if (byte < 128) return value;
      }
      return null;
    };
  }

  // How many of the sorted `times` are not after `t`.
  function countUntil(times, t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle + 1; else high = middle;
    }
    return low;
  }
  const turn = (from, to) => Math.atan2(Math.sin(to - from), Math.cos(to - from));

  function unpackRide(packed, index) {
    const { rows } = packed;
    const ride = { ...packed, index, t: numbers(rows.time, 8, (view, at) => view.getFloat64(at, true)), col: {} };
    for (const [name, it] of Object.entries(rows.columns)) ride.col[name] = column(it, rows.count);
    ride.plans = packed.plans.map((plan) => ({
      ...plan, path: line(plan.path), tree: line(plan.tree), coarse: line(plan.coarse), guide: line(plan.guide),
    }));
    ride.followed = packed.followed.map((it) => ({ ...it, path: line(it.path) }));
    ride.moving = packed.moving.map((it) => ({
      ...it, x: column(it.x, it.count), y: column(it.y, it.count), heading: column(it.heading, it.count),
    }));
    ride.beliefs = packed.beliefs.map((sheet) => ({ ...sheet, shown: -1, changes: sheet.changes.map(bytes) }));
    if (packed.scans) {
      const { ranges, scale } = packed.scans;
      ride.scans = { ...packed.scans, ranges: numbers(ranges, 2, (view, at) => {
        const steps = view.getUint16(at, true);
        return steps === 65535 ? Infinity : steps * scale;
      }) };
    }
    // Shapes that do not change, as the canvas likes them, in metres.
    ride.shapes = {
      solids: pathOf((path) => (packed.map?.solids ?? []).forEach((solid) => trace(path, solid))),
      occupied: pathOf((path) => (packed.map?.occupied ?? []).forEach((rim) => follow(path, line(rim), true))),
      unknown: pathOf((path) => (packed.map?.unknown ?? []).forEach((rim) => follow(path, line(rim), true))),
      moving: packed.moving.map((it) => pathOf((path) => trace(path, it.shape))),
      footprint: pathOf((path) => trace(path, { polygon: packed.bike.footprint })),
    };
    ride.hasMap = !!packed.map;
    return ride;
  }
  function pathOf(draw) { const path = new Path2D(); draw(path); return path; }
  function trace(path, solid) {
    if (solid.disc) {
      const [x, y, r] = solid.disc;
      path.moveTo(x + r, y);
      path.arc(x, y, r, 0, 2 * Math.PI);
    } else if (solid.polygon.length) {
      solid.polygon.forEach(([x, y], i) => (i ? path.lineTo(x, y) : path.moveTo(x, y)));
      path.closePath();
    }
  }
  function follow(path, it, close) {
    for (let i = 0; i < it.n; i++) (i ? path.lineTo(it.x[i], it.y[i]) : path.moveTo(it.x[0], it.y[0]));
    if (close && it.n) path.closePath();
  }

  const rides = page.rides.map(unpackRide);
  const several = rides.length > 1;
  let focus = rides[0];
  const end = Math.max(0, ...rides.map((ride) => ride.end));
  const ridden = rides.filter((ride) => ride.t.length);

  // A state at `t`, between two rows.
  function poseAt(ride, t) {
    const { t: times, col } = ride;
    if (!times.length || !col.x_m || !col.y_m) return null;
    const i = Math.min(Math.max(countUntil(times, t) - 1, 0), times.length - 1), j = Math.min(i + 1, times.length - 1);
    const span = times[j] - times[i];
    const share = span > 0 ? Math.min(Math.max((t - times[i]) / span, 0), 1) : 0;
    const between = (name) => {
      const values = col[name];
      if (!values) return 0;
      const value = values[i] + share * (values[j] - values[i]);
      return Number.isFinite(value) ? value : Number.isFinite(values[i]) ? values[i] : 0;
    };
    const h = col.heading_rad ?? [];
    const heading = h.length ? h[i] + share * turn(h[i], h[j]) : 0;
    const x = between("x_m"), y = between("y_m");
    return {
      row: i, x, y, heading, roll: between("roll_rad"), steer: between("steer_rad"), balancer: between("balancer_rad"),
      reference: col.roll_reference_rad ? between("roll_reference_rad") : null,
    };
  }
  // The row nearest to `t`: what the histories and readings show is what was recorded.
  function rowAt(ride, t) {
    const { t: times } = ride;
    if (!times.length || t > times[times.length - 1] + 0.5) return -1;
    const after = countUntil(times, t);
    if (after === 0) return 0;
    return after < times.length && times[after] - t < t - times[after - 1] ? after : after - 1;
  }

  // ---------------------------------------------------------------- colours

  let ink = {};
  const forced = () => document.documentElement.hasAttribute("data-print");
  function readColours() {
    const style = getComputedStyle(document.documentElement);
    for (const name of ["blue", "sky", "vermilion", "green", "purple", "orange", "obstacle", "unknown", "field", "ink", "grey",
      "rule", "paper"]) ink[name] = style.getPropertyValue("--" + name).trim();
  }
  // Rides that run alike lie one in another: the first is broadest.
  const nested = (ride) => 1.6 + 2.2 * (rides.length - 1 - ride.index);
  const rideColour = (index) => ink[["vermilion", "blue", "green", "purple", "orange", "sky"][index % 6]];

  // ---------------------------------------------------------------- the clock

  let now = 0, playing = false, rate = 1, hover = null, dirty = true, last = 0;
  const frames = { count: 0, fps: 0, since: 0, begun: 0 };

  function seek(t, { quiet = false } = {}) {
    now = Math.min(Math.max(Number.isFinite(t) ? t : 0, 0), end);
    if (!quiet) frames.begun = 0;
    touch();
  }
  function touch() {
    if (!dirty) { dirty = true; if (!playing) requestAnimationFrame(frame); }
  }
  function play() {
    if (end <= 0) return;
    if (now >= end) now = 0;
    playing = true; last = 0; frames.begun = 0;
    byId("play").classList.add("playing");
    byId("play").setAttribute("aria-label", "Pause");
    requestAnimationFrame(frame);
  }
  function pause() {
    playing = false;
    byId("play").classList.remove("playing");
    byId("play").setAttribute("aria-label", "Play");
    touch();
    slow(true);
  }
  const toggle = () => (playing ? pause() : play());

  function frame(stamp) {
    if (playing) {
      if (last) now += rate * (stamp - last) / 1000;
      last = stamp;
      if (now >= end) { now = end; pause(); }
      if (!frames.begun) { frames.begun = stamp; frames.since = frames.count; }
      frames.count += 1;
      if (stamp - frames.begun >= 500) {
        frames.fps = (frames.count - frames.since) * 1000 / (stamp - frames.begun);
        frames.begun = stamp; frames.since = frames.count;
      }
    }
    dirty = false;
    show(stamp);
    if (playing) requestAnimationFrame(frame);
  }

  let slowAt = 0;
  function show(stamp) {
    byId("time").value = now;
    drawMap();
    drawBehind();
    moveMarkers();
    drawNear();
    byId("clock").innerHTML = `<b>${now.toFixed(2)}</b><span> / ${end.toFixed(1)}</span> s`;
    if (!playing || stamp - slowAt > 90) { slowAt = stamp; slow(false); }
  }
  // What need not change sixty times a second.
  function slow(said) {
    writeReadings();
    writeValues();
    const range = byId("time");
    if (playing && !said) return;
    range.setAttribute("aria-valuetext", `${now.toFixed(2)} seconds of ${end.toFixed(1)}`);
    const pose = poseAt(focus, now);
    if (!pose) return;
    map.setAttribute("aria-label", `The ride from above. At ${now.toFixed(2)} s the bike is at x ${pose.x.toFixed(2)} m, y ${pose.y.toFixed(2)} m, `
      + `heading ${(pose.heading * DEGREES).toFixed(0)} degrees.`);
    const lean = pose.roll * DEGREES;
    rear.setAttribute("aria-label", `The bike from behind, leaning ${Math.abs(lean).toFixed(1)} degrees to the ${lean < 0 ? "left" : "right"}.`);
  }

  // ---------------------------------------------------------------- layers

  const has = (test) => rides.some(test);
  const LAYERS = [
    ["obstacles", "obstacles", "patch:obstacle", true, () => has((r) => r.hasMap)],
    ["moving", "what moves", "patch:purple", true, () => has((r) => r.moving.length)],
    ["belief", "belief", "patch:unknown", true, () => has((r) => r.beliefs.length)],
    ["scan", "laser", "patch:sky", true, () => has((r) => r.scans)],
    ["tree", "tree", "thin:blue", !several, () => has((r) => r.plans.some((p) => p.tree.n))],
    ["coarse", "coarse path", "line:purple", false, () => has((r) => r.plans.some((p) => p.coarse.n))],
    ["guide", "guide, corridor", "line:green", false, () => has((r) => r.plans.some((p) => p.guide.n))],
    ["plan", "planned path", several ? "wide:grey" : "wide:blue", true, () => has((r) => r.plans.some((p) => p.path.n))],
    ["followed", "followed curve", "dash:ink", false, () => has((r) => r.followed.some((f) => f.path.n))],
    ["ridden", "ridden", "line:vermilion", true, () => ridden.length > 0],
    ["outline", "outline", "dash:orange", true, () => ridden.length > 0],
    ["wanted", "where it should be", "dot:blue", false, () => has((r) => r.col.desired_x_m)],
  ];
  const on = {};
  function thinned({ every, every_beam: beam }) {
    const nth = (n) => `every ${n}${n % 10 === 2 && n % 100 !== 12 ? "nd" : n % 10 === 3 && n % 100 !== 13 ? "rd" : "th"}`;
    const parts = [every > 1 ? `${nth(every)} sweep` : "", beam > 1 ? `${nth(beam)} beam` : ""].filter(Boolean);
    return parts.length ? ` (${parts.join(", ")})` : "";
  }
  function buildLayers() {
    const box = byId("layers");
    for (const [name, label, look, first, present] of LAYERS) {
      on[name] = first && present();
      if (!present()) continue;
      const row = document.createElement("label");
      const [kind, colour] = look.split(":");
      const paint = `var(--${colour})`;
      const swatch = kind === "patch" ? `<rect x="2" y="2" width="16" height="10" rx="2" fill="${paint}"/>`
        : kind === "dot" ? `<circle cx="10" cy="7" r="4" fill="none" stroke="${paint}" stroke-width="2"/>`
          : `<path d="M1 7h18" stroke="${paint}" stroke-width="${{ wide: 4, thin: 1.2 }[kind] ?? 2.4}" ${kind === "dash" ? 'stroke-dasharray="4 3"' : ""}/>`;
      row.innerHTML = `<input type="checkbox" ${on[name] ? "checked" : ""}><svg width="20" height="14" aria-hidden="true">${swatch}</svg><span></span>`;
      row.lastChild.textContent = several && name === "ridden" ? "ridden, in each ride's colour"
        : name === "scan" ? `${label}${thinned(rides.find((r) => r.scans).scans)}` : label;
      row.firstChild.dataset.layer = name;
      row.firstChild.addEventListener("change", (event) => { on[name] = event.target.checked; ground.key = ""; touch(); });
      box.append(row);
    }
    if (several) {
      const label = document.createElement("label");
      label.innerHTML = "plans, belief and laser of <select id=\"focus\"></select>";
      const select = label.querySelector("select");
      rides.forEach((ride, i) => select.add(new Option(ride.file, i)));
      select.addEventListener("change", () => { focus = rides[select.value]; ground.key = ""; touch(); });
      box.append(label);
    }
  }

  // ---------------------------------------------------------------- from above

  const map = byId("map"), over = map.getContext("2d");
  const view = { x: 0, y: 0, scale: 40, follows: false, width: 0, height: 0, ratio: 1 };
  const extent = rides.reduce((all, ride) => {
    const [x0, y0, x1, y1] = ride.extent;
    return [Math.min(all[0], x0), Math.min(all[1], y0), Math.max(all[2], x1), Math.max(all[3], y1)];
  }, [Infinity, Infinity, -Infinity, -Infinity]);
  const fieldWidth = Math.max(extent[2] - extent[0], 0.5), fieldHeight = Math.max(extent[3] - extent[1], 0.5);

  function sizeCanvas(canvas, width, height) {
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    canvas.style.height = height + "px";
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    return ratio;
  }
  function sizeMap() {
    const width = map.clientWidth || 600;
    const most = forced() ? 520 : Math.max(280, Math.min(window.innerHeight * 0.68, 680));
    const height = Math.round(Math.min(Math.max(width * fieldHeight / fieldWidth, 240), most));
    view.ratio = sizeCanvas(map, width, height);
    const wasWhole = !view.width || view.whole;
    view.width = width;
    view.height = height;
    if (wasWhole) fit();
    ground.key = "";
  }
  function fit() {
    view.scale = Math.min((view.width - 16) / fieldWidth, (view.height - 16) / fieldHeight);
    view.x = (extent[0] + extent[2]) / 2;
    view.y = (extent[1] + extent[3]) / 2;
    view.whole = true;
    setFollow(false);
    touch();
  }
  function setFollow(follows) {
    view.follows = follows;
    byId("follow").setAttribute("aria-pressed", String(follows));
    if (follows) {
      view.whole = false;
      view.scale = Math.max(view.scale, Math.min(view.width, view.height) / 7);
    }
    touch();
  }
  function zoom(factor, px = view.width / 2, py = view.height / 2) {
    const x = view.x + (px - view.width / 2) / view.scale, y = view.y - (py - view.height / 2) / view.scale;
    const least = 0.5 * Math.min(view.width / fieldWidth, view.height / fieldHeight);
    view.scale = Math.min(Math.max(view.scale * factor, least), 600);
    if (!view.follows) {
      view.x = x - (px - view.width / 2) / view.scale;
      view.y = y + (py - view.height / 2) / view.scale;
    }
    view.whole = false;
    touch();
  }
  // World to canvas, with the scale of its pixels.
  const place = (context, centre, width, height, ratio) => context.setTransform(
    ratio * view.scale, 0, 0, -ratio * view.scale,
    ratio * (width / 2 - centre.x * view.scale), ratio * (height / 2 + centre.y * view.scale));

  // What stands still is drawn once, with room about it, and again when the view leaves that room or the belief changes.
  const ground = { canvas: document.createElement("canvas"), key: "", x: 0, y: 0, width: 0, height: 0 };
  function drawGround(planIndex, sheet) {
    const margin = view.follows || view.held ? 0.35 : 0;
    const width = Math.round(view.width * (1 + 2 * margin)), height = Math.round(view.height * (1 + 2 * margin));
    const seen = sheet ? [focus.beliefs.indexOf(sheet), sheet.shown] : [];
    const key = [view.scale, width, height, view.ratio, planIndex, focus.index, ...seen].join();
    const dx = Math.abs(view.x - ground.x) * view.scale, dy = Math.abs(view.y - ground.y) * view.scale;
    const inside = dx <= (ground.width - view.width) / 2 + 0.01 && dy <= (ground.height - view.height) / 2 + 0.01;
    if (key === ground.key && inside) return;
    Object.assign(ground, { key, x: view.x, y: view.y, width, height });
    ground.canvas.width = Math.round(width * view.ratio);
    ground.canvas.height = Math.round(height * view.ratio);
    const c = ground.canvas.getContext("2d"), px = 1 / view.scale;
    c.fillStyle = ink.field;
    c.fillRect(0, 0, ground.canvas.width, ground.canvas.height);
    place(c, ground, width, height, view.ratio);
    grid(c, px);
    c.lineJoin = c.lineCap = "round";
    const shaded = on.belief && focus.beliefs.length;
    if (on.obstacles && focus.hasMap && !shaded) {
      c.fillStyle = ink.unknown;
      c.fill(focus.shapes.unknown, "evenodd");
      c.fillStyle = ink.obstacle;
      c.fill(focus.shapes.occupied, "evenodd");
      c.fill(focus.shapes.solids);
    }
    if (focus.hasMap) {
      c.strokeStyle = ink.grey;
      c.lineWidth = 1.2 * px;
      const [x0, y0, x1, y1] = focus.extent;
      c.strokeRect(x0, y0, x1 - x0, y1 - y0);
    }
    if (shaded) drawBelief(c, sheet, px);
    const plan = focus.plans[planIndex];
    if (plan) drawPlan(c, plan, px);
    drawStart(c, px);
  }
  // What is believed, and faintly over it what is true.
  function drawBelief(c, sheet, px) {
    if (sheet) {
      c.save();
      c.translate(sheet.origin[0], sheet.origin[1]);
      c.rotate(sheet.origin[2]);
      c.imageSmoothingEnabled = false;
      c.drawImage(sheet.canvas, 0, 0, sheet.width * sheet.resolution, sheet.height * sheet.resolution);
      c.restore();
    }
    if (on.obstacles && focus.hasMap) {
      c.globalAlpha = 0.16;
      c.fillStyle = ink.ink;
      c.fill(focus.shapes.solids);
      c.fill(focus.shapes.occupied, "evenodd");
      c.globalAlpha = 1;
      stroke(c, focus.shapes.solids, ink.ink, px);
      stroke(c, focus.shapes.occupied, ink.ink, px);
    }
  }
  // Where it set off: a full dot, as the goal is a ring.
  function drawStart(c, px) {
    if (!focus.start) return;
    const [x, y] = focus.start;
    c.beginPath();
    c.arc(x, y, 4.5 * px, 0, 7);
    c.fillStyle = ink.ink;
    c.fill();
  }
  function grid(c, px) {
    const least = 70 * px, power = 10 ** Math.floor(Math.log10(least));
    const step = [1, 2, 5, 10].map((it) => it * power).find((it) => it >= least);
    c.strokeStyle = ink.rule;
    c.lineWidth = px;
    c.beginPath();
    const w = ground.width * px / 2, h = ground.height * px / 2;
    for (let x = Math.ceil((ground.x - w) / step) * step; x < ground.x + w; x += step) { c.moveTo(x, ground.y - h); c.lineTo(x, ground.y + h); }
    for (let y = Math.ceil((ground.y - h) / step) * step; y < ground.y + h; y += step) { c.moveTo(ground.x - w, y); c.lineTo(ground.x + w, y); }
    c.stroke();
    byId("scale").querySelector("i").style.width = step * view.scale + "px";
    byId("scale").querySelector("span").textContent = `${+step.toPrecision(1)} m`;
  }
  function drawPlan(c, plan, px) {
    if (on.tree && plan.tree.n) {
      c.globalAlpha = 0.3;
      c.strokeStyle = ink.blue;
      c.lineWidth = 0.8 * px;
      c.beginPath();
      const { x, y, n } = plan.tree;
      for (let i = 0; i + 1 < n; i += 2) { c.moveTo(x[i], y[i]); c.lineTo(x[i + 1], y[i + 1]); }
      c.stroke();
      c.globalAlpha = 1;
    }
    if (on.guide && plan.guide.n) {
      const guide = pathOf((path) => follow(path, plan.guide, false));
      if (plan.corridor) {
        c.globalAlpha = 0.25;
        c.strokeStyle = ink.sky;
        c.lineWidth = 2 * plan.corridor;
        c.stroke(guide);
        c.globalAlpha = 1;
      }
      stroke(c, guide, ink.green, 2 * px);
    }
    if (on.coarse && plan.coarse.n) stroke(c, pathOf((path) => follow(path, plan.coarse, false)), ink.purple, 1.8 * px);
    if (on.plan && plan.path.n) {
      c.globalAlpha = several ? 0.3 : 0.9;
      stroke(c, pathOf((path) => follow(path, plan.path, false)), several ? ink.grey : ink.blue, (several ? 8 : 3.4) * px);
      c.globalAlpha = 1;
    }
    const { goal } = plan;
    if (goal) {
      c.fillStyle = ink.green;
      c.globalAlpha = 0.2;
      c.beginPath();
      c.arc(goal.x, goal.y, goal.tolerance, 0, 7);
      c.fill();
      c.globalAlpha = 1;
      c.strokeStyle = ink.green;
      c.lineWidth = 2 * px;
      c.stroke();
      if (goal.heading !== null) {
        const reach = Math.max(goal.tolerance, 0) + 16 * px, [dx, dy] = [Math.cos(goal.heading), Math.sin(goal.heading)];
        const tip = [goal.x + reach * dx, goal.y + reach * dy];
        c.beginPath();
        c.moveTo(goal.x, goal.y);
        c.lineTo(...tip);
        for (const side of [1, -1]) {
          c.moveTo(tip[0] - 7 * px * dx - side * 4 * px * dy, tip[1] - 7 * px * dy + side * 4 * px * dx);
          c.lineTo(...tip);
        }
        c.stroke();
      }
    }
  }
  function stroke(c, path, colour, width, dash = []) {
    c.strokeStyle = colour;
    c.lineWidth = width;
    c.setLineDash(dash);
    c.stroke(path);
    c.setLineDash([]);
  }

  // Cells of the belief in force, painted one pixel each.
  function beliefAt(ride, t) {
    let sheet = null;
    for (const it of ride.beliefs) if (it.time[0] <= t) sheet = it;
    if (!sheet) return null;
    const wanted = countUntil(sheet.time, t) - 1;
    const colours = [ink.unknown, null, ink.obstacle].map((it) => (it ? rgb(it) : [0, 0, 0, 0]));
    const key = colours.join();
    if (!sheet.canvas) {
      sheet.canvas = document.createElement("canvas");
      sheet.canvas.width = sheet.width;
      sheet.canvas.height = sheet.height;
      sheet.cells = new Uint8Array(sheet.width * sheet.height);
    }
    if (sheet.shown === wanted && sheet.key === key) return sheet;
    if (sheet.shown > wanted) { sheet.cells.fill(0); sheet.shown = -1; }
    while (sheet.shown < wanted) {
      const next = variable(sheet.changes[++sheet.shown]);
      for (let at = 0, skip = next(); skip !== null; skip = next()) {
        const run = next();
        at += skip;
        sheet.cells.fill(run % 3, at, at + Math.floor(run / 3));
        at += Math.floor(run / 3);
      }
    }
    sheet.key = key;
    const c = sheet.canvas.getContext("2d"), image = c.createImageData(sheet.width, sheet.height);
    const words = new Uint32Array(image.data.buffer);
    const shades = colours.map((it) => new Uint32Array(new Uint8ClampedArray(it).buffer)[0]);
    for (let i = 0; i < sheet.cells.length; i++) words[i] = shades[sheet.cells[i]];
    c.putImageData(image, 0, 0);
    return sheet;
  }
  function rgb(colour) {
    const value = parseInt(colour.slice(1), 16);
    return [value >> 16, (value >> 8) & 255, value & 255, 255];
  }

  function drawMap() {
    if (!view.width) return;
    const pose = poseAt(focus, now);
    if (view.follows && pose) { view.x = pose.x; view.y = pose.y; }
    const planIndex = countUntil(focus.plans.map((plan) => plan.time), now) - 1;
    const shown = Math.max(planIndex, focus.plans.length ? 0 : -1);
    drawGround(shown, on.belief && focus.beliefs.length ? beliefAt(focus, now) : null);
    const c = over, ratio = view.ratio, px = 1 / view.scale;
    c.setTransform(1, 0, 0, 1, 0, 0);
    c.drawImage(ground.canvas,
      ratio * ((view.width - ground.width) / 2 - (view.x - ground.x) * view.scale),
      ratio * ((view.height - ground.height) / 2 + (view.y - ground.y) * view.scale));
    place(c, view, view.width, view.height, ratio);
    c.lineJoin = c.lineCap = "round";
    if (on.scan && focus.scans) drawScan(c, px);
    if (on.followed) {
      const index = Math.max(countUntil(focus.followed.map((it) => it.time), now) - 1, 0);
      const it = focus.followed[index];
      if (it) stroke(c, (it.shape ??= pathOf((path) => follow(path, it.path, false))), ink.ink, 1.4 * px, [5 * px, 4 * px]);
    }
    if (on.ridden) for (const ride of ridden) drawTrack(c, ride, px);
    if (on.moving) drawMoving(c, px);
    if (hover !== null) for (const ride of ridden) {
      const ghost = poseAt(ride, hover);
      if (ghost) { c.globalAlpha = 0.35; drawBike(c, ride, ghost, px); c.globalAlpha = 1; }
    }
    for (const ride of ridden) {
      const it = poseAt(ride, now);
      if (it) drawBike(c, ride, it, px);
    }
    if (on.wanted && focus.col.desired_x_m) {
      const row = rowAt(focus, now), x = focus.col.desired_x_m[row], y = focus.col.desired_y_m[row];
      if (Number.isFinite(x)) {
        c.beginPath();
        c.arc(x, y, 5 * px, 0, 7);
        c.strokeStyle = ink.blue;
        c.lineWidth = 2 * px;
        c.stroke();
      }
    }
  }
  function drawTrack(c, ride, px) {
    // Points closer than a pixel are one: prepared once for a scale.
    if (!ride.track || ride.track.scale !== view.scale) {
      const { x_m: x, y_m: y } = ride.col, rows = [];
      if (!x) return;
      for (let i = 0, k = -1; i < x.length; i++) {
        if (!Number.isFinite(x[i]) || !Number.isFinite(y[i])) continue;
        if (k < 0 || Math.hypot(x[i] - x[k], y[i] - y[k]) > 0.7 * px || i === x.length - 1) { rows.push(i); k = i; }
      }
      ride.track = { scale: view.scale, rows, all: pathOf((path) => rows.forEach((i, n) => (n ? path.lineTo(x[i], y[i]) : path.moveTo(x[i], y[i])))) };
    }
    const colour = several ? rideColour(ride.index) : ink.vermilion;
    c.globalAlpha = 0.22;
    const width = several ? nested(ride) + 0.6 : 2.2;
    stroke(c, ride.track.all, colour, width * px);
    c.globalAlpha = 1;
    const { x_m: x, y_m: y } = ride.col, at = poseAt(ride, now);
    c.beginPath();
    for (const i of ride.track.rows) {
      if (ride.t[i] > now) break;
      c.lineTo(x[i], y[i]);
    }
    if (at) c.lineTo(at.x, at.y);
    c.strokeStyle = colour;
    c.lineWidth = width * px;
    c.stroke();
  }
  function drawMoving(c, px) {
    focus.moving.forEach((it, k) => {
      const at = Math.min(Math.max(now / it.step, 0), it.count - 1), i = Math.floor(at), j = Math.min(i + 1, it.count - 1);
      if (!Number.isFinite(it.x[i])) return;
      const share = Number.isFinite(it.x[j]) ? at - i : 0;
      // Where it has been of late, so that its way can be seen.
      c.beginPath();
      for (let n = Math.max(0, i - 30); n <= i; n++) if (Number.isFinite(it.x[n])) c.lineTo(it.x[n], it.y[n]);
      c.globalAlpha = 0.5;
      c.strokeStyle = ink.purple;
      c.lineWidth = 1.5 * px;
      c.stroke();
      c.globalAlpha = 1;
      c.save();
      c.translate(it.x[i] + share * (it.x[j] - it.x[i] || 0), it.y[i] + share * (it.y[j] - it.y[i] || 0));
      c.rotate(it.heading[i] + share * turn(it.heading[i], it.heading[j]) || 0);
      c.fillStyle = ink.purple;
      c.fill(focus.shapes.moving[k]);
      stroke(c, focus.shapes.moving[k], ink.ink, px);
      c.restore();
    });
  }
  function drawScan(c, px) {
    const { scans } = focus;
    const index = countUntil(scans.time, now) - 1;
    if (index < 0 || now - scans.time[index] > 1) return;
    const pose = poseAt(focus, scans.time[index]), mount = focus.bike.laser;
    if (!pose || !mount) return;
    const [mx, my, mz, yaw] = mount;
    const lean = focus.bike.laser_tilts ? Math.cos(pose.roll) : 1;
    const [sin, cos] = [Math.sin(pose.heading), Math.cos(pose.heading)];
    const side = my * Math.cos(pose.roll) - mz * Math.sin(pose.roll);
    const x0 = pose.x + cos * mx - sin * side, y0 = pose.y + sin * mx + cos * side;
    const hits = [];
    c.beginPath();
    c.moveTo(x0, y0);
    for (let b = 0; b < scans.beams; b++) {
      const range = scans.ranges[index * scans.beams + b];
      const angle = scans.start + b * scans.step + yaw;
      if (!Number.isFinite(range)) { c.lineTo(x0, y0); continue; }
      const ahead = range * Math.cos(angle), left = range * Math.sin(angle) * lean;
      const x = x0 + cos * ahead - sin * left, y = y0 + sin * ahead + cos * left;
      c.lineTo(x, y);
      hits.push(x, y);
    }
    c.closePath();
    c.globalAlpha = 0.16;
    c.fillStyle = ink.sky;
    c.fill();
    c.globalAlpha = 0.85;
    c.fillStyle = ink.ink;
    const r = 1.2 * px;
    for (let i = 0; i < hits.length; i += 2) c.fillRect(hits[i] - r, hits[i + 1] - r, 2 * r, 2 * r);
    c.globalAlpha = 1;
  }

  // The bike from above: a point at height h on it lies h sin(roll) to the right of the line through its contacts.
  function drawBike(c, ride, pose, px) {
    const { bike } = ride, { wheelbase: w, wheel_radius: r } = bike;
    c.save();
    c.translate(pose.x, pose.y);
    c.rotate(pose.heading);
    if (on.outline) stroke(c, ride.shapes.footprint, several ? rideColour(ride.index) : ink.orange, 1.3 * px, [4 * px, 3 * px]);
    // Far off it is drawn larger than it is, about its middle, so that it can still be seen.
    const large = Math.max(1, 34 * px / w);
    c.translate(w / 2, 0);
    c.scale(large, large);
    c.translate(-w / 2, 0);
    px /= large;
    const lean = (h) => -h * Math.sin(pose.roll);
    const wheel = (x, angle) => {
      c.save();
      c.translate(x, 0);
      c.rotate(angle);
      const top = lean(2 * r), wide = Math.max(0.07, 3 * px);
      c.beginPath();
      c.roundRect(-r, Math.min(0, top) - wide / 2, 2 * r, Math.abs(top) + wide, wide / 2);
      c.fillStyle = ink.ink;
      c.fill();
      c.restore();
    };
    const bar = (points, width, colour) => {
      c.beginPath();
      points.forEach(([x, y]) => c.lineTo(x, y));
      c.strokeStyle = colour;
      c.lineWidth = width;
      c.stroke();
    };
    const body = several ? rideColour(ride.index) : ink.orange;
    wheel(0, 0);
    wheel(w, pose.steer);
    // Frame: rear hub, seat, head.
    const head = [w - 0.14, lean(0.85)], seat = [0.36, lean(0.75)], hub = [0.02, lean(r)];
    bar([hub, seat, head, [w, lean(r)]], Math.max(0.075, 3 * px), body);
    // Handlebar, turned with the fork.
    const psi = Math.atan(Math.tan(pose.steer) * Math.cos(pose.roll));
    c.save();
    c.translate(head[0], lean(1));
    c.rotate(psi);
    bar([[-0.1, 0.29], [0, 0.22], [0.02, 0], [0, -0.22], [-0.1, -0.29]], Math.max(0.05, 2.2 * px), ink.ink);
    c.restore();
    // Saddle.
    c.save();
    c.translate(0.42, lean(0.95));
    c.beginPath();
    c.moveTo(-0.14, 0.075);
    c.quadraticCurveTo(0.02, 0.07, 0.15, 0.022);
    c.quadraticCurveTo(0.17, 0, 0.15, -0.022);
    c.quadraticCurveTo(0.02, -0.07, -0.14, -0.075);
    c.quadraticCurveTo(-0.18, 0, -0.14, 0.075);
    c.fillStyle = ink.ink;
    c.fill();
    c.restore();
    // Balancer: its mass on a bar across.
    const up = lean(bike.pivot_height), phi = pose.roll + pose.balancer;
    c.save();
    c.translate(bike.pivot_x, up);
    bar([[0, 0.24], [0, -0.24]], Math.max(0.05, 2 * px), ink.ink);
    c.beginPath();
    c.arc(0, -0.22 * Math.sin(phi), Math.max(0.09, 3.6 * px), 0, 7);
    c.fillStyle = ink.blue;
    c.fill();
    c.strokeStyle = ink.field;
    c.lineWidth = Math.max(0.02, px);
    c.stroke();
    c.restore();
    c.restore();
  }

  // ---------------------------------------------------------------- from behind

  const rear = byId("behind"), behind = rear.getContext("2d");
  const small = { width: 0, height: 0, ratio: 1 };
  function sizeBehind() {
    small.width = rear.clientWidth || 280;
    small.height = window.innerWidth <= 560 ? 200 : 236;
    small.ratio = sizeCanvas(rear, small.width, small.height);
  }
  function drawBehind() {
    const c = behind, { width, height, ratio } = small;
    c.setTransform(ratio, 0, 0, ratio, 0, 0);
    c.fillStyle = ink.field;
    c.fillRect(0, 0, width, height);
    const times = byId("magnify").checked ? 5 : 1;
    const floor = height - 26, scale = (floor - 14) / 1.35;
    c.strokeStyle = ink.grey;
    c.lineWidth = 1.5;
    c.beginPath();
    c.moveTo(0, floor);
    c.lineTo(width, floor);
    c.stroke();
    c.strokeStyle = ink.rule;
    c.lineWidth = 1;
    c.beginPath();
    for (let x = -12; x < width; x += 12) { c.moveTo(x + 12, floor); c.lineTo(x, floor + 12); }
    c.moveTo(width / 2, 8);
    c.lineTo(width / 2, floor);
    c.stroke();
    const several = ridden.length > 1;
    for (const ride of ridden) {
      const pose = poseAt(ride, now);
      if (!pose) continue;
      c.save();
      c.translate(width / 2, floor);
      c.scale(scale, scale);
      c.globalAlpha = several && ride !== focus ? 0.4 : 1;
      drawRear(c, ride, pose, times, 1 / scale);
      c.restore();
      c.globalAlpha = 1;
    }
    if (!ridden.length) return;
    const pose = poseAt(focus, now);
    if (!pose) return;
    // The lean, written where it leans to.
    c.font = "600 13px system-ui, sans-serif";
    c.textAlign = "left";
    c.fillStyle = ink.ink;
    c.fillText(`${signed(pose.roll * DEGREES, 2)}°`, 10, 20);
    c.font = "12px system-ui, sans-serif";
    c.fillStyle = ink.grey;
    if (pose.reference !== null) c.fillText(`asked for ${signed(pose.reference * DEGREES, 2)}°`, 10, 37);
    c.textAlign = "right";
    c.fillText(Math.abs(pose.roll * DEGREES) < 0.05 ? "upright" : pose.roll > 0 ? "leans right" : "leans left", width - 10, 20);
  }
  // x to the right, y downwards from the contact, m. Seen from behind, a positive roll leans to the right.
  function drawRear(c, ride, pose, times, px) {
    const { wheel_radius: r, pivot_height: pivot, balancer_offset: offset } = ride.bike;
    const roll = Math.max(-1.5, Math.min(1.5, pose.roll * times));
    c.lineCap = c.lineJoin = "round";
    if (pose.reference !== null) {
      const wanted = Math.max(-1.5, Math.min(1.5, pose.reference * times));
      c.beginPath();
      c.moveTo(0, 0);
      c.lineTo(1.3 * Math.sin(wanted), -1.3 * Math.cos(wanted));
      c.strokeStyle = ink.blue;
      c.lineWidth = 1.8 * px;
      c.setLineDash([5 * px, 4 * px]);
      c.stroke();
      c.setLineDash([]);
    }
    const body = several ? rideColour(ride.index) : ink.orange;
    c.save();
    c.rotate(roll);
    const bar = (points, width, colour) => {
      c.beginPath();
      points.forEach(([x, y]) => c.lineTo(x, y));
      c.strokeStyle = colour;
      c.lineWidth = width;
      c.stroke();
    };
    // The front wheel looks out to the side it is steered to.
    const wide = r * Math.abs(Math.sin(pose.steer));
    if (wide > 0.01) {
      c.globalAlpha *= 0.45;
      c.beginPath();
      c.ellipse(0, -r, wide, r, 0, 0, 7);
      c.strokeStyle = ink.ink;
      c.lineWidth = 0.045;
      c.stroke();
      c.globalAlpha /= 0.45;
    }
    // Handlebar and fork, farther off.
    const spread = 0.28 * Math.cos(pose.steer);
    bar([[0, -2 * r], [0, -1]], 0.04, ink.grey);
    bar([[-spread, -0.98], [-0.1, -1.03], [0.1, -1.03], [spread, -0.98]], 0.04, ink.ink);
    // Rear wheel, stays, seat post, saddle.
    c.beginPath();
    c.roundRect(-0.03, -2 * r, 0.06, 2 * r, 0.03);
    c.fillStyle = ink.ink;
    c.fill();
    bar([[-0.06, -r], [-0.045, -2 * r - 0.04], [0, -2 * r - 0.1]], 0.026, body);
    bar([[0.06, -r], [0.045, -2 * r - 0.04], [0, -2 * r - 0.1]], 0.026, body);
    bar([[0, -2 * r - 0.1], [0, -0.94]], 0.05, body);
    c.beginPath();
    c.ellipse(0, -0.96, 0.1, 0.035, 0, 0, 7);
    c.fillStyle = ink.ink;
    c.fill();
    // Balancer: a wheel about its axis or, with its mass off the axis, a pendulum stood on its head.
    c.translate(0, -pivot);
    c.rotate(pose.balancer);
    const reach = 0.2;
    const pendulum = Math.abs(offset) > 0.02;
    if (!pendulum) {
      c.beginPath();
      c.arc(0, 0, reach, 0, 7);
      c.globalAlpha *= 0.82;
      c.fillStyle = ink.field;
      c.fill();
      c.globalAlpha /= 0.82;
      c.strokeStyle = ink.blue;
      c.lineWidth = 0.035;
      c.stroke();
      for (let k = 0; k < 3; k++) {
        c.rotate(2 * Math.PI / 3);
        bar([[0, 0], [0, -reach]], 0.018, ink.blue);
      }
    } else {
      bar([[0, 0], [0, -reach]], 0.04, ink.blue);
    }
    c.beginPath();
    c.arc(0, pendulum ? -reach - 0.03 : -reach, pendulum ? 0.075 : 0.05, 0, 7);
    c.fillStyle = ink.blue;
    c.fill();
    c.beginPath();
    c.arc(0, 0, 0.028, 0, 7);
    c.fillStyle = ink.ink;
    c.fill();
    c.restore();
  }

  // ---------------------------------------------------------------- readings

  const signed = (value, digits) => (Number.isFinite(value) ? (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits).replace("-", "−") : "–");
  const READINGS = [
    ["speed", "speed_mps", 1, 2, "m/s"], ["roll", "roll_rad", DEGREES, 2, "°"], ["steering", "steer_rad", DEGREES, 1, "°"],
    ["balancer", "balancer_rad", DEGREES, 0, "°"], ["torque", "balancer_torque_nm", 1, 1, "N m"],
    ["off the curve", "lateral_error_m", 1000, 1, "mm"], ["phase", "phase", 1, 0, ""],
    ["grip in use", "friction_use_front", 100, 0, "%"], ["ridden", "distance_m", 1, 2, "m"],
  ];
  const PHASES = ["setting off", "riding", "braking", "holding"];
  const readings = [];
  function buildReadings() {
    for (const [name, key, factor, digits, unit] of READINGS) {
      if (!has((ride) => ride.col[key])) continue;
      const box = document.createElement("div");
      box.innerHTML = "<dt></dt><dd><span></span> <small></small></dd>";
      box.querySelector("dt").textContent = name;
      box.querySelector("small").textContent = unit;
      byId("readings").append(box);
      readings.push({ key, factor, digits, out: box.querySelector("span") });
    }
  }
  function writeReadings() {
    const row = rowAt(focus, now);
    for (const { key, factor, digits, out } of readings) {
      const value = row < 0 ? NaN : focus.col[key]?.[row];
      let text = key === "phase" ? PHASES[value] ?? "–" : signed((value ?? NaN) * factor, digits);
      if (key === "friction_use_front") {
        const most = Math.max(value || 0, row < 0 ? 0 : focus.col.friction_use_rear?.[row] || 0);
        text = signed(most * factor, digits);
      }
      if (out.textContent !== text) out.textContent = text;
    }
  }

  // How far it is to the nearest obstacle, as a bar of a metre, with a mark at the least so far.
  const near = byId("near");
  function leastSoFar(ride) {
    const values = ride.col.clearance_m, out = new Float64Array(values.length);
    for (let i = 0, least = Infinity; i < values.length; i++) {
      if (values[i] < least) least = values[i];
      out[i] = least;
    }
    return out;
  }
  function drawNear() {
    const values = focus.col.clearance_m, row = values ? rowAt(focus, now) : -1;
    near.hidden = !values;
    if (!values) return;
    focus.least ??= leastSoFar(focus);
    const value = row < 0 ? NaN : values[row], least = row < 0 ? NaN : focus.least[row];
    const share = (it) => `${(100 * Math.min(Math.max(it || 0, 0), 1)).toFixed(1)}%`;
    near.className = value <= 0 ? "bad" : value < 0.25 ? "care" : "";
    near.querySelector("i").style.width = share(value);
    const mark = near.querySelector("b");
    mark.hidden = !Number.isFinite(least);
    mark.style.left = share(least);
    near.querySelector("output").textContent = Number.isFinite(value) ? `${signed(value, 2)} m` : "–";
    near.querySelector("small").textContent = value <= 0 ? "touches" : Number.isFinite(least) ? `bar: 1 m; the least so far ${signed(least, 2)} m` : "";
  }

  // ---------------------------------------------------------------- histories

  const charts = [];
  const looks = {
    is: () => ({ stroke: ink.vermilion, width: 1.6 }),
    wanted: () => ({ stroke: ink.sky, width: 4 }),
    other: () => ({ stroke: ink.blue, width: 1.6 }),
  };
  // The times of the longest ride; others are read off at them.
  const base = rides.reduce((most, ride) => (ride.end > most.end ? ride : most), rides[0]);
  function valuesOn(ride, name, factor) {
    const values = ride.col[name], times = base.t;
    if (!values) return null;
    const out = new Array(times.length);
    for (let i = 0, k = 0; i < times.length; i++) {
      let value;
      if (ride === base) value = values[i];
      else if (times[i] > ride.t[ride.t.length - 1] + 0.02) value = NaN;
      else {
        while (k + 1 < ride.t.length && ride.t[k + 1] <= times[i] + 1e-9) k++;
        value = values[k];
      }
      out[i] = Number.isFinite(value) ? value * factor : null;
    }
    return out;
  }
  function buildCharts() {
    for (const chart of charts) chart.plot.destroy();
    charts.length = 0;
    const box = byId("charts");
    box.textContent = "";
    if (!base || !base.t.length) { byId("histories").hidden = true; return; }
    const kinds = new Map();
    for (const ride of rides) for (const chart of ride.charts) if (!kinds.has(chart.id)) kinds.set(chart.id, chart);
    for (const kind of kinds.values()) box.append(buildChart(kind));
  }
  function buildChart(kind) {
    const holder = document.createElement("div");
    holder.className = "chart";
    holder.dataset.chart = kind.id;
    holder.innerHTML = "<h3><b></b><span></span></h3><div class=\"values\"></div>";
    holder.querySelector("b").textContent = `${kind.title}, ${kind.unit}`;
    holder.querySelector("span").textContent = kind.levels.length ? kind.levels[0].label : "";
    const data = [base.t], series = [{}], outs = [];
    for (const ride of rides) {
      // Side by side, the second quantity of a chart is left to the page of one ride.
      // What was asked for lies as a broad band beneath what was.
      for (const it of [...kind.series].sort((a, b) => (b.role === "wanted") - (a.role === "wanted"))) {
        if (several && it.role !== "is") continue;
        const values = valuesOn(ride, it.column, kind.factor);
        if (!values) continue;
        const look = several ? { stroke: rideColour(ride.index), width: nested(ride) } : looks[it.role]();
        data.push(values);
        series.push({ ...look, points: { show: false }, spanGaps: false });
        const row = document.createElement("span");
        row.innerHTML = "<i></i><span></span> <b>–</b>";
        row.firstChild.style.borderTopColor = look.stroke;
        row.firstChild.style.borderTopWidth = it.role === "wanted" ? "4px" : "2px";
        row.children[1].textContent = several ? ride.file : it.label;
        row.dataset.column = it.column;
        row.dataset.ride = ride.index;
        outs.push({ values, out: row.lastChild });
        if (it.role === "wanted") row.style.order = 1;
        holder.lastChild.append(row);
      }
    }
    const chart = { kind, outs, holder };
    const axis = { stroke: ink.grey, grid: { stroke: ink.rule, width: 1 }, ticks: { stroke: ink.rule, width: 1, size: 4 }, font: "11.5px system-ui, sans-serif" };
    chart.plot = new uPlot({
      width: 400, height: 150, legend: { show: false },
      cursor: { sync: { key: "ride" }, drag: { x: true, y: false }, y: false, points: { size: 6 } },
      scales: { x: { time: false }, y: { range: (u, low, high) => widened(low, high) } },
      axes: [
        { ...axis, size: 26, gap: 3, values: (u, splits) => splits.map((it) => +it.toFixed(6) + (it === splits[splits.length - 1] ? " s" : "")) },
        { ...axis, size: 48, gap: 3, space: 28 },
      ],
      series,
      hooks: {
        setCursor: [(u) => pointed(u)],
        setScale: [(u, key) => key === "x" && zoomed(u)],
        draw: [(u) => { drawLevels(u, kind); placeFlags(u); touch(); }],
        ready: [(u) => ready(u, chart)],
      },
    }, data, holder);
    charts.push(chart);
    return holder;
  }
  function widened(low, high) {
    if (!Number.isFinite(low) || !Number.isFinite(high)) return [-1, 1];
    low = Math.min(low, 0);
    high = Math.max(high, 0);
    const room = 0.07 * (high - low) || 1;
    return [low < 0 ? low - room : low, high > 0 ? high + room : high];
  }
  function drawLevels(u, { levels }) {
    const c = u.ctx;
    c.save();
    const dashed = (y, colour, dash) => {
      const at = Math.round(u.valToPos(y, "y", true)) + 0.5;
      if (at < u.bbox.top || at > u.bbox.top + u.bbox.height) return;
      c.strokeStyle = colour;
      c.lineWidth = 1;
      c.setLineDash(dash);
      c.beginPath();
      c.moveTo(u.bbox.left, at);
      c.lineTo(u.bbox.left + u.bbox.width, at);
      c.stroke();
    };
    dashed(0, ink.grey, []);
    for (const level of levels) if (level.value !== 0) dashed(level.value, ink.ink, [2, 3]);
    c.restore();
  }
  function ready(u, chart) {
    const marker = document.createElement("div");
    marker.className = "now";
    u.over.append(marker);
    chart.marker = marker;
    chart.flags = focus.events.slice(0, 120).filter((it) => it.grade !== "plain" || focus.events.length < 40).map((it) => {
      const flag = document.createElement("div");
      flag.className = "event " + it.grade;
      u.over.append(flag);
      return { flag, t: it.t };
    });
    placeFlags(u);
    let from = null;
    u.over.addEventListener("pointerdown", (event) => {
      from = event.clientX;
      if (event.pointerType !== "mouse") { pause(); seek(timeAt(u, event)); }
    });
    u.over.addEventListener("pointermove", (event) => {
      if (event.pointerType !== "mouse" && event.buttons) seek(timeAt(u, event));
    });
    u.over.addEventListener("click", (event) => {
      if (from !== null && Math.abs(event.clientX - from) < 4) seek(timeAt(u, event));
    });
  }
  const timeAt = (u, event) => u.posToVal(event.clientX - u.over.getBoundingClientRect().left, "x");
  // Charts tell each other where the pointer is; the one it is on speaks for all.
  function pointed(u) {
    if (u.cursor.event === null && u !== charts[0]?.plot) return;
    const { idx, left } = u.cursor;
    const t = left >= 0 && idx !== null && idx !== undefined ? base.t[idx] : null;
    if (t === hover) return;
    hover = t;
    touch();
    if (playing) writeValues();
  }
  let zooming = false;
  function zoomed(u) {
    const { min, max } = u.scales.x;
    if (zooming || min === null || min === undefined) { placeFlags(u); return; }
    zooming = true;
    for (const chart of charts) {
      const { min: a, max: b } = chart.plot.scales.x;
      if (chart.plot !== u && (a !== min || b !== max)) chart.plot.setScale("x", { min, max });
    }
    zooming = false;
    placeFlags(u);
    touch();
  }
  function placeFlags(u) {
    const chart = charts.find((it) => it.plot === u);
    for (const { flag, t } of chart?.flags ?? []) {
      const at = u.valToPos(t, "x");
      flag.hidden = !(at >= -1 && at <= u.over.clientWidth + 1);
      flag.style.left = at + "px";
    }
  }
  function setZoom(min, max) {
    const first = base?.t[0] ?? 0, final = base?.t[base.t.length - 1] ?? 1;
    min = Math.max(min, first);
    max = Math.min(max, final);
    if (max - min > 0.02) charts[0]?.plot.setScale("x", { min, max });
  }
  function zoomBy(factor) {
    const plot = charts[0]?.plot;
    if (!plot) return;
    const { min, max } = plot.scales.x, half = 0.5 * factor * (max - min);
    const middle = now >= min && now <= max && factor < 1 ? now : (min + max) / 2;
    setZoom(middle - half, middle + half);
  }
  function moveMarkers() {
    for (const { plot, marker } of charts) {
      if (!marker) continue;
      const at = plot.valToPos(now, "x"), inside = at >= -1 && at <= plot.over.clientWidth + 1;
      marker.style.visibility = inside ? "visible" : "hidden";
      if (inside) marker.style.transform = `translateX(${at.toFixed(1)}px)`;
    }
  }
  function digitsFor(values) {
    let most = 0;
    for (let i = 0; i < values.length; i += 7) most = Math.max(most, Math.abs(values[i] ?? 0));
    return most >= 1000 ? 0 : most >= 100 ? 1 : most >= 1 ? 2 : most >= 0.1 ? 3 : 4;
  }
  function writeValues() {
    const row = base ? rowAt(base, hover ?? now) : -1;
    for (const { outs } of charts) {
      for (const it of outs) {
        it.digits ??= digitsFor(it.values);
        const value = row < 0 ? null : it.values[row];
        const text = value === null || value === undefined ? "–" : signed(value, it.digits);
        if (it.out.textContent !== text) it.out.textContent = text;
      }
    }
  }
  function sizeCharts() {
    for (const { plot, holder } of charts) {
      const width = holder.clientWidth;
      if (width > 0 && Math.abs(plot.width - width) > 0.5) plot.setSize({ width, height: 150 });
      placeFlags(plot);
    }
  }

  // ---------------------------------------------------------------- hands

  function wire() {
    byId("play").addEventListener("click", toggle);
    const range = byId("time");
    range.max = end;
    range.addEventListener("input", () => { pause(); seek(Number(range.value)); });
    byId("speed").addEventListener("change", (event) => { rate = Number(event.target.value); });
    byId("fit").addEventListener("click", fit);
    byId("follow").addEventListener("click", () => (view.follows ? fit() : setFollow(true)));
    byId("nearer").addEventListener("click", () => zoom(1.5));
    byId("farther").addEventListener("click", () => zoom(1 / 1.5));
    byId("magnify").addEventListener("change", touch);
    byId("zoom-in").addEventListener("click", () => zoomBy(0.4));
    byId("zoom-out").addEventListener("click", () => zoomBy(2.5));
    byId("zoom-all").addEventListener("click", () => setZoom(-Infinity, Infinity));
    for (const button of document.querySelectorAll("[data-time]")) {
      button.addEventListener("click", () => { pause(); seek(Number(button.dataset.time)); });
    }
    for (const button of document.querySelectorAll("[data-copy]")) button.addEventListener("click", () => copy(button));
    for (const { events, end: last } of rides) {
      for (const it of events.slice(0, 200)) {
        if (!(end > 0) || it.t > last + 1) continue;
        const mark = document.createElement("i");
        mark.className = it.grade;
        mark.style.left = 100 * it.t / end + "%";
        byId("marks").append(mark);
      }
    }
    document.addEventListener("keydown", keys);
    wireMap();
  }
  async function copy(button) {
    const text = byId(button.dataset.copy).textContent;
    let done = true;
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // A page opened as a file may not have a clipboard: mark the text instead, ready for Ctrl-C.
      const range = document.createRange();
      range.selectNodeContents(byId(button.dataset.copy));
      getSelection().removeAllRanges();
      getSelection().addRange(range);
      done = document.execCommand("copy");
    }
    button.textContent = done ? "Copied" : "Marked";
    setTimeout(() => { button.textContent = "Copy"; }, 1600);
  }
  function keys(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || end <= 0) return;
    const { target, key } = event;
    const types = target.matches("select, textarea, input:not([type=range], [type=checkbox])");
    const presses = target.matches("button, summary, a, input[type=checkbox]");
    const scrolls = target.matches("pre, .wide");
    if (types) return;
    const step = event.shiftKey ? 1 : 0.1;
    const acts = {
      " ": () => !presses && toggle(),
      ArrowLeft: () => !scrolls && (pause(), seek(now - step)),
      ArrowRight: () => !scrolls && (pause(), seek(now + step)),
      Home: () => !scrolls && (pause(), seek(0)),
      End: () => !scrolls && (pause(), seek(end)),
      f: () => byId("follow").click(),
      0: fit,
      "+": () => zoom(1.5),
      "-": () => zoom(1 / 1.5),
    };
    // On the slider, up and down are as right and left.
    if (target === byId("time")) Object.assign(acts, { ArrowUp: acts.ArrowRight, ArrowDown: acts.ArrowLeft });
    const act = acts[key];
    if (act && act() !== false) event.preventDefault();
  }
  function wireMap() {
    const held = new Map();
    map.addEventListener("wheel", (event) => {
      // Plain scrolling scrolls the page.
      if (!event.ctrlKey && !event.metaKey && document.activeElement !== map && !view.entered) return;
      event.preventDefault();
      zoom(Math.exp(-0.0016 * event.deltaY), event.offsetX, event.offsetY);
    }, { passive: false });
    map.addEventListener("pointerdown", (event) => {
      held.set(event.pointerId, event);
      view.entered = true;
      if (event.pointerType === "mouse") map.setPointerCapture(event.pointerId);
      if (event.pointerType === "mouse" || held.size === 2) { view.held = true; map.classList.add("held"); }
    });
    map.addEventListener("pointermove", (event) => {
      const before = held.get(event.pointerId);
      if (!before || !view.held) return;
      if (held.size === 2) {
        const other = [...held.values()].find((it) => it.pointerId !== event.pointerId);
        const distance = (it) => Math.hypot(it.clientX - other.clientX, it.clientY - other.clientY);
        const box = map.getBoundingClientRect();
        if (distance(before) > 1) zoom(distance(event) / distance(before), (event.clientX + other.clientX) / 2 - box.left, (event.clientY + other.clientY) / 2 - box.top);
      } else {
        if (view.follows) setFollow(false);
        view.x -= (event.clientX - before.clientX) / view.scale;
        view.y += (event.clientY - before.clientY) / view.scale;
        view.whole = false;
        touch();
      }
      held.set(event.pointerId, event);
    });
    const release = (event) => {
      held.delete(event.pointerId);
      if (!held.size) { view.held = false; map.classList.remove("held"); }
    };
    for (const name of ["pointerup", "pointercancel"]) map.addEventListener(name, release);
    map.addEventListener("pointerleave", (event) => { if (!held.size) view.entered = false; });
    // Two fingers zoom the map, one scrolls the page.
    map.addEventListener("touchmove", (event) => { if (event.touches.length === 2) event.preventDefault(); }, { passive: false });
  }

  // ---------------------------------------------------------------- begin

  function restyle() {
    readColours();
    ground.key = "";
    buildCharts();
    sizeCharts();
    touch();
  }
  function resize() {
    sizeMap();
    sizeBehind();
    sizeCharts();
    touch();
  }
  function begin() {
    readColours();
    buildLayers();
    buildReadings();
    wire();
    if (!ridden.length) byId("nothing").hidden = false;
    if (end > 0) byId("transport").hidden = false;
    if (!ridden.length) document.querySelector(".side").hidden = true;
    // The goal in sight and the plan in force: a ride is first shown at its end, where its verdict is.
    now = end;
    sizeMap();
    sizeBehind();
    buildCharts();
    sizeCharts();
    let waiting = 0;
    addEventListener("resize", () => { cancelAnimationFrame(waiting); waiting = requestAnimationFrame(resize); });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", restyle);
    addEventListener("beforeprint", () => { document.documentElement.setAttribute("data-print", ""); resize(); restyle(); show(0); });
    addEventListener("afterprint", () => { document.documentElement.removeAttribute("data-print"); resize(); restyle(); });
    dirty = true;
    requestAnimationFrame(frame);
  }

  window.bikebot = {
    seek, play, pause,
    get time() { return now; },
    get end() { return end; },
    get playing() { return playing; },
    get hover() { return hover; },
    get fps() { return frames.fps; },
    get frames() { return frames.count; },
    pose: (ride = 0, t = now) => poseAt(rides[ride], t),
    values: (ride = 0, t = hover ?? now) => {
      const it = rides[ride], row = rowAt(it, t);
      return row < 0 ? null : Object.fromEntries([["time_s", it.t[row]], ...Object.entries(it.col).map(([name, values]) => [name, values[row]])]);
    },
    layers: on,
  };
  begin();
})();
