// SPDX-License-Identifier: GPL-3.0-or-later
// ngspice as WebAssembly in Node.js, for wasm.py: `node engine.js LOADER BINARY`. The binary is compiled once; each run has
// an instance of its own. A line on standard input asks for a run, as JSON: ["FOLDER", ARGUMENTS…], the words of a
// command line of ngspice. With -b, deck.cir is read from FOLDER, out.raw and log are written there during the run, and the
// exit status is answered as a line. With -p, ngspice has standard input and output, until it ends.
"use strict";
const fs = require("node:fs");
const { join } = require("node:path");

const [loader, binary] = process.argv.slice(2);
const createNgspice = new Function(`${fs.readFileSync(loader, "utf8")}\nreturn createNgspice;`)();
const compiled = new WebAssembly.Module(fs.readFileSync(binary));
const CHUNK = 1 << 16; // bytes of standard input, and of out.raw, that are read and written at once
const parent = process.ppid;

const input = Buffer.alloc(CHUNK);
let read = 0, had = 0;

/** Return the next byte of standard input, or null at its end. */
function nextByte() {
  if (read === had) {
    read = had = 0;
    try {
      had = fs.readSync(0, input, 0, CHUNK);
    } catch (error) {
      if (error.code !== "EOF") throw error; // as Windows calls it
    }
  }
  return read < had ? input[read++] : null;
}

/** Return the next line of standard input, or null at its end. */
function nextLine() {
  const bytes = [];
  for (let byte; (byte = nextByte()) !== 10; bytes.push(byte)) if (byte === null) return null;
  return Buffer.from(bytes).toString("utf8");
}

/** End with the process that asked, which may have been killed. */
function endWithParent() {
  try {
    if (process.ppid === parent) return process.kill(parent, 0);
  } catch {}
  process.exit(1);
}

/** Return a function that writes bytes one by one to a file, line by line. */
function writer(file) {
  let bytes = [];
  return (byte) => {
    if (byte !== null) bytes.push(byte);
    if (byte !== null && byte !== 10 && byte !== 13) return;
    fs.writeSync(file, Buffer.from(bytes));
    bytes = [];
    endWithParent();
  };
}

/** Let a file of ngspice be one of this computer, which its 32 bits do not limit. Return the function that closes it. */
function outside(FS, name, path) {
  FS.writeFile(name, "");
  const kept = Buffer.alloc(CHUNK); // a write of ngspice has 1 kB
  let file, start = 0, filled = 0, end = 0;
  const flush = () => {
    for (let done = 0; done < filled; ) done += fs.writeSync(file, kept, done, filled - done, start + done);
    filled = 0;
    endWithParent();
  };
  FS.lookupPath(name).node.stream_ops = {
    write(stream, bytes, offset, length, position) {
      file ??= fs.openSync(path, "w");
      if (filled && (position !== start + filled || filled + length > CHUNK)) flush();
      if (!filled) start = position;
      if (length > CHUNK) fs.writeSync(file, bytes, offset, length, position);
      else kept.set(bytes.subarray(offset, offset + length), filled), (filled += length);
      end = Math.max(end, position + length);
      return length;
    },
    llseek: (stream, offset, whence) => offset + [0, stream.position, end][whence],
    close: flush,
  };
  return () => file !== undefined && (flush(), fs.closeSync(file));
}

/** Run ngspice to its end and return its exit status. */
async function run([folder, ...words]) {
  const batch = words[0] === "-b";
  const log = batch ? fs.openSync(join(folder, "log"), "a") : 1;
  const out = writer(log);
  const ngspice = await createNgspice({
    noInitialRun: true,
    stdout: out,
    stderr: out,
    instantiateWasm: (imports, done) => {
      imports.env.__asyncjs__eesim_sleep_hack = () => 0; // a pause, which a page needs
      done(new WebAssembly.Instance(compiled, imports));
      return {};
    },
  });
  const { FS } = ngspice;
  FS.writeFile("deck.cir", fs.readFileSync(join(folder, "deck.cir")));
  const close = outside(FS, "out.raw", join(folder, "out.raw"));
  const commands = FS.getStream(0);
  commands.stream_ops = {
    ...commands.stream_ops,
    read(_, bytes, offset) { // one byte, since ngspice waits for all that it asks for
      const byte = batch ? null : nextByte();
      if (byte === null) return batch ? 0 : process.exit(0);
      if (byte === 10) out(10); // ends the line of the prompt
      bytes[offset] = byte;
      return 1;
    },
  };
  try {
    return ngspice.callMain(words);
  } catch (error) {
    Buffer.from(`Error: ${error.message ?? error}\n`).forEach(out);
    return 1;
  } finally {
    close();
    if (batch) fs.closeSync(log);
  }
}

(async () => {
  for (let line; (line = nextLine()) !== null; ) fs.writeSync(1, `${await run(JSON.parse(line))}\n`);
})();
