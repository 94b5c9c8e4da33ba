// SPDX-License-Identifier: GPL-3.0-or-later
// The worker: it runs decks in ngspice, each in a new instance, so that no run leaves anything behind for the next.
"use strict";
let compiled;

const START_FILES = {
  "/spinit": "* no start file\n",
  "/proc/meminfo": "MemTotal: 2097152 kB\nMemFree: 2097152 kB\nMemAvailable: 2097152 kB\n",
};
const USUAL = /^\s*$|can't find the initialization file|\/proc\/%d\/statm|SPARSE|^(Note: (no resource|can't find|No compatibility)|\tor no active|Total |DRAM |Maximum ngspice|Current ngspice|Shared ngspice|Text \(code|Stack =|Library pages|Doing analysis|Operating point sim|\s*now using tran|binary raw|No\. of Data)/;

onmessage = async ({ data }) => {
  if (data.module) {
    compiled = data.module;
    postMessage({ ready: true });
    return;
  }
  const log = [];
  try {
    const ngspice = await createNgspice({
      noInitialRun: true,
      print: (line) => log.push(line),
      printErr: (line) => log.push(line),
      instantiateWasm: (imports, done) => {
        WebAssembly.instantiate(compiled, imports).then(done);
        return {};
      },
    });
    for (const [name, text] of Object.entries(START_FILES)) ngspice.FS.writeFile(name, text);
    ngspice.FS.writeFile("/deck.cir", data.deck);
    tellProgress(ngspice.FS, data);
    const status = ngspice.callMain(["-b", "-r", "/out.raw", "/deck.cir"]);
    const raw = ngspice.FS.analyzePath("/out.raw").exists ? readRaw(ngspice.FS.readFile("/out.raw")) : null;
    const result = { id: data.id, status, log: log.filter((line) => !USUAL.test(line)), ...raw };
    postMessage(result, raw ? Object.values(raw.vectors).map((values) => values.buffer) : []);
  } catch (error) {
    postMessage({ id: data.id, status: 1, log: [...log.filter((line) => !USUAL.test(line)), String(error)] });
  }
};

/** Report the part of a run that is done, by what ngspice has written of the file. */
function tellProgress(FS, { id, bytes }) {
  if (!bytes) return;
  const write = FS.write;
  let written = 0, told = 0;
  FS.write = (stream, ...rest) => {
    const count = write(stream, ...rest);
    if (stream.path === "/out.raw") {
      written += count;
      if (written - told > 0.04 * bytes) {
        told = written;
        postMessage({ id, progress: Math.min(1, written / bytes) });
      }
    }
    return count;
  };
}

/** Return the vectors of a binary raw file; those of an AC analysis have real and imaginary part in turn. */
function readRaw(bytes) {
  const head = new TextDecoder("latin1").decode(bytes.subarray(0, 100000));
  const end = head.indexOf("Binary:\n");
  if (end < 0) return null;
  const lines = head.slice(0, end).split("\n");
  const value = (name) => lines.find((line) => line.startsWith(name))?.slice(name.length + 1).trim() ?? "";
  const count = Number(value("No. Variables"));
  const points = Number(value("No. Points"));
  const complex = value("Flags").includes("complex");
  const first = lines.findIndex((line) => line.startsWith("Variables:")) + 1;
  const names = lines.slice(first, first + count).map((line) => line.trim().split(/\s+/)[1].toLowerCase());
  const width = complex ? 2 : 1;
  const data = new DataView(bytes.buffer, bytes.byteOffset + end + 8);
  const held = Math.floor(data.byteLength / (8 * count * width)), whole = points ? Math.min(points, held) : held; // 0 of a run that failed
  const vectors = {};
  names.forEach((name, column) => {
    const values = new Float64Array(whole * width);
    for (let row = 0; row < whole; row += 1)
      for (let part = 0; part < width; part += 1)
        values[row * width + part] = data.getFloat64(8 * ((row * count + column) * width + part), true);
    vectors[name] = values;
  });
  return { points: whole, complex, vectors };
}
