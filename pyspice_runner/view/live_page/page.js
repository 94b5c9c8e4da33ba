// SPDX-License-Identifier: GPL-3.0-or-later
// The page: settings, controls, links, undo, and what is shown.

const DATA = { motors: [], marks: [] };
const $ = (id) => document.getElementById(id);
const root = document.documentElement;

// key, label, unit, factor from the shown to the stored value, digits
const CONTROLS = [
  ["voltage", "Voltage, amplitude", "V", 1],
  ["frequency", "Frequency", "kHz", 1e3],
  ["phase", "Phase of B ahead of A", "°", 1],
  ["voltage_2", "Second tone, amplitude", "V", 1],
  ["frequency_2", "Second tone, frequency", "kHz", 1e3],
  ["phase_2", "Second tone, phase", "°", 1],
  ["preload", "Preload", "N", 1],
  ["friction", "Coefficient of friction", "", 1],
  ["torque", "Load torque", "mN·m", 1e-3],
  ["speed", "Shaft held at", "rad/s", 1],
  ["stiffness", "Mount springs", "kN/m", 1e3],
  ["load", "Resistance of the load", "N·s/m", 1],
];
const OF_SLIDER = { torque: ["Load force", "N", 1], speed: ["Slider held at", "mm/s", 1e-3] };
const CHOICES = {
  kind: { "two-phase": "one tone, two phases", "two-tone": "two tones" },
  shaft: { free: "free, with a load", held: "held at a speed" },
  mount: { held: "held at a distance", sprung: "on springs" },
  law: { "spring-slider": "spring-slider", brush: "brush", coulomb: "Coulomb" },
};
const TEXT = { driver: 6000 };
const SECTIONS = ["numbers", "path", "motor", "forces", "electrical", "torque", "response", "impedance", "driver", "deck"].filter((name) => !$(name).hidden); // a transducer has fewer
const APART = 0.15; // of the maximum speed, from which falling and rising frequency differ; the lag of a ramp is less
const FRAME_MS = 30, IDLE_MS = 350, SLOW_SECONDS = 8, MOST_UNDO = 200;

const page = {
  slot: "A", slots: { A: null, B: null }, results: { A: {}, B: {} }, undone: [], measured: null, serial: 0,
  main: null, side: null, playing: true, position: 0, angle: 0,
};

// --- settings ---

const motorOf = (s) => DATA.motors.find((motor) => motor.name === s.motor) ?? DATA.motors[0];
const current = () => page.slots[page.slot];

/** Label, unit and factor of a control: a motor with a slider has a load in N and a speed in mm/s. */
function shownAs(key, motor) {
  return (motor.linear && OF_SLIDER[key]) || CONTROLS.find(([name]) => name === key).slice(1);
}

/** A text about a rotor, as it reads for the motor. */
function worded(text, motor) {
  if (!motor.linear) return text;
  return text.replace(/rotor/g, "slider").replace(/(t|T)orque/g, (_, first) => (first === "t" ? "force" : "Force"));
}

/** A number with a minus sign in place of a hyphen. */
const signed = (value) => String(value).replace("-", "−");
const speedOf = (speed, motor) => (motor.linear ? si(speed, "m/s") : `${signed(Number(speed.toPrecision(4)))} rad/s`);
const torqueOf = (torque, motor) => si(torque, motor.linear ? "N" : "N·m");

/** Return limits, and smallest and largest value and increment of the slider, of each setting of a motor, in SI units. */
function ranges(motor) {
  const s = motor.defaults, round = (value, digits = 1) => Number(value.toPrecision(digits));
  const all = motor.modes.map((mode) => mode.frequency), slow = Math.min(...all), fast = Math.max(...all);
  const volts = [[0, 8 * s.voltage], [0, 2.5 * s.voltage, round(s.voltage / 100)]];
  const degrees = [[-360, 360], [-180, 180, 1]];
  const step = motor.transducer ? 1 : 10;
  const found = {
    voltage: volts,
    frequency: [[0.3 * slow, 1.5 * fast], [round(0.93 * s.frequency, 3), round(1.07 * s.frequency, 3), step]],
  };
  if (s.phase !== undefined) found.phase = degrees;
  if (motor.more) {
    const most = s.load + motor.more;
    found.load = [[0, 10 * most], [0, round(most, 2), round(0.005 * motor.more)]];
  }
  if (motor.transducer) return found;
  const torque = s.friction * s.preload * motor.radius, turn = motor.linear ? 1e-2 : 1; // 1 m/s of a slider for 100 rad/s
  return {
    ...found,
    voltage_2: volts,
    frequency_2: [[0.3 * slow, 3 * fast], [round(0.3 * slow, 3), round(2.2 * fast, 3), 50]],
    phase_2: degrees,
    preload: [[0.02 * s.preload, 20 * s.preload], [round(0.1 * s.preload), round(4 * s.preload), round(s.preload / 100)]],
    friction: [[0.01, 1.5], [0.05, 0.8, 0.01]],
    torque: [[-4 * torque, 4 * torque], [-round(torque), round(torque), round(torque / 200)]],
    speed: [[-1000 * turn, 1000 * turn], [-100 * turn, 100 * turn, 0.1 * turn]],
    stiffness: [[0.01 * s.stiffness, 100 * s.stiffness], [round(0.1 * s.stiffness), round(10 * s.stiffness), round(0.05 * s.stiffness)]],
  };
}

function defaults(motor) {
  return { motor: motor.name, ...motor.defaults, driver: "" };
}

/** Return settings from text values: every one checked, those that are not valid replaced by the default. */
function settingsFrom(read) {
  const motor = DATA.motors.find((one) => one.name === read("motor")) ?? DATA.motors[0];
  const s = defaults(motor);
  for (const [key] of CONTROLS) {
    const text = read(key), value = Number(text);
    if (motor.limits[key] && text !== null && text !== "" && Number.isFinite(value)) s[key] = clamp(value, ...motor.limits[key]);
  }
  for (const [key, choices] of Object.entries(CHOICES)) {
    const word = read(key);
    if (word !== null && Object.hasOwn(s, key) && Object.hasOwn(choices, word) && (key !== "law" || motor.laws.includes(word))) s[key] = word;
  }
  s.driver = motor.transducer ? "" : (read("driver") ?? "").slice(0, TEXT.driver);
  return s;
}

function link() {
  const words = new URLSearchParams();
  for (const [slot, s] of Object.entries(page.slots))
    if (s) for (const [key, value] of Object.entries(s)) if (key === "motor" || value !== defaults(motorOf(s))[key]) words.set(`${slot}.${key}`, value);
  words.set("slot", page.slot);
  for (const [name, list] of [["show", page.embedded], ["only", page.only]]) if (list) words.set(name, list.join(" "));
  return `#${words}`;
}

function fromLink() {
  const words = new URLSearchParams(location.hash.slice(1));
  for (const slot of ["A", "B"]) {
    const given = [...words.keys()].some((key) => key.startsWith(`${slot}.`));
    page.slots[slot] = given || slot === "A" ? settingsFrom((key) => words.get(`${slot}.${key}`)) : null;
  }
  page.slot = words.get("slot") === "B" && page.slots.B ? "B" : "A";
  const list = (name, known) => (words.get(name) ?? "").split(" ").filter((word) => known.includes(word));
  const show = list("show", SECTIONS), only = list("only", [...CONTROLS.map(([key]) => key), ...Object.keys(CHOICES), "motor", "preset"]);
  if (show.length) embed(show, only);
}

/** Show only some sections and controls, for a figure in another page. */
function embed(show, only) {
  page.embedded = show;
  page.only = only;
  document.body.classList.add("embedded");
  for (const name of SECTIONS) $(name).hidden = !show.includes(name);
  for (const box of document.querySelectorAll(".controls > *")) box.classList.toggle("left-out", !only.includes(box.id.replace("-control", "")));
  $("driver").open = show.includes("driver");
}

function change(values, { keep = true } = {}) {
  if (keep) {
    page.undone.push(JSON.stringify({ slots: page.slots, slot: page.slot }));
    if (page.undone.length > MOST_UNDO) page.undone.shift();
  }
  Object.assign(current(), values);
  refresh();
}

function undo() {
  const before = page.undone.pop();
  if (!before) return;
  Object.assign(page, JSON.parse(before));
  refresh();
}

function refresh() {
  showControls();
  try {
    history.replaceState(null, "", link());
  } catch {
    // a page inside another one may have no address of its own
  }
  compute();
}

// --- runs ---

function say(text, { failed = false } = {}) {
  $("status").textContent = text;
  $("status").classList.toggle("failed", failed);
}

function busy(on) {
  root.dataset.busy = on ? "true" : "false";
  $("stop").disabled = !on;
  if (!on) $("progress").hidden = true;
}

function progress(share) {
  $("progress").hidden = false;
  $("progress").value = share;
}

/** Whether the averaged motor has all losses of a motor. */
const hasAveraged = (motor) => Object.hasOwn(motor.decks, "averaged held");

async function compute() {
  const serial = (page.serial += 1);
  const slot = page.slot, s = { ...current() }, motor = motorOf(s);
  page.main.drop();
  page.side.drop();
  clearTimeout(page.idle);
  const began = performance.now();
  const still = () => serial === page.serial;
  const known = JSON.stringify(page.known?.settings) === JSON.stringify(s) ? page.known : {};
  const result = (page.results[slot] = { ...known, settings: s });
  const faults = motor.transducer ? [] : driverFaults(s.driver, motor.decks[`driver ${s.mount} ${s.law}`]);
  showFaults(faults);
  if (faults.length) {
    busy(false);
    return say(`Line ${faults[0].line + 1} of the driver: ${faults[0].message}`, { failed: true });
  }
  busy(true);
  delete root.dataset.picture;
  delete root.dataset.further;
  try {
    if (motor.transducer) {
      result.full = result.quick = await steadyState(page.main, motor, s);
      if (!still()) return;
      show(slot, result, result.quick, began);
    } else if (s.kind === "two-phase" && hasAveraged(motor)) {
      try {
        result.quick = await averaged(page.main, motor, s);
      } catch (error) {
        if (error instanceof Dropped) throw error;
      }
      if (!still()) return;
      if (result.quick && s.law === "spring-slider" && !s.driver.trim()) {
        if (!result.full) show(slot, result, result.quick, began);
      }
    }
    page.idle = setTimeout(() => further(slot, motor, s, result, still), IDLE_MS); // beside the full motor
    await (motor.transducer ? vibration : cycles)(page.main, motor, s, result.quick, (found) => still() && (result.full = found) && show(slot, result, found, began), progress);
    if (!still()) return;
    busy(false);
  } catch (error) {
    if (!still() || error instanceof Dropped) return;
    busy(false);
    if (root.dataset.state === "loading") root.dataset.state = "failed";
    const words = error.log ?? [];
    if (s.driver.trim()) {
      const line = lineOf(s.driver, words, motor.decks[`driver ${s.mount} ${s.law}`]);
      showFaults([{ line, message: `ngspice: ${error.message}` }], words);
    }
    say(`ngspice: ${error.message}`, { failed: true });
  }
}

/** Curves that need several operating points, in an engine of their own. */
async function further(slot, motor, s, result, still) {
  const jobs = [["admittance", () => admittance(page.side, motor, s)]];
  if (result.quick && s.law === "spring-slider" && !s.driver.trim()) {
    jobs.unshift(["curve", () => speedTorque(page.side, motor, s, result.quick)]);
    const low = 0.97 * s.frequency, high = 1.04 * s.frequency;
    jobs.push(["response", () => response(page.side, motor, s, result.quick, high, low)], ["rising", () => response(page.side, motor, s, result.quick, low, high)]);
  }
  root.dataset.further = "running";
  for (const [name, job] of jobs) {
    try {
      const found = await job();
      if (!still()) return;
      result[name] = found;
      draw();
    } catch (error) {
      if (!still() || error instanceof Dropped) return;
      result[`${name}Failed`] = error.message;
    }
  }
  root.dataset.further = "done";
}

function stop() {
  page.serial += 1;
  page.main.drop();
  page.side.drop();
  busy(false);
  say("Stopped. Change a setting to run again.");
}

// --- numbers ---

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"], [1e-12, "p"]];

function si(value, unit) {
  if (!Number.isFinite(value)) return "–";
  if (Math.abs(value) < 1e-12) return `0 ${unit}`;
  const [size, prefix] = PREFIXES.find(([bound]) => Math.abs(value) >= bound * 0.9995) ?? [1e-12, "p"];
  return `${signed(Number((value / size).toPrecision(4)))} ${prefix}${unit}`;
}

const percent = (share) => `${(100 * share).toFixed(1)} %`;

function rows(motor, found) {
  if (motor.transducer) return vibrationRows(motor, found);
  const shaft = found.torque * found.speed, input = found.power_a + found.power_b;
  return [
    ["speed", speedOf(found.speed, motor)],
    [worded("torque of the motor", motor), torqueOf(found.torque, motor)],
    ["normal force, mean", si(found.normal, "N")],
    ["current of A, RMS", si(found.current_a, "A")],
    ["current of B, RMS", si(found.current_b, "A")],
    ["electrical power", si(input, "W")],
    [worded("power to the rotor", motor), si(shaft, "W")],
    ["efficiency", shaft > 0 && input > 0 ? percent(shaft / input) : "–"],
    ["losses, stator and contact", si(input - shaft, "W")],
    ["heat of the stator", `${si(found.heat, "W")}, +${(found.heat * motor.thermalResistance).toFixed(0)} K when warm, in still air`],
    ["separated · stick · slip", [found.open, Math.max(0, 1 - found.open - found.slip), found.slip].map(percent).join(" · ")],
  ];
}

function show(slot, result, found, began) {
  result.found = found;
  result.cautions = exceeded(motorOf(result.settings), found);
  root.dataset.speed = String(found.speed ?? "");
  root.dataset.model = found.model;
  root.dataset.state = "ready";
  const seconds = (performance.now() - began) / 1000;
  if (found === result.quick || !result.quick || !result.timed) {
    result.timed = true;
    root.dataset.latency = seconds.toFixed(3);
  }
  if (found.model === "cycles" && found.blocks === 1) root.dataset.picture = seconds.toFixed(3);
  root.dataset.settled = String(found.settled ?? false);
  const how = found === result.quick ? (found.waves ? "small signals" : "averaged motor") : found.settled ? "cycle by cycle, settled" : "cycle by cycle, not settled yet";
  const motor = motorOf(result.settings);
  say(`${headline(slot, found, motor)} (${how})`);
  draw();
}

/** Speed, torque and power of a setting. */
function headline(slot, found, motor) {
  const numbers = motor.transducer ? [si(found.power, "W"), `motional ${motor.groups.map((group) => si(found[`motional_${group}`], "A")).join(" and ")}`] : [speedOf(found.speed, motor), torqueOf(found.torque, motor), si(found.torque * found.speed, "W")];
  return (page.slots.B ? `${slot}: ` : "") + numbers.join(", ");
}

/** Show the answer that was computed when the page was written, before the engine has run. */
function showFirst() {
  const { first } = DATA, s = current(), motor = motorOf(s);
  if (!first || motor.name !== first.motor || JSON.stringify(s) !== JSON.stringify(defaults(motor))) return;
  const vectors = (columns) => Object.fromEntries(Object.entries(columns).map(([name, values]) => [name, Float64Array.from(values)]));
  const full = { ...reduced(motor, s, vectors(first.cycles), period(s), first.deck, false), settled: true };
  full.torque = balance(motor, s, full.speed);
  page.known = page.results[page.slot] = { settings: s, found: full, full, curve: curveOf(motor, vectors(first.curve)), cautions: exceeded(motor, full) };
  say(`${headline(page.slot, full, motor)} (computed when the page was written; the engine starts …)`);
  draw();
}

function showNumbers() {
  const body = $("values");
  body.replaceChildren();
  const slots = ["A", "B"].filter((slot) => page.slots[slot]);
  $("column-b").hidden = !page.slots.B;
  const columns = slots.map((slot) => {
    const { found } = page.results[slot] ?? {};
    return found ? rows(motorOf(page.slots[slot]), found) : null;
  });
  const names = columns.find(Boolean)?.map(([name]) => name) ?? [];
  names.forEach((name, row) => {
    const line = document.createElement("tr");
    const head = document.createElement("th");
    head.scope = "row";
    head.textContent = name;
    line.append(head);
    for (const column of columns) {
      const cell = document.createElement("td");
      cell.textContent = column ? column[row][1] : "–";
      line.append(cell);
    }
    body.append(line);
  });
  const cautions = slotsShown().flatMap((slot) => page.results[slot].cautions.map((caution) => (page.slots.B ? `${slot}: ` : "") + caution));
  if ($("limits").textContent !== cautions.join(" ")) $("limits").textContent = cautions.join(" ");
}

// --- pictures ---

const dashed = (slot) => (slot === page.slot ? "" : "6 4");
const slotsShown = () => ["A", "B"].filter((slot) => page.slots[slot] && page.results[slot]?.found);

function draw() {
  if (page.drawing) return;
  page.drawing = requestAnimationFrame(() => {
    page.drawing = 0;
    showNumbers();
    drawForces();
    drawElectrical();
    drawTorque();
    drawResponse();
    drawImpedance();
    showDeck();
    animate();
  });
}

const isShown = (name) => !$(name).hidden;

function drawForces() {
  if (!isShown("forces")) return;
  const lines = [], slider = [];
  for (const slot of slotsShown()) {
    const waves = page.results[slot].full?.waves;
    if (!waves) continue;
    const time = waves.time.map((t) => 1e6 * t), mark = page.slots.B ? `, setting ${slot}` : "";
    lines.push({ x: time, y: waves.normal, name: `normal${mark}`, colour: COLOURS[0], dash: dashed(slot) });
    lines.push({ x: time, y: waves.friction, name: `friction${mark}`, colour: COLOURS[1], dash: dashed(slot) });
    slider.push({ x: time, y: waves.slider, name: `slider${mark}`, colour: COLOURS[2], dash: dashed(slot) });
  }
  const waves = page.results[page.slot]?.full?.waves;
  const label = waves
    ? `Forces over one period: normal ${si(Math.min(...waves.normal), "N")} to ${si(Math.max(...waves.normal), "N")}, friction ${si(Math.min(...waves.friction), "N")} to ${si(Math.max(...waves.friction), "N")}.`
    : "Forces over one period.";
  chart($("forces-chart"), { lines, xLabel: "time / µs", yLabel: "force / N", label });
  chart($("slider-chart"), { lines: slider, xLabel: "time / µs", yLabel: "slider / µm", label: "Displacement of the contact's slider over one period." });
}

function drawElectrical() {
  if (!isShown("electrical")) return;
  const current = [], voltage = [], groups = [], face = [], motor = motorOf(page.slots[page.slot]);
  for (const slot of slotsShown()) {
    const full = page.results[slot].full;
    if (!full) continue;
    const { waves } = full, time = waves.time.map((t) => 1e6 * t), mark = page.slots.B ? `, setting ${slot}` : "";
    motor.groups.forEach((group, at) => {
      const colour = COLOURS[at];
      voltage.push({ x: time, y: waves[`voltage_${group}`], name: `voltage ${group.toUpperCase()}${mark}`, colour, dash: dashed(slot) });
      current.push({ x: time, y: waves[`current_${group}`].map((i) => 1e3 * i), name: `current ${group.toUpperCase()}${mark}`, colour, dash: dashed(slot) });
      if (waves[`motional_${group}`]) current.push({ x: time, y: waves[`motional_${group}`].map((i) => 1e3 * i), name: `motional ${group.toUpperCase()}${mark}`, colour: COLOURS[at + 2], dash: dashed(slot) });
    });
    if (full.face > 0) face.push({ x: time, y: waves.face, name: `face${mark}`, colour: COLOURS[2], dash: dashed(slot) });
    if (slot === page.slot && full.harmonics_a) {
      groups.push({ name: "current A", values: full.harmonics_a.map((i) => 1e3 * i) });
      groups.push({ name: "current B", values: full.harmonics_b.map((i) => 1e3 * i) });
    }
  }
  chart($("voltage-chart"), { lines: voltage, xLabel: "time / µs", yLabel: "voltage / V", label: "Voltages of the groups over one period." });
  chart($("current-chart"), { lines: current, xLabel: "time / µs", yLabel: "current / mA", label: "Currents of the groups over one period." });
  $("harmonics-chart").toggleAttribute("hidden", motor.transducer);
  $("face-chart").toggleAttribute("hidden", !face.length);
  chart($("face-chart"), { lines: face, xLabel: "time / µs", yLabel: "face / µm", label: "Motion of the face over one period." });
  if (groups.length)
    bars($("harmonics-chart"), groups, `Harmonics of the currents in mA: ${groups.map((g) => `${g.name} ${g.values.map((v) => v.toPrecision(3)).join(", ")}`).join("; ")}.`);
}

function drawTorque() {
  if (!isShown("torque")) return;
  const lines = [], points = [], motor = motorOf(current());
  const [[, along, fast], [, across, strong]] = ["speed", "torque"].map((key) => shownAs(key, motor));
  for (const slot of slotsShown()) {
    const { curve, found } = page.results[slot];
    if (curve) lines.push({ x: curve.speed.map((v) => v / fast), y: curve.torque.map((t) => t / strong), name: worded(`torque${page.slots.B ? `, setting ${slot}` : ""}`, motor), colour: slot === "A" ? COLOURS[0] : COLOURS[2], dash: dashed(slot) });
    points.push({ x: found.speed / fast, y: found.torque / strong, name: slot, colour: COLOURS[1] });
  }
  if (!lines.length && points.length) points.push({ x: 0, y: 0, name: "", colour: "transparent" });
  const found = page.results[page.slot]?.found;
  const label = found ? `Torque versus speed. The motor runs at ${speedOf(found.speed, motor)} with ${torqueOf(found.torque, motor)}.` : "Torque versus speed.";
  chart($("torque-chart"), { lines, points, xLabel: `speed / (${along})`, yLabel: worded(`torque / (${across})`, motor), label: worded(label, motor) });
}

function drawResponse() {
  if (!isShown("response")) return;
  const lines = [], points = [], motor = motorOf(current()), [, unit, fast] = shownAs("speed", motor);
  for (const slot of slotsShown()) {
    const { response: falling, rising, found, settings } = page.results[slot], colour = slot === "A" ? COLOURS[0] : COLOURS[2];
    const line = (over, name, dash) => over && lines.push({ x: over.frequency.map((f) => f / 1e3), y: over.speed.map((v) => v / fast), name: page.slots.B ? `${name}, setting ${slot}` : name, colour, dash });
    line(falling, "falling", dashed(slot));
    line(rising, "rising", "2 4");
    points.push({ x: settings.frequency / 1e3, y: found.speed / fast, name: slot, colour: COLOURS[1] });
  }
  const { response: over, rising } = page.results[page.slot] ?? {};
  let label = "Speed versus frequency.";
  if (over) {
    const signs = over.speed.map(Math.sign);
    const turn = signs.findIndex((sign, i) => i > 0 && sign !== signs[i - 1] && Math.abs(over.speed[i]) > 1e-3);
    const best = over.speed.reduce((most, speed, i) => (Math.abs(speed) > Math.abs(over.speed[most]) ? i : most), 0);
    const apart = rising ? over.frequency.filter((f, i) => Math.abs(over.speed[i] - interpolated(rising.frequency, rising.speed, f)) > APART * Math.abs(over.speed[best])) : [];
    label = `Speed versus frequency: maximum ${speedOf(over.speed[best], motor)} at ${si(over.frequency[best], "Hz")}${turn > 0 ? `; it reverses near ${si(over.frequency[turn], "Hz")}` : ""}${apart.length ? `; from ${si(Math.min(...apart), "Hz")} to ${si(Math.max(...apart), "Hz")} it depends on the direction` : ""}.`;
  }
  if (over?.failed || rising?.failed) label += ` A ramp ends early: ${over?.failed || rising.failed}`;
  chart($("response-chart"), { lines, points, xLabel: "frequency / kHz", yLabel: `speed / (${unit})`, label });
  $("response-note").textContent = label;
}

function drawImpedance() {
  if (!isShown("impedance")) return;
  const lines = [], points = [], { transducer } = motorOf(current()), s = current();
  const kilo = (values) => values.map((f) => f / 1e3);
  const { admittance: cold, response: running } = page.results[page.slot] ?? {};
  if (cold) {
    lines.push({ x: kilo(cold.frequency), y: cold.free, name: transducer ? "idle" : "free tip", colour: COLOURS[0] });
    lines.push({ x: kilo(cold.frequency), y: cold.pressed, name: transducer ? "under its load" : "preloaded, at rest", colour: COLOURS[2], dash: "6 3" });
    if (transducer) points.push({ x: s.frequency / 1e3, y: interpolated(cold.frequency, cold.pressed, s.frequency), name: page.slot, colour: COLOURS[1] });
  }
  if (running) lines.push({ x: kilo(running.frequency), y: running.impedance, name: "running", colour: COLOURS[1] });
  if (page.measured) {
    const { frequency, impedance } = page.measured;
    const [low, high] = cold ? extent(cold.frequency) : extent(frequency);
    const inside = frequency.map((f, i) => i).filter((i) => frequency[i] >= low && frequency[i] <= high);
    lines.push({ x: inside.map((i) => frequency[i] / 1e3), y: inside.map((i) => impedance[i]), name: "measured", colour: COLOURS[3], dash: "2 3" });
  }
  chart($("impedance-chart"), { lines, points, log: true, xLabel: "frequency / kHz", yLabel: "|Z| of A / Ω", label: `Impedance of group A versus frequency${motorOf(s).groups[1] ? ", B shorted" : ""}: ${transducer ? "idle, under its load" : "free, preloaded, running"}, and measured if a file was dropped.` });
}

function showDeck() {
  const full = page.results[page.slot]?.full;
  if (isShown("deck") && full) $("deck-text").textContent = full.deck;
}

function animate() {
  const full = page.results[page.slot]?.full;
  if (!full) return;
  const motor = motorOf(current()), other = page.results[page.slot === "A" ? "B" : "A"]?.full;
  if (isShown("path")) {
    drawPath($("path-canvas"), full.waves, page.slots.B ? other?.waves : null, page.position, worded("rotor", motor));
    $("path-canvas").setAttribute("aria-label", `Path of the tip: ${worded(tripSize(full.waves), motor)}; separated ${percent(full.open)}, slip ${percent(full.slip)} of the time.`);
  }
  if (isShown("motor")) drawMotor($("motor-canvas"), motor, full.waves, page.position, page.angle);
}

function tripSize(waves) {
  const [x0, x1] = extent(waves.x), [y0, y1] = extent(waves.y);
  return `${(x1 - x0).toPrecision(3)} µm along, ${(y1 - y0).toPrecision(3)} µm towards the rotor`;
}

function tick(now) {
  requestAnimationFrame(tick);
  if (now - (page.before ?? 0) < FRAME_MS) return;
  const past = Math.min(0.1, (now - (page.before ?? now)) / 1000);
  page.before = now;
  if (page.playing && !document.hidden) {
    page.position = (page.position + past / SLOW_SECONDS) % 1;
    const found = page.results[page.slot]?.found;
    const fast = found?.speed ? found.speed / shownAs("speed", motorOf(current()))[2] : 0; // rad/s, or mm/s
    page.angle += (past * Math.sign(fast) * Math.sqrt(Math.abs(fast))) / 8;
    $("position").value = page.position;
    animate();
  }
}

// --- controls ---

function makeControls() {
  for (const motor of DATA.motors) $("motor-choice").append(new Option(motor.label, motor.name));
  $("motor-choice").onchange = (event) => change(defaults(DATA.motors.find((motor) => motor.name === event.target.value)));
  for (const [key, choices] of Object.entries(CHOICES)) {
    for (const [value, name] of Object.entries(choices)) $(`${key}-choice`).append(new Option(name, value));
    $(`${key}-choice`).onchange = (event) => change({ [key]: event.target.value });
  }
  for (const [key] of CONTROLS) {
    const box = $(`${key}-control`);
    const name = document.createElement("label");
    name.htmlFor = `${key}-number`;
    const now = () => shownAs(key, motorOf(current()));
    const slide = document.createElement("input"), number = document.createElement("input");
    slide.type = "range";
    number.type = "number";
    slide.id = `${key}-slider`;
    number.id = `${key}-number`;
    box.append(name, slide, number);
    let first = true;
    slide.oninput = () => {
      change({ [key]: Number(slide.value) * now()[2] }, { keep: first });
      first = false;
    };
    slide.onchange = () => (first = true);
    number.onchange = () => {
      const [label, , scale] = now(), [low, high] = motorOf(current()).limits[key], given = number.value, value = Number(given) * scale;
      if (number.value === "" || !Number.isFinite(value)) return showControls();
      const kept = clamp(value, low, high);
      change({ [key]: kept });
      if (kept !== value) say(`${label} = ${given} is not valid: it must be ${low / scale} to ${high / scale}. ${kept / scale} is used.`, { failed: true });
    };
  }
  $("preset-choice").onchange = (event) => {
    const preset = DATA.presets[Number(event.target.value)];
    if (!preset) return;
    const motor = DATA.motors.find((one) => one.name === preset.motor) ?? motorOf(current());
    change({ ...defaults(motor), ...preset.values });
    event.target.value = "";
  };
  $("stop").onclick = stop;
  $("undo").onclick = undo;
  $("play").onclick = () => play(!page.playing);
  $("position").oninput = (event) => {
    play(false);
    page.position = Number(event.target.value);
    animate();
  };
  $("slot-a").onclick = () => select("A");
  $("slot-b").onclick = () => select("B");
  $("compare").onclick = () => {
    if (page.slots.B) {
      page.slots.B = null;
      page.results.B = {};
      page.slot = "A";
    } else {
      page.slots.B = { ...current() };
      page.results.B = { ...page.results.A };
      page.slot = "B";
    }
    refresh();
  };
  $("link").onclick = () => copy(location.href, "The link is copied.");
  $("print").onclick = () => print();
  $("driver-run").onclick = () => change({ driver: $("driver-text").value.slice(0, TEXT.driver) });
  $("driver-none").onclick = () => change({ driver: "" });
  $("driver-example").onclick = () => ($("driver-text").value = DRIVER_EXAMPLE);
  $("deck-copy").onclick = () => copy($("deck-text").textContent, "The deck is copied.");
  $("deck-save").onclick = () => save(`${motorOf(current()).transducer ? "transducer" : "motor"}.cir`, $("deck-text").textContent);
  $("file").onchange = (event) => take(event.target.files[0]);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    take(event.dataTransfer?.files[0]);
  });
  document.addEventListener("keydown", (event) => {
    const typing = /^(TEXTAREA|SELECT)$/.test(event.target.tagName) || event.target.type === "number";
    if (event.key === "Escape") stop();
    else if ((event.ctrlKey || event.metaKey) && event.key === "z" && !typing) {
      event.preventDefault();
      undo();
    } else if (!typing && !event.ctrlKey && !event.metaKey && !event.altKey && event.key === "p") play(!page.playing);
    else if (!typing && !event.ctrlKey && !event.metaKey && event.key === "a" && page.slots.B) select(page.slot === "A" ? "B" : "A");
  });
  addEventListener("hashchange", () => {
    fromLink();
    refresh();
  });
  addEventListener("resize", draw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
}

function select(slot) {
  if (!page.slots[slot] || slot === page.slot) return;
  page.slot = slot;
  refresh();
}

function play(on) {
  page.playing = on;
  $("play").textContent = on ? "Pause" : "Play";
}

function showControls() {
  const s = current(), motor = motorOf(s);
  $("motor-choice").value = motor.name;
  const presets = DATA.presets.map((preset, number) => [preset, number]).filter(([preset]) => preset.motor === motor.name);
  $("preset-choice").replaceChildren(new Option("choose …", ""), ...presets.map(([preset, number]) => new Option(preset.name, number)));
  for (const key of Object.keys(CHOICES)) {
    $(`${key}-choice`).value = s[key];
    $(`${key}-control`).hidden = s[key] === undefined;
  }
  for (const option of $("law-choice").options) option.disabled = !motor.laws?.includes(option.value);
  for (const text of document.querySelectorAll("[data-words]")) {
    text.dataset.words ||= text.textContent;
    text.textContent = worded(text.dataset.words, motor);
  }
  for (const [key] of CONTROLS) {
    $(`${key}-control`).hidden = !motor.limits[key];
    if (!motor.limits[key]) continue;
    const [label, unit, scale] = shownAs(key, motor);
    const slide = $(`${key}-slider`), number = $(`${key}-number`), [low, high, step] = motor.sliders[key];
    number.labels[0].textContent = unit ? `${label}, ${unit}` : label;
    slide.setAttribute("aria-label", number.labels[0].textContent);
    const shown = String(Number((s[key] / scale).toPrecision(8))), below = Math.max(0, Math.floor((s[key] - low) / step + 1e-9));
    slide.min = Number((Number(shown) - (below * step) / scale).toPrecision(8)); // so that the value is one of the slider's
    slide.max = Math.max(high, s[key]) / scale;
    slide.step = number.step = Number((step / scale).toPrecision(8));
    number.min = motor.limits[key][0] / scale;
    number.max = motor.limits[key][1] / scale;
    slide.value = number.value = shown;
  }
  const two = s.kind === "two-tone", held = s.shaft === "held";
  const unused = [...(two ? ["phase"] : ["voltage_2", "frequency_2", "phase_2"]), held ? "torque" : "speed", ...(s.mount === "sprung" ? [] : ["stiffness"])];
  for (const key of unused) $(`${key}-control`).hidden = true;
  if (document.activeElement !== $("driver-text")) $("driver-text").value = s.driver;
  $("undo").disabled = page.undone.length === 0;
  $("compare").textContent = page.slots.B ? "Remove setting B" : "Compare two settings";
  for (const slot of ["A", "B"]) $(`slot-${slot.toLowerCase()}`).setAttribute("aria-pressed", String(slot === page.slot));
  $("slot-b").hidden = !page.slots.B;
  $("slot-a").hidden = !page.slots.B;
  $("motor-note").textContent = motor.transducer || hasAveraged(motor) ? motor.description : `${motor.description}. The averaged motor leaves out a loss of this motor: all numbers come cycle by cycle, without curves over speed and frequency.`;
}

function showFaults(faults, words = []) {
  const list = $("driver-faults");
  list.replaceChildren();
  for (const { line, message } of faults) {
    const entry = document.createElement("li");
    entry.textContent = line >= 0 ? `Line ${line + 1}: ${message}` : message;
    list.append(entry);
  }
  $("driver-log").textContent = words.slice(0, 40).join("\n");
  const lines = $("driver-lines"), count = $("driver-text").value.split("\n").length;
  lines.textContent = Array.from({ length: count }, (_, number) => (faults.some((fault) => fault.line === number) ? `${number + 1} ✗` : String(number + 1))).join("\n");
}

async function copy(text, done) {
  try {
    await navigator.clipboard.writeText(text);
    say(done);
  } catch {
    say("The browser does not allow copying here; select the text, or copy the address.", { failed: true });
  }
}

function save(name, text) {
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  anchor.download = name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 1000);
}

async function take(file) {
  if (!file) return;
  try {
    if (file.size > LARGEST_FILE) throw new Error("The file is larger than 20 MB.");
    page.measured = readSpectrum(file.name, await file.text());
    $("file-note").textContent = `${file.name}: ${page.measured.frequency.length} points, ${si(page.measured.frequency[0], "Hz")} to ${si(last(page.measured.frequency), "Hz")}. The file stays in this page.`;
  } catch (error) {
    page.measured = null;
    $("file-note").textContent = `${file.name}: ${error.message}`;
  }
  draw();
}

// --- start ---

async function unpacked(id) {
  const text = $(id).textContent.trim();
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  $(id).remove();
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
}

async function begin() {
  try {
    Object.assign(DATA, JSON.parse(new TextDecoder().decode(await unpacked("data"))));
    for (const motor of DATA.motors) {
      const rows = Object.entries(ranges(motor));
      [motor.limits, motor.sliders] = [0, 1].map((place) => Object.fromEntries(rows.map(([key, row]) => [key, row[place]])));
    }
    fromLink();
    makeControls();
    play(!matchMedia("(prefers-reduced-motion: reduce)").matches);
    showControls();
    showFirst();
    const module = await WebAssembly.compile(await unpacked("wasm"));
    const source = URL.createObjectURL(new Blob([$("worker").textContent], { type: "text/javascript" }));
    page.main = new Engine(module, source);
    page.side = new Engine(module, source);
    requestAnimationFrame(tick);
    refresh();
  } catch (error) {
    root.dataset.state = "failed";
    say(`The engine did not start: ${error.message}`, { failed: true });
  }
}

setTimeout(begin, 0); // after the first paint
