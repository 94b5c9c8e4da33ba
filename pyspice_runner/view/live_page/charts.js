// SPDX-License-Identifier: GPL-3.0-or-later
// Line charts as SVG, and the moving pictures of tip, beam and rotor.

const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#BA6A98"];
const STATE_COLOURS = ["#009E73", "#0072B2", "#D55E00"]; // separated, stick, slip

function element(name, attributes = {}, text) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

/** Values at which to label an axis. */
function ticks(low, high, log) {
  if (log) {
    const found = [];
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1)
      for (const digit of Math.log10(high / low) > 2 ? [1] : [1, 2, 5]) found.push(digit * 10 ** power);
    return found.filter((value) => value >= low * 0.999 && value <= high * 1.001);
  }
  const raw = (high - low) / 5, size = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].find((many) => many * size >= raw) * size;
  const found = [];
  for (let value = Math.ceil(low / step) * step; value <= high + 1e-9 * step; value += step) found.push(value);
  return found;
}

const tickText = (value) => (Math.abs(value) < 1e-12 ? "0" : signed(Number(value.toPrecision(4))));

/** Draw lines [{x, y, name, colour, dash}] and points [{x, y, name, colour}] into an SVG element. */
function chart(svg, { lines = [], points = [], xLabel, yLabel, log = false, equal = false, label }) {
  const width = Math.max(280, svg.clientWidth || 560), height = Math.max(200, svg.clientHeight || 280);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", label);
  svg.replaceChildren();
  const shown = lines.filter((line) => line.x.length > 1);
  const xs = [...shown.flatMap((line) => extent(line.x)), ...points.map((point) => point.x)];
  const ys = [...shown.flatMap((line) => extent(line.y)), ...points.map((point) => point.y)];
  if (xs.length < 2) return;
  let [x0, x1] = widened(extent(xs), 0, false), [y0, y1] = widened(extent(ys), 0.06, log);
  const left = 64, right = 10, bottom = 42, entry = 165; // of the legend, px
  const columns = Math.max(1, Math.floor((width - left) / entry)), top = 10 + 18 * Math.ceil(shown.length / columns);
  if (equal) {
    const per = Math.max((x1 - x0) / (width - left - right), (y1 - y0) / (height - top - bottom));
    [x0, x1] = about(x0, x1, per * (width - left - right));
    [y0, y1] = about(y0, y1, per * (height - top - bottom));
  }
  const px = (x) => left + ((x - x0) / (x1 - x0)) * (width - left - right);
  const share = (y) => (log ? Math.log(y / y0) / Math.log(y1 / y0) : (y - y0) / (y1 - y0));
  const py = (y) => height - bottom - share(Math.max(y, log ? y0 : -Infinity)) * (height - top - bottom);
  for (const value of ticks(x0, x1, false)) {
    svg.append(element("line", { x1: px(value), x2: px(value), y1: top, y2: height - bottom, class: "grid" }));
    svg.append(element("text", { x: px(value), y: height - bottom + 15, "text-anchor": "middle" }, tickText(value)));
  }
  for (const value of ticks(y0, y1, log)) {
    svg.append(element("line", { x1: left, x2: width - right, y1: py(value), y2: py(value), class: "grid" }));
    svg.append(element("text", { x: left - 6, y: py(value) + 4, "text-anchor": "end" }, tickText(value)));
  }
  svg.append(element("text", { x: (left + width - right) / 2, y: height - 6, "text-anchor": "middle" }, xLabel));
  svg.append(element("text", { x: 12, y: (top + height - bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${(top + height - bottom) / 2})` }, yLabel));
  shown.forEach((line, number) => {
    const colour = line.colour ?? COLOURS[number % COLOURS.length];
    const every = Math.ceil(line.x.length / 1200);
    const d = [];
    for (let i = 0; i < line.x.length; i += every)
      if (Number.isFinite(line.y[i])) d.push(`${d.length ? "L" : "M"}${px(line.x[i]).toFixed(1)} ${py(line.y[i]).toFixed(1)}`);
    svg.append(element("path", { d: d.join(""), stroke: colour, "stroke-dasharray": line.dash ?? "", class: "line" }));
    const lx = left + (number % columns) * entry, ly = 14 + 18 * Math.floor(number / columns);
    svg.append(element("line", { x1: lx, x2: lx + 20, y1: ly - 4, y2: ly - 4, stroke: colour, "stroke-dasharray": line.dash ?? "", class: "line" }));
    svg.append(element("text", { x: lx + 25, y: ly }, line.name));
  });
  for (const point of points) {
    svg.append(element("circle", { cx: px(point.x), cy: py(point.y), r: 6, fill: point.colour ?? COLOURS[1], class: "point" }));
    const end = px(point.x) > width - 130;
    svg.append(element("text", { x: px(point.x) + (end ? -10 : 10), y: py(point.y) - 8, "text-anchor": end ? "end" : "start" }, point.name));
  }
}

function extent(values) {
  let low = Infinity, high = -Infinity;
  for (const value of values)
    if (Number.isFinite(value)) {
      low = Math.min(low, value);
      high = Math.max(high, value);
    }
  return [low, high];
}

function widened([low, high], part, log) {
  if (log) return [low * 0.9, high * 1.1];
  const more = high > low ? part * (high - low) : Math.max(1e-9, 0.1 * Math.abs(high));
  return [low - more, high + more];
}

function about(low, high, size) {
  const middle = (low + high) / 2;
  return [middle - size / 2, middle + size / 2];
}

/** Draw bars, one group of them for each order. */
function bars(svg, groups, label) {
  const width = Math.max(280, svg.clientWidth || 560), height = Math.max(200, svg.clientHeight || 280);
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  svg.setAttribute("role", "img");
  svg.setAttribute("aria-label", label);
  svg.replaceChildren();
  const highest = Math.max(...groups.flatMap((group) => group.values), 1e-12);
  const top = 26, bottom = 40, left = 64, orders = groups[0].values.length;
  const lowest = highest * 1e-3;
  const py = (value) => top + (1 - Math.log(Math.max(value, lowest) / lowest) / Math.log(highest / lowest)) * (height - top - bottom);
  for (const value of ticks(lowest, highest, true)) {
    svg.append(element("line", { x1: left, x2: width, y1: py(value), y2: py(value), class: "grid" }));
    svg.append(element("text", { x: left - 6, y: py(value) + 4, "text-anchor": "end" }, tickText(value)));
  }
  const room = (width - left) / orders;
  groups.forEach((group, number) => {
    const colour = COLOURS[number];
    group.values.forEach((value, order) => {
      const w = (0.7 * room) / groups.length;
      svg.append(element("rect", { x: left + order * room + 0.15 * room + number * w, y: py(value), width: w, height: height - bottom - py(value), fill: colour }));
      if (number === 0) svg.append(element("text", { x: left + (order + 0.5) * room, y: height - bottom + 15, "text-anchor": "middle" }, order + 1));
    });
    svg.append(element("rect", { x: left + 130 * number, y: 4, width: 14, height: 12, fill: colour }));
    svg.append(element("text", { x: left + 130 * number + 20, y: 14 }, group.name));
  });
  svg.append(element("text", { x: (left + width) / 2, y: height - 6, "text-anchor": "middle" }, "harmonic"));
  svg.append(element("text", { x: 12, y: height / 2, "text-anchor": "middle", transform: `rotate(-90 12 ${height / 2})` }, "amplitude / mA"));
}

// --- moving pictures ---

function canvasOf(canvas) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth || 300, height = canvas.clientHeight || 240;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const ink = getComputedStyle(document.documentElement).getPropertyValue("--ink").trim() || "#000";
  pen.strokeStyle = ink;
  pen.fillStyle = ink;
  pen.font = "13px system-ui, sans-serif";
  pen.lineWidth = 1;
  return { pen, width, height, ink };
}

/** Draw the tip's path in the colours of the contact state, other paths thin, and the tip at one moment. */
function drawPath(canvas, waves, other, at, moved) {
  const { pen, width, height, ink } = canvasOf(canvas);
  const all = other ? [waves, other] : [waves];
  const [x0, x1] = extent(all.flatMap((one) => extent(one.x))), [y0, y1] = extent(all.flatMap((one) => extent(one.y)));
  const margin = 30, above = 80, force = 50; // px; the arrow of the largest force fits above the path
  const scale = Math.min((width - 2 * margin) / Math.max(x1 - x0, 1e-6), (height - margin - above) / Math.max(y1 - y0, 1e-6));
  const px = (x) => width / 2 + (x - (x0 + x1) / 2) * scale, py = (y) => height - margin - (y - y0) * scale;
  if (other) {
    pen.globalAlpha = 0.6;
    pen.setLineDash([4, 4]);
    pen.beginPath();
    other.x.forEach((x, i) => pen.lineTo(px(x), py(other.y[i])));
    pen.stroke();
    pen.setLineDash([]);
    pen.globalAlpha = 1;
  }
  pen.lineWidth = 3;
  for (let i = 1; i < waves.x.length; i += 1) {
    pen.strokeStyle = STATE_COLOURS[clamp(Math.round(waves.state[i]), 0, 2)];
    pen.beginPath();
    pen.moveTo(px(waves.x[i - 1]), py(waves.y[i - 1]));
    pen.lineTo(px(waves.x[i]), py(waves.y[i]));
    pen.stroke();
  }
  const i = clamp(Math.round(at * (waves.x.length - 1)), 0, waves.x.length - 1);
  const cx = px(waves.x[i]), cy = py(waves.y[i]);
  pen.strokeStyle = ink;
  pen.lineWidth = 2;
  const greatest = Math.max(...waves.normal, 1e-9);
  arrow(pen, cx, cy, cx + (force * waves.friction[i]) / greatest, cy - (force * waves.normal[i]) / greatest);
  pen.beginPath();
  pen.arc(cx, cy, 6, 0, TURN);
  pen.fillStyle = STATE_COLOURS[clamp(Math.round(waves.state[i]), 0, 2)];
  pen.fill();
  pen.stroke();
  pen.fillStyle = ink;
  pen.fillText(`x along the ${moved}: ${(x1 - x0).toPrecision(3)} µm from end to end`, 10, height - 8);
  pen.fillText(`y towards the ${moved}: ${(y1 - y0).toPrecision(3)} µm; equal scales`, 10, 18);
}

function arrow(pen, x0, y0, x1, y1) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (length < 3) return;
  const ux = (x1 - x0) / length, uy = (y1 - y0) / length;
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.moveTo(x1 - 7 * ux + 4 * uy, y1 - 7 * uy - 4 * ux);
  pen.lineTo(x1, y1);
  pen.lineTo(x1 - 7 * ux - 4 * uy, y1 - 7 * uy + 4 * ux);
  pen.stroke();
}

/** Draw the outlines of a plate below its contact, bent by modal displacements; its largest motion takes 6 % of the height. */
function drawPlate(pen, motor, displacements, all, room) {
  const largest = (part, n) => Math.max(...part.shapes[n].flat().map(Math.abs));
  const most = motor.modes.reduce((sum, _, n) => sum + Math.max(...all[n].map(Math.abs)) * Math.max(...motor.plate.map((part) => largest(part, n))), 1e-9);
  const [left, right] = extent(motor.plate.flatMap((part) => part.line[0])), [low] = extent(motor.plate.flatMap((part) => part.line[1]));
  const scale = Math.min((0.9 * room.height) / Math.max(-low, 1e-9), (0.9 * room.width) / Math.max(right - left, 1e-9));
  const swell = (0.06 * room.height) / most;
  for (const part of motor.plate) {
    pen.strokeStyle = part.colour;
    pen.lineWidth = 2;
    pen.beginPath();
    let drawn = false;
    part.line[0].forEach((_, k) => {
      if (part.line[0][k] === null) {
        drawn = false;
        return;
      }
      const [dx, dy] = [0, 1].map((axis) => displacements.reduce((sum, value, n) => sum + value * part.shapes[n][axis][k], 0));
      const at = [room.x + scale * part.line[0][k] + swell * dx, room.y + 0.06 * room.height - scale * part.line[1][k] - swell * dy];
      if (drawn) pen.lineTo(...at);
      else pen.moveTo(...at);
      drawn = true;
    });
    pen.stroke();
  }
}

/** Draw beam, tip and rotor or slider, enlarged, at one moment of the period. */
function drawMotor(canvas, motor, waves, at, angle) {
  const { pen, width, height, ink } = canvasOf(canvas);
  const i = clamp(Math.round(at * (waves.x.length - 1)), 0, waves.x.length - 1);
  const radius = Math.min((motor.plate ? 0.22 : 0.3) * height, 0.22 * width), cx = width / 2, cy = motor.plate ? 4 : radius + 8; // of a plate's rotor, half is drawn
  pen.lineWidth = 2;
  pen.beginPath();
  if (motor.linear) {
    const thick = 0.5 * radius, apart = 0.1 * width, first = (((angle * radius) % apart) + apart) % apart;
    pen.rect(-2, cy + radius - thick, width + 4, thick);
    for (let x = first; x < width; x += apart) {
      pen.moveTo(x, cy + radius - thick);
      pen.lineTo(x, cy + radius);
    }
  } else {
    pen.arc(cx, cy, radius, 0, TURN);
    for (let spoke = 0; spoke < 6; spoke += 1) {
      const turn = angle + (spoke * TURN) / 6;
      pen.moveTo(cx, cy);
      pen.lineTo(cx + radius * Math.sin(turn), cy - radius * Math.cos(turn));
    }
  }
  pen.stroke();
  const size = Math.max(...waves.x.map(Math.abs), ...waves.y.map(Math.abs), 1e-9);
  const gain = 0.03 * height / size;
  const tipX = cx + gain * waves.x[i], tipY = cy + radius + 4 + gain * (Math.max(...waves.y) - waves.y[i]);
  const floor = 0.9 * height - 34; // above the caption when the beam bends furthest
  if (motor.beam) {
    const { foot, shapes } = motor.beam;
    const most = Math.max(...motor.modes.map((_, n) => Math.max(...waves.modes[n].map(Math.abs)) * Math.max(...shapes[n].map(Math.abs))), 1e-9);
    const swell = (0.1 * height) / most;
    const across = (share) => 0.1 * width + share * 0.8 * width;
    const bend = (k) => motor.modes.reduce((sum, _, n) => sum + shapes[n][k] * waves.modes[n][i], 0);
    pen.lineWidth = 12;
    pen.strokeStyle = "#808080";
    pen.beginPath();
    shapes[0].forEach((_, k) => pen.lineTo(across(k / (shapes[0].length - 1)), floor - swell * bend(k)));
    pen.stroke();
    pen.lineWidth = 4;
    for (const patch of motor.beam.patches) {
      pen.strokeStyle = patch.group === "A" ? "#0072B2" : "#E69F00";
      for (const side of [-8, 8]) {
        pen.beginPath();
        for (let k = 0; k < shapes[0].length; k += 1) {
          const share = k / (shapes[0].length - 1);
          if (share >= patch.start && share <= patch.end) pen.lineTo(across(share), floor - swell * bend(k) + side);
        }
        pen.stroke();
      }
    }
    const k = Math.round(foot * (shapes[0].length - 1));
    pen.strokeStyle = ink;
    pen.lineWidth = 5;
    pen.beginPath();
    pen.moveTo(across(foot), floor - swell * bend(k));
    pen.lineTo(tipX, tipY);
    pen.stroke();
  } else if (motor.plate) drawPlate(pen, motor, waves.modes.map((mode) => mode[i]), waves.modes, { x: cx, y: cy + radius + 4, height: height - cy - radius - 34, width });
  else {
    pen.lineWidth = 5;
    pen.beginPath();
    pen.moveTo(cx, floor);
    pen.lineTo(tipX, tipY);
    pen.stroke();
  }
  pen.fillStyle = STATE_COLOURS[clamp(Math.round(waves.state[i]), 0, 2)];
  pen.beginPath();
  pen.arc(tipX, tipY, 6, 0, TURN);
  pen.fill();
  pen.fillStyle = ink;
  pen.fillText(`motions enlarged; ${motor.linear ? "slider" : "rotor"} and tip not to one scale`, 10, height - 8);
}
