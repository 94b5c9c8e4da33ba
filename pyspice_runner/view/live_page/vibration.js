// SPDX-License-Identifier: GPL-3.0-or-later
// A transducer: its steady state by small signals, and the run that starts from it.

const POINTS_PER_PERIOD = 100; // of the waveforms that follow from amplitudes

/** Amplitudes at the frequency of the drive, the waveforms of one period that they mean, and the motion at its start. */
async function steadyState(engine, motor, s) {
  const deck = filled(motor.decks.steady, parameters(motor, s)), w = TURN * s.frequency;
  const { frequency: _, ...amplitudes } = await engine.run(deck);
  const time = Float64Array.from({ length: POINTS_PER_PERIOD + 1 }, (_, i) => i / (POINTS_PER_PERIOD * s.frequency));
  const v = { time }, start = {};
  for (const [name, [re, im]] of Object.entries(amplitudes)) v[name] = time.map((t) => re * Math.sin(w * t) + im * Math.cos(w * t));
  motor.modes.forEach((_, n) => {
    const [re, im] = amplitudes[velocityOf(n)];
    start[`start_${n + 1}`] = (-1e6 * re) / w;
    start[`velocity_${n + 1}`] = im;
  });
  return { ...vibrationOf(motor, s, v, 1 / s.frequency, deck), model: "steady", start };
}

/** Run a transducer from its steady state, block after block, until its power is equal to the power of the block before. */
async function vibration(engine, motor, s, quick, tell, progress) {
  const window = WINDOW / s.frequency, stop = BLOCK / s.frequency, { step } = motor;
  let { start } = quick, before = quick, result;
  for (let block = 0; block < MOST_BLOCKS && !result?.settled; block += 1) {
    const deck = filled(motor.decks.cycles, { ...parameters(motor, s), ...start, stop, window, step });
    const v = await engine.run(deck, { progress, bytes: (stop / step) * 8 * motor.vectors });
    result = { ...vibrationOf(motor, s, v, window, deck), model: "cycles", blocks: block + 1 };
    result.settled = Math.abs(result.power - before.power) < SETTLED * Math.abs(before.power);
    tell(result);
    [before, start] = [result, modesAfter(motor, v)];
  }
  return result;
}

const velocityOf = (n) => `i(v.xmotor.xmode${n + 1}.vvelocity)`;

/** Powers, currents and motion of a transducer in the time `window` at the end of its waveforms. */
function vibrationOf(motor, s, v, window, deck) {
  const { time } = v, first = lastPeriod(time, s.frequency), over = (f) => mean(time, last(time) - window, f);
  const rms = (values) => Math.sqrt(over((i) => values[i] ** 2));
  const cut = (values, gain = 1) => Array.from(values.subarray(first), (value) => gain * value);
  const found = { deck, power: 0, apparent: 0, delivered: 0, face: 1e-6 * Math.SQRT2 * rms(v["v(xmotor.y)"]) };
  const waves = { time: cut(time).map((t) => t - time[first]), face: cut(v["v(xmotor.y)"]) };
  waves.modes = motor.modes.map(({ stiffness }, n) => cut(v[`v(xmotor.xmode${n + 1}.elastic)`], 1e6 / stiffness));
  motor.groups.forEach((group, at) => {
    const u = v[`v(${group})`], i = v[`i(v${group})`];
    const motional = time.map((_, k) => motor.modes.reduce((sum, { coupling }, n) => sum + coupling[at] * v[velocityOf(n)][k], 0));
    found[`current_${group}`] = rms(i);
    found[`motional_${group}`] = Math.SQRT2 * rms(motional);
    found.power -= over((k) => u[k] * i[k]);
    found.apparent += rms(u) * rms(i);
    Object.assign(waves, { [`voltage_${group}`]: cut(u), [`current_${group}`]: cut(i, -1), [`motional_${group}`]: cut(motional) });
    found.delivered += over((k) => u[k] * motional[k]);
  });
  // the load takes what comes to the modes and is not lost in them
  motor.modes.forEach(({ damping }, n) => (found.delivered -= damping * rms(v[velocityOf(n)]) ** 2));
  if (!s.load) found.delivered = 0; // without the rounding of a difference
  return { ...found, heat: found.power - found.delivered, waves };
}

/** Quantities of a transducer and their values in words. */
function vibrationRows(motor, found) {
  const groups = motor.groups.flatMap((group) => [
    [`current of ${group.toUpperCase()}, RMS`, si(found[`current_${group}`], "A")],
    [`motional current of ${group.toUpperCase()}, amplitude`, si(found[`motional_${group}`], "A")],
  ]);
  const warm = motor.rated ? `, +${(found.heat * motor.thermalResistance).toFixed(0)} K when warm, in still air` : "";
  return [
    ["electrical power", si(found.power, "W")],
    ["power factor", (found.power / found.apparent).toFixed(3)],
    ...groups,
    ...(found.face > 0 ? [["motion of the face, amplitude", si(found.face, "m")]] : []),
    ...(found.delivered ? [["power into the load", si(found.delivered, "W")]] : []),
    ["losses", si(found.heat, "W") + warm],
  ];
}
