// SPDX-License-Identifier: GPL-3.0-or-later
// A user's own SPICE lines. Only circuit elements and their models reach ngspice: no control language, no file.

const ELEMENT = /^[rlckvideefghbsqmjwtx][\w.]*\s/i;
const CARDS = /^\.(model|param|subckt|ends)\b/i;
const MOST_LINES = 200, MOST_CHARACTERS = 300;

/** Return the faults of SPICE lines: {line, message} each, lines counted from 0. */
function driverFaults(text) {
  const faults = [];
  const lines = text.split("\n");
  if (lines.length > MOST_LINES) faults.push({ line: MOST_LINES, message: `At most ${MOST_LINES} lines are allowed.` });
  let open = 0, before = false;
  lines.slice(0, MOST_LINES).forEach((line, number) => {
    const words = line.trim();
    const wrong = (message) => faults.push({ line: number, message });
    if (!words || words.startsWith("*")) return; // comments stay on the page
    if (words.length > MOST_CHARACTERS) wrong(`A line has at most ${MOST_CHARACTERS} characters.`);
    else if (!/^[\x20-\x7e\t]*$/.test(words)) wrong("Only ASCII characters are allowed.");
    else if (/[\\`$;"']/.test(words)) wrong("The characters \\ ` $ ; \" ' are not allowed; use { } for expressions.");
    else if (/\b(file|pwlfile|include|wavefile)\b/i.test(words)) wrong("Files are not available.");
    else if (words.startsWith("+")) {
      if (!before) wrong("A line that starts with + continues the line before; there is none.");
    } else if (words.startsWith(".")) {
      if (!CARDS.test(words)) wrong("Only .model, .param, .subckt and .ends are allowed.");
      else if (/^\.subckt\b/i.test(words)) open += 1;
      else if (/^\.ends\b/i.test(words)) open -= 1;
      if (open < 0) wrong(".ends has no .subckt.");
      if (/^\.param\b/i.test(words)) {
        const taken = words.match(/\b(\w+)\s*=/g)?.find((name) => RESERVED.has(name.replace(/\s*=$/, "").toLowerCase()));
        if (taken) wrong(`The parameter ${taken.replace(/\s*=$/, "")} belongs to the deck; choose another name.`);
      }
    } else if (!ELEMENT.test(`${words} `)) wrong("A line must be a circuit element: R L C K V I D E F G H B S W Q M J T X.");
    else if (/^(va2?|vb2?|vpin_[ab]|vheld|iload|gheld|xmotor)\s/i.test(words)) wrong("This name is taken; choose another.");
    before = true;
  });
  if (open > 0) faults.push({ line: lines.length - 1, message: ".subckt needs its .ends." });
  return faults;
}

const RESERVED = new Set(
  "voltage frequency phase preload friction torque grip held inertia mount_stiffness voltage_2 frequency_2 phase_2 stop window step radians radians_2 slider carrier speed".split(" "),
);

/** Return a deck with the user's lines between its marks. */
function withDriver(deck, text) {
  const [mark, end] = DATA.marks;
  const lines = text.split("\n").map((line) => line.trim()).filter((line) => line && !line.startsWith("*"));
  const before = deck.slice(0, deck.indexOf(mark) + mark.length);
  return `${before}\n${lines.join("\n")}\n${deck.slice(deck.indexOf(end))}`;
}

/** Return the line of the user's text that a message of ngspice is about, or -1. */
function lineOf(text, log, deck) {
  const lines = text.split("\n");
  const kept = lines.map((line, number) => [line.trim(), number]).filter(([line]) => line && !line.startsWith("*"));
  const words = log.join("\n").toLowerCase().replace(/[^\S\n]+/g, " ");
  const first = deck.slice(0, deck.indexOf(DATA.marks[0])).split("\n").length + 1;
  for (const [, number] of words.matchAll(/\bline (?:no\. |number )?(\d+)/g)) if (kept[number - first]) return kept[number - first][1];
  const whole = kept.find(([line]) => words.includes(line.toLowerCase().replace(/\s+/g, " ")));
  if (whole) return whole[1];
  const node = /check node (\S+)/.exec(words)?.[1];
  return kept.find(([line]) => node && line.toLowerCase().split(/\s+/).slice(1).includes(node))?.[1] ?? -1;
}
