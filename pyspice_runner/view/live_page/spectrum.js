// SPDX-License-Identifier: GPL-3.0-or-later
// A measured spectrum: a CSV table, or a Touchstone file of one port. It stays in the page.

const LARGEST_FILE = 20e6, MOST_ROWS = 200000;

/** Return {frequency, impedance} of a file, or throw an error that says what is wrong with it. */
function readSpectrum(name, text) {
  const rows = /\.s\dp$/i.test(name) ? touchstone(text) : table(text);
  const good = rows.filter(([f, z]) => Number.isFinite(f) && f > 0 && Number.isFinite(z) && z > 0).slice(0, MOST_ROWS);
  if (good.length < 2) throw new Error("The file has fewer than two points with a frequency and an impedance.");
  good.sort((one, two) => one[0] - two[0]);
  return { frequency: good.map((row) => row[0]), impedance: good.map((row) => row[1]) };
}

function touchstone(text) {
  const words = (/^\s*#(.*)$/m.exec(text)?.[1] ?? "GHz S MA R 50").trim().toLowerCase().split(/\s+/);
  const unit = { hz: 1, khz: 1e3, mhz: 1e6, ghz: 1e9 }[words.find((word) => /hz$/.test(word)) ?? "ghz"];
  const kind = words.find((word) => /^[syz]$/.test(word)) ?? "s";
  const form = words.find((word) => /^(ri|ma|db)$/.test(word)) ?? "ma";
  const reference = Number(words[words.indexOf("r") + 1]) || 50;
  return numbers(text.replace(/^\s*#.*$/m, "").replace(/!.*$/gm, "")).map(([f, one, two, ...more]) => {
    if (more.length > 0) throw new Error("Only Touchstone files of one port can be shown: .s1p.");
    const angle = (two * Math.PI) / 180, size = form === "db" ? 10 ** (one / 20) : one;
    const [re, im] = form === "ri" ? [one, two] : [size * Math.cos(angle), size * Math.sin(angle)];
    const magnitude = Math.hypot(re, im);
    if (kind === "z") return [f * unit, magnitude];
    if (kind === "y") return [f * unit, 1 / magnitude];
    return [f * unit, (reference * Math.hypot(1 + re, im)) / Math.hypot(1 - re, im)];
  });
}

function table(text) {
  const lines = text.split(/\r?\n/);
  const first = lines.findIndex((line) => fields(line).length >= 2 && fields(line).every((word) => word !== "" && !Number.isNaN(Number(word))));
  if (first < 0) throw new Error("The file has no rows of numbers.");
  const head = first > 0 ? fields(lines[first - 1]).map((word) => word.toLowerCase()) : [];
  const width = fields(lines[first]).length;
  const column = (...patterns) => {
    for (const pattern of patterns) {
      const found = head.findIndex((word) => pattern.test(word));
      if (found >= 0) return found;
    }
    return -1;
  };
  const f = Math.max(0, column(/freq/, /^f\b/, /hz/));
  const scale = /ghz/.test(head[f]) ? 1e9 : /mhz/.test(head[f]) ? 1e6 : /khz/.test(head[f]) ? 1e3 : 1;
  const pairs = [
    [column(/^(re|real).*z|^z.*(re|real)|^r\b|resistance|^rs\b/), column(/^(im|imag).*z|^z.*im|^x\b|reactance|^xs\b/), (a, b) => Math.hypot(a, b)],
    [column(/^(re|real).*y|^y.*(re|real)|^g\b|conductance/), column(/^(im|imag).*y|^y.*im|^b\b|susceptance/), (a, b) => 1 / Math.hypot(a, b)],
  ];
  const size = column(/\|z\||impedance|^z\b|abs.*z|mag/), inverse = column(/\|y\||admittance|^y\b/);
  const rows = numbers(lines.slice(first).join("\n"), width);
  for (const [re, im, join] of pairs)
    if (re >= 0 && im >= 0 && re !== im) return rows.map((row) => [row[f] * scale, join(row[re], row[im])]);
  if (size >= 0 && size !== f) return rows.map((row) => [row[f] * scale, row[size]]);
  if (inverse >= 0) return rows.map((row) => [row[f] * scale, 1 / row[inverse]]);
  if (head.length === 0) return rows.map((row) => [row[0], row[1]]);
  throw new Error("The columns are not known. Name them frequency and |Z|, or R and X, or G and B.");
}

const fields = (line) => line.trim().split(/[\s,;]+/).filter((word) => word !== "");
const numbers = (text) =>
  text.split(/\r?\n/).map((line) => fields(line).map(Number)).filter((row) => row.length >= 2 && row.every(Number.isFinite));
