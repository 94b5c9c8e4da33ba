// SPDX-License-Identifier: GPL-3.0-or-later
// From a setting to numbers: fill in decks, run them in the worker, reduce their waveforms to means and amplitudes.

const GRIP = 1e3; // N·m·s, of the brake that holds the shaft: at 10 mN·m the speed is 10 µrad/s off
const GRIP_LINEAR = 1e6; // N·s/m, of that which holds a slider: at 10 N the speed is 10 µm/s off

/** One worker. A run that is no longer wanted ends with the worker; the next run starts another one. */
class Engine {
  constructor(module, source) {
    this.module = module;
    this.source = source;
    this.number = 0;
    this.start();
  }

  start() {
    this.worker = new Worker(this.source);
    this.worker.postMessage({ module: this.module });
    this.worker.onmessage = ({ data }) => {
      const run = this.current;
      if (!run || data.id !== run.id) return;
      if (data.progress !== undefined) run.progress?.(data.progress);
      else {
        this.current = null;
        run.done(data);
      }
    };
    this.worker.onerror = (event) => {
      event.preventDefault();
      const run = this.current;
      this.current = null;
      run?.done({ id: run.id, status: 1, log: [event.message || "The engine stopped."] });
    };
  }

  /** Run a deck. Resolves to its vectors, or rejects with ngspice's words; a dropped run rejects with Dropped. */
  async run(deck, { bytes = 0, progress } = {}) {
    this.drop();
    const id = (this.number += 1);
    const data = await new Promise((done, fail) => {
      this.current = { id, done, fail, progress };
      this.worker.postMessage({ id, deck, bytes });
    });
    return checked(data, deck);
  }

  /** End the current run. */
  drop() {
    if (!this.current) return;
    const { fail } = this.current;
    this.current = null;
    this.worker.terminate();
    this.start();
    fail(new Dropped());
  }
}

class Dropped extends Error {}

class Failed extends Error {
  constructor(message, log, vectors) {
    super(message);
    this.log = log;
    this.vectors = vectors; // up to the failure
  }
}

const WRONG = /error|fatal|timestep too small|singular|aborted|no such|unknown|undefined|cannot|can't|failed|not found|doAnalyses|too few|too many|unrecognized|syntax/i;
const HARMLESS = /^(Doing analysis|Using|Total|CPU|DRAM|Note|Reference value|Trying|One successful|Dynamic|Source stepping)/i;

/** Return the vectors of a run that ended as it should; a status of 0 alone does not say that. */
function checked(data, deck) {
  const wrong = (data.log ?? []).filter((line) => WRONG.test(line) && !HARMLESS.test(line));
  const time = data.vectors?.time;
  const stop = Number(/^\.param stop=(\S+)/m.exec(deck)?.[1] ?? 0);
  if (data.status !== 0 || !data.vectors || !data.points || wrong.length)
    throw new Failed(wrong[0] ?? "ngspice gave no result.", data.log ?? [], data.vectors);
  if (time && stop && /^\.tran/m.test(deck) && time[time.length - 1] < stop * (1 - 1e-6))
    throw new Failed(`ngspice stopped at ${time[time.length - 1]} s of ${stop} s.`, data.log);
  for (const values of Object.values(data.vectors))
    if (!Number.isFinite(values[values.length - 1])) throw new Failed("A result is not a finite number.", data.log);
  return data.vectors;
}

/** Write numbers on the .param lines of a deck, not on those of its subcircuits. Only finite numbers get there. */
function filled(deck, values) {
  const circuit = deck.search(/^\.subckt /m);
  const settings = deck.slice(0, circuit).replace(/^(\.param (\w+)=)\S+/gm, (line, head, name) => {
    if (!Object.hasOwn(values, name)) return line;
    if (!Number.isFinite(values[name])) throw new Failed(`${name} is not a number.`, []);
    return head + Number(values[name].toPrecision(12));
  });
  return settings + deck.slice(circuit);
}

// --- settings to parameters ---

const TURN = 2 * Math.PI;

function parameters(motor, s) {
  const twoTone = s.kind === "two-tone";
  return {
    voltage: s.voltage, frequency: s.frequency, phase: twoTone ? 0 : s.phase, preload: s.preload, friction: s.friction,
    torque: s.shaft === "held" ? 0 : s.torque, grip: s.shaft === "held" ? (motor.linear ? GRIP_LINEAR : GRIP) : 0,
    held: s.shaft === "held" ? s.speed : 0, mount_stiffness: s.stiffness,
    voltage_2: twoTone ? s.voltage_2 : 0, frequency_2: twoTone ? s.frequency_2 : 2 * s.frequency,
    phase_2: twoTone ? s.phase_2 : 0, ...(s.load === undefined ? {} : { load: s.load }),
  };
}

/** Time after which both voltages repeat. */
function period(s) {
  if (s.kind !== "two-tone") return 1 / s.frequency;
  for (let many = 1; many <= 20; many += 1) {
    const ratio = (s.frequency_2 / s.frequency) * many;
    if (Math.abs(ratio - Math.round(ratio)) < 1e-6 * many) return many / s.frequency;
  }
  return 1 / s.frequency;
}

/** Slope of torque over speed to begin with: half of the friction torque over the speed of the tip. */
const firstSlope = (motor, s, tipVelocity) => (0.5 * s.friction * s.preload * motor.radius ** 2) / Math.max(tipVelocity, 0.01);

/** An inertia with which the speed takes some periods to settle; never more than the rotor's. */
const quickInertia = (motor, s, slope) => Math.min(motor.inertia, (slope * LIGHT) / s.frequency);

// --- reductions ---

const last = (values) => values[values.length - 1];

/** Mean of a function of the point's number over the time from `start` to the end. */
function mean(time, start, f) {
  let first = 0;
  while (time[first] < start) first += 1;
  let sum = 0;
  if (first > 0) sum += 0.5 * (f(first) + between(time, start, first, f)) * (time[first] - start);
  for (let i = first + 1; i < time.length; i += 1) sum += 0.5 * (f(i) + f(i - 1)) * (time[i] - time[i - 1]);
  return sum / (last(time) - start);
}

/** Value of a function at a time that lies before the point `next`. */
function between(time, at, next, f) {
  const share = (time[next] - at) / (time[next] - time[next - 1]);
  return share * f(next - 1) + (1 - share) * f(next);
}

/** Fourier amplitudes of a vector over whole periods at the end: harmonic → [real, imaginary], of exp(j w t). */
function harmonics(time, values, base, periods, count) {
  const start = last(time) - periods / base;
  const found = [];
  for (let order = 1; order <= count; order += 1) {
    const w = TURN * base * order;
    found.push([
      2 * mean(time, start, (i) => values[i] * Math.cos(w * time[i])),
      -2 * mean(time, start, (i) => values[i] * Math.sin(w * time[i])),
    ]);
  }
  return found;
}

// --- the averaged motor ---

async function averaged(engine, motor, s) {
  const values = parameters(motor, s);
  const stop = Math.max(0.2, 40 * motor.carrierTime);
  const v = await engine.run(filled(motor.decks[`averaged ${s.mount}`], { ...values, stop }));
  const end = (name) => last(v[name]);
  const amplitude = (name) => [end(name.replace("?", "re")), end(name.replace("?", "im"))];
  const power = (group) =>
    -0.5 * (end(`v(${group}_re)`) * end(`i(v${group}_re)`) + end(`v(${group}_im)`) * end(`i(v${group}_im)`));
  const w = TURN * s.frequency;
  const start = {};
  motor.modes.forEach((mode, number) => {
    const index = number + 1;
    let place = end(`v(xmotor.xbending${index}.r)`), velocity = 0;
    for (let order = 1; order <= motor.harmonics; order += 1) {
      const [re, im] = amplitude(`v(xmotor.xmode${index}_${order}.r_?)`);
      const angle = (-order * Math.PI) / 2; // the drive is a sine: it starts a quarter of a period before its peak
      place += re * Math.cos(angle) - im * Math.sin(angle);
      velocity -= 1e-6 * order * w * (re * Math.sin(angle) + im * Math.cos(angle));
    }
    start[`start_${index}`] = place;
    start[`velocity_${index}`] = velocity;
  });
  start.slider = end(`v(${motor.slider})`);
  start.speed = end("v(shaft)");
  if (s.mount === "sprung") start.carrier = (1e6 * end("v(xmotor.xmount.elastic)")) / s.stiffness;
  const swing = 1e-6 * Math.hypot(...amplitude("v(xmotor.x_?1)"));
  const rms = (group) => Math.hypot(...amplitude(`i(v${group}_?)`)) / Math.SQRT2;
  const impedance = (group) => {
    const [ur, ui] = amplitude(`v(${group}_?)`), [ir, ii] = amplitude(`i(v${group}_?)`);
    return Math.hypot(ur, ui) / Math.max(Math.hypot(ir, ii), 1e-30);
  };
  return {
    model: "averaged", speed: s.shaft === "held" ? s.speed : end("v(shaft)"), torque: motor.radius * end("v(xmotor.friction)"),
    normal: end("v(xmotor.normal)"), current_a: rms("a"), current_b: rms("b"), power_a: power("a"), power_b: power("b"),
    heat: end("v(heat)"), open: clamp(end("v(xmotor.open)"), 0, 1), slip: clamp(end("v(xmotor.slip)"), 0, 1),
    check: end("v(xmotor.check)"), impedance: impedance("a"), tipVelocity: w * swing, start,
  };
}

// --- cycle by cycle ---

const BLOCK = 40, WINDOW = 20; // periods of the drive in a run, and of them those at the end for the means
const DRIVER_BLOCK = 100, COLD_BLOCK = 120; // with a driver, whose own state starts anew; from rest
const MOST_BLOCKS = 24, MOST_SPINNING = 72;
const SWINGS = 4; // of the torque about zero, after which the rotor alone moves the speed
const LIGHT = 20; // periods in which the speed of a light rotor settles, for a run from rest
const RESONANT_VELOCITY = 1.3; // m/s, of the tip of a motor at resonance; a lighter rotor lags less behind a ramp
const SETTLED = 0.001; // change of the speed that is left, over the speed

/**
 * Run the full motor block after block; tell every block.
 *
 * After each run the speed is set where torque and load balance, by the secant rule, so that the rotor with its inertia
 * needs not spin up. A run from rest has a light rotor.
 */
async function cycles(engine, motor, s, quick, tell, progress) {
  const values = parameters(motor, s);
  const many = Math.max(1, Math.round(period(s) * s.frequency));
  const whole = (periods) => (Math.ceil(periods / many) * many) / s.frequency;
  const own = s.driver.trim() !== "";
  const name = `${own ? "driver" : "cycles"} ${s.mount} ${s.law}`;
  const deck = own ? withDriver(motor.decks[name], s.driver) : motor.decks[name];
  const step = own ? Math.min(motor.driverStep, 1 / (motor.driverPoints * s.frequency)) : motor.step;
  const window = whole(WINDOW);
  let tipVelocity = quick?.tipVelocity ?? 0.3;
  let slope = firstSlope(motor, s, tipVelocity);
  let start = quick?.start ?? {};
  let before = null, result = null, swings = 0;
  for (let block = 0; block < (swings < SWINGS ? MOST_BLOCKS : MOST_SPINNING); block += 1) {
    const cold = !quick && block === 0;
    const stop = whole(cold ? COLD_BLOCK : own ? DRIVER_BLOCK : before?.near ? 2 * BLOCK : BLOCK);
    const inertia = cold ? quickInertia(motor, s, slope) : motor.inertia;
    const ready = filled(deck, { ...values, ...start, inertia, stop, window, step });
    const bytes = stop / step > 8000 ? (stop / step) * 8 * motor.vectors : 0;
    const v = await engine.run(ready, { bytes, progress });
    result = { ...reduced(motor, s, v, window, ready, own), blocks: block + 1, settled: false };
    if (cold) tipVelocity = Math.max(0.01, tipSpeed(v, window));
    const net = s.shaft === "held" ? 0 : (inertia * result.gain) / window;
    if (before && Math.abs(result.speed - before.speed) > 1e-9) {
      const secant = -(net - before.net) / (result.speed - before.speed);
      const first = firstSlope(motor, s, tipVelocity);
      if (secant > 0) slope = clamp(secant, 0.03 * first, 8 * first);
    } else slope = firstSlope(motor, s, tipVelocity);
    const correction = net / slope;
    // modes that ring for longer than a run follow the speed with a lag, so that corrections swing about the balance
    if (before && net * before.net < 0 && Math.abs(net) > 0.3 * Math.abs(before.net)) swings += 1;
    const scale = Math.max(Math.abs(result.speed), (0.05 * tipVelocity) / motor.radius);
    const steady = before && Math.abs(result.measured - before.measured) < 0.005 * s.friction * s.preload * motor.radius;
    const left = Math.abs(net) / Math.min(slope, firstSlope(motor, s, tipVelocity)); // of the speed; a secant may be too steep
    const near = Boolean(steady) && left < SETTLED * scale;
    result.settled = near && before.near; // twice: the modes follow the speed with a lag
    // the torque of the load and the bearing; the rest accelerates the rotor, and is zero at a steady speed
    if (s.shaft !== "held") result.torque = balance(motor, s, result.speed) + (result.settled ? 0 : net);
    tell(result);
    if (result.settled) break;
    before = { speed: result.speed, measured: result.measured, net, near };
    start = continued(motor, s, v);
    const most = (0.3 * tipVelocity) / motor.radius;
    if (s.shaft !== "held" && swings < SWINGS) start.speed += clamp(correction, -most, most);
  }
  return result;
}

/** Torque that load and bearing take at a speed. */
const balance = (motor, s, speed) => s.torque + motor.bearing * speed + motor.dryBearing * Math.sign(speed);

/** Amplitude of the tip's velocity along the rotor. */
function tipSpeed(v, window) {
  const x = v["v(xmotor.x)"], from = last(v.time) - window;
  return Math.SQRT2 * Math.sqrt(mean(v.time, from, (i) => (i > 0 ? ((1e-6 * (x[i] - x[i - 1])) / (v.time[i] - v.time[i - 1])) ** 2 : 0)));
}

/** Parameters of the motion of the modes at the end of a run. */
function modesAfter(motor, v) {
  const start = {};
  motor.modes.forEach((mode, number) => {
    const index = number + 1;
    start[`start_${index}`] = (1e6 * last(v[`v(xmotor.xmode${index}.elastic)`])) / mode.stiffness;
    start[`velocity_${index}`] = last(v[`i(v.xmotor.xmode${index}.vvelocity)`]);
  });
  return start;
}

/** Parameters of the motion at the end of a run. */
function continued(motor, s, v) {
  const start = { slider: last(v["v(xmotor.slider)"]), speed: last(v["v(shaft)"]), ...modesAfter(motor, v) };
  if (motor.dryBearing) start.bearing_share = last(v["v(xmotor.xbearing.share)"]);
  if (s.mount === "sprung") {
    start.carrier = (1e6 * last(v["v(xmotor.xmount.elastic)"])) / s.stiffness;
    start.carrier_velocity = last(v["i(v.xmotor.xmount.vvelocity)"]);
  }
  return start;
}

function reduced(motor, s, v, window, deck, own) {
  const time = v.time, from = last(time) - window;
  const over = (f) => mean(time, from, f);
  const at = (moment, f) => between(time, moment, time.findIndex((t) => t >= moment), f);
  const [ia, ib] = own ? ["i(vpin_a)", "i(vpin_b)"] : ["i(va)", "i(vb)"];
  const sign = own ? 1 : -1;
  const rms = (name) => Math.sqrt(over((i) => v[name][i] ** 2));
  const friction = v["v(xmotor.friction)"], shaft = v["v(shaft)"], state = v["v(xmotor.state)"];
  const power_a = over((i) => sign * v["v(a)"][i] * v[ia][i]);
  const power_b = over((i) => sign * v["v(b)"][i] * v[ib][i]);
  const torque = motor.radius * over((i) => friction[i]);
  const speed = s.shaft === "held" ? s.speed : over((i) => shaft[i]); // not the creep of the brake
  // the power that does not come to the modes is the dielectric loss
  let heat = power_a + power_b;
  motor.modes.forEach(({ damping, coupling: [a, b] }, n) => {
    const velocity = v[`i(v.xmotor.xmode${n + 1}.vvelocity)`];
    heat += over((i) => velocity[i] * (damping * velocity[i] - a * v["v(a)"][i] - b * v["v(b)"][i]));
  });
  const base = 1 / period(s);
  const many = Math.max(1, Math.round(window * base));
  return {
    model: "cycles", speed, torque, measured: torque, normal: over((i) => v["v(xmotor.normal)"][i]), current_a: rms(ia), current_b: rms(ib),
    power_a, power_b, heat, gain: last(shaft) - at(from, (i) => shaft[i]),
    open: over((i) => (state[i] < 0.5 ? 1 : 0)), slip: over((i) => clamp(state[i] - 1, 0, 1)),
    harmonics_a: spectrum(time, v[ia], base, many), harmonics_b: spectrum(time, v[ib], base, many),
    harmonics_u: spectrum(time, v["v(a)"], base, many), base, waves: tail(motor, v, base, ia, ib, sign), deck,
  };
}

/** Return the sentences of the package on the limits that a result exceeds: stress of the ceramic and temperature. */
function exceeded({ rated, thermalResistance }, { heat, waves }) {
  if (!rated) return [];
  const { strength, ambient, most } = rated, rise = heat * thermalResistance, temperature = ambient + rise;
  const at = (point, i) => Math.abs(point.reduce((sum, part, n) => sum + part * waves.modes[n][i], 0));
  const stress = waves ? Math.max(0, ...rated.stress.map((point) => waves.time.reduce((top, _, i) => Math.max(top, at(point, i)), 0))) : 0;
  const values = { stress, strength, rise, temperature, most };
  const written = (sentence) => sentence.replace(/\{(\w+):\.3g\}/g, (_, name) => String(Number(values[name].toPrecision(3))));
  return [...(stress > strength ? [written(rated.stressed)] : []), ...(temperature > most ? [written(rated.heated)] : [])];
}

const spectrum = (time, values, base, many) => harmonics(time, values, base, many, 9).map(([re, im]) => Math.hypot(re, im));

/** Number of the point at which the last period begins. */
function lastPeriod(time, base) {
  let first = time.length - 1;
  while (first > 0 && time[first] > last(time) - 1 / base) first -= 1;
  return first;
}

/** The last period of the waveforms, with the deflection of the modes. */
function tail(motor, v, base, ia, ib, sign) {
  const time = v.time, first = lastPeriod(time, base);
  const cut = (name, gain = 1) => Array.from(v[name].subarray(first), (value) => gain * value);
  return {
    time: Array.from(time.subarray(first), (value) => value - time[first]),
    x: cut("v(xmotor.x)"), y: cut("v(xmotor.y)"), normal: cut("v(xmotor.normal)"), friction: cut("v(xmotor.friction)"),
    slider: cut("v(xmotor.slider)"), state: cut("v(xmotor.state)"), shaft: cut("v(shaft)"),
    voltage_a: cut("v(a)"), voltage_b: cut("v(b)"), current_a: cut(ia, sign), current_b: cut(ib, sign),
    modes: motor.modes.map((mode, n) => cut(`v(xmotor.xmode${n + 1}.elastic)`, 1e6 / mode.stiffness)),
  };
}

// --- curves ---

async function speedTorque(engine, motor, s, quick) {
  const scale = quick.tipVelocity / motor.radius;
  const reach = Math.max(1.3 * Math.abs(quick.speed), 0.15 * scale);
  const sign = quick.speed < 0 ? -1 : 1;
  const values = { ...parameters(motor, s), torque: 0, grip: 0, slowest: -0.15 * sign * reach, fastest: sign * reach };
  return curveOf(motor, await engine.run(filled(motor.decks[`curve ${s.mount}`], values)));
}

function curveOf(motor, v) {
  const first = v.time.findIndex((time) => time > 0.2 * last(v.time));
  return {
    speed: Array.from(v["v(shaft)"].subarray(first)),
    torque: Array.from(v["v(xmotor.friction)"].subarray(first), (force) => motor.radius * force),
  };
}

const FEWEST_POINTS = 100; // of a response that ends early, where the contact opens for most of a period

async function response(engine, motor, s, quick, first_frequency, last_frequency) {
  const inertia = quickInertia(motor, s, firstSlope(motor, s, Math.max(quick.tipVelocity, RESONANT_VELOCITY)));
  const values = { ...parameters(motor, s), inertia, first_frequency, last_frequency };
  let v, failed = "";
  try {
    v = await engine.run(filled(motor.decks[`response ${s.mount}`], values));
  } catch (error) {
    if (!(error.vectors?.time?.length > FEWEST_POINTS)) throw error;
    [v, failed] = [error.vectors, error.message];
  }
  const first = v.time.findIndex((time) => time > 0.1 * last(v.time));
  const part = (name) => Array.from(v[name].subarray(first));
  const magnitude = (name) => {
    const re = part(name.replace("?", "re")), im = part(name.replace("?", "im"));
    return re.map((value, i) => Math.hypot(value, im[i]));
  };
  const voltage = magnitude("v(a_?)"), current = magnitude("i(va_?)");
  return { failed, frequency: part("v(f)"), speed: part("v(shaft)"), impedance: voltage.map((u, i) => u / current[i]) };
}

async function admittance(engine, motor, s) {
  const near = motor.transducer ? { lowest: 0.9 * s.frequency, highest: 1.1 * s.frequency } : {};
  const v = await engine.run(filled(motor.decks.admittance, { ...parameters(motor, s), ...near }));
  const frequency = Array.from(v.frequency).filter((_, i) => i % 2 === 0);
  const impedance = (state) =>
    frequency.map((_, i) => 1 / Math.hypot(v[`i(va_${state}_a)`][2 * i], v[`i(va_${state}_a)`][2 * i + 1]));
  return { frequency, free: impedance("free"), pressed: impedance("pressed") };
}

/** Value at x of a line over ascending xs. */
function interpolated(xs, ys, x) {
  if (x >= last(xs)) return last(ys);
  const next = Math.max(1, xs.findIndex((other) => other >= x)), share = clamp((x - xs[next - 1]) / (xs[next] - xs[next - 1]), 0, 1);
  return ys[next - 1] + share * (ys[next] - ys[next - 1]);
}

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
