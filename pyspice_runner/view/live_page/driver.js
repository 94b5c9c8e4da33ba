// SPDX-License-Identifier: GPL-3.0-or-later
// A user's own SPICE lines. Only circuit elements and their models reach ngspice: no control language, no file.

const ELEMENT = /^[rlckvideefghbsqmjwtx][\w.]*\s/i;
const CARDS = /^\.(model|param|subckt|ends)(?=\s|$)/i;
const PINS = ["source_a", "source_b", "a", "b", "0"];
const MOST_LINES = 200, MOST_CHARACTERS = 300;
const DRIVER_EXAMPLE = `* a series inductor in each line
La source_a a_in 2m
Ra a_in a 20
Lb source_b b_in 2m
Rb b_in b 20
`;

/** Return the faults of SPICE lines before they come into a deck: {line, message} each, lines counted from 0. */
function driverFaults(text, deck) {
  const faults = [], names = namesOf(deck);
  const lines = text.split("\n");
  if (lines.length > MOST_LINES) faults.push({ line: MOST_LINES, message: `At most ${MOST_LINES} lines are allowed.` });
  let open = 0, joined = "", told = false;
  lines.slice(0, MOST_LINES).forEach((line, number) => {
    const words = line.trim();
    const wrong = (message) => faults.push({ line: number, message });
    if (!words || words.startsWith("*")) return; // comments stay on the page
    if (words.length > MOST_CHARACTERS) wrong(`A line has at most ${MOST_CHARACTERS} characters.`);
    else if (!/^[\x20-\x7e\t]*$/.test(words)) wrong("Only ASCII characters are allowed.");
    else if (/[\\`$;"']/.test(words)) wrong("The characters \\ ` $ ; \" ' are not allowed; use { } for expressions.");
    else if (/\b(file|pwlfile|include|wavefile)\b/i.test(words)) wrong("Files are not available.");
    else if (words.startsWith("+")) {
      if (!joined) wrong("A line that starts with + continues the line before; there is none.");
      else joined += ` ${words.slice(1)}`;
    } else {
      [joined, told] = [words, false];
      if (words.startsWith(".")) {
        if (!CARDS.test(words)) wrong("Only .model, .param, .subckt and .ends are allowed.");
        else if (/^\.subckt/i.test(words)) open += 1;
        else if (/^\.ends/i.test(words)) open -= 1;
        if (open < 0) wrong(".ends has no .subckt.");
      } else if (!ELEMENT.test(`${words} `)) wrong("A line must be a circuit element: R L C K V I D E F G H B S W Q M J T X.");
    }
    const clash = told ? "" : clashOf(joined, names);
    if (clash) wrong(clash);
    told ||= clash !== "";
  });
  if (open > 0) faults.push({ line: lines.length - 1, message: ".subckt needs its .ends." });
  return faults;
}

/** Return the names that a deck has without its driver: parameters; elements, subcircuits and models; nodes. */
function namesOf(deck) {
  const [mark, end] = DATA.marks, parameters = new Set(), parts = new Set(), nodes = new Set();
  let depth = 0;
  for (const line of (deck.slice(0, deck.indexOf(mark)) + deck.slice(deck.indexOf(end))).toLowerCase().split("\n")) {
    const words = line.split(/\s+/);
    if (words[0] === ".param") parameters.add(words[1].split("=")[0]);
    if (words[0] === ".subckt" || words[0] === ".model") parts.add(words[1]);
    if (depth === 0 && /^[a-z]/.test(line)) {
      parts.add(words[0]);
      words.slice(1, /^[vi]/.test(line) ? 3 : 5).forEach((node) => nodes.add(node));
    }
    depth += { ".subckt": 1, ".ends": -1 }[words[0]] ?? 0;
  }
  PINS.forEach((pin) => nodes.delete(pin));
  return { parameters, parts, nodes };
}

/** Return in words which name of a line, joined with those that continue it, belongs to the deck; empty if none. */
function clashOf(joined, { parameters, parts, nodes }) {
  const [first, second = ""] = joined.toLowerCase().split(/\s+/);
  if (first === ".param") {
    if (/\w\s*\([^=]*\)\s*=(?!=)/.test(joined)) return "Functions are not available: a parameter is a name and a value.";
    const assigned = [...joined.toLowerCase().matchAll(/([\w.]+)\s*=(?!=)/g)].map(([, name]) => name);
    const taken = assigned.find((name) => parameters.has(name));
    return taken ? `The parameter ${taken} belongs to the deck; choose another name.` : "";
  }
  const [name] = /^[\w.]*/.exec(first.startsWith(".") ? second : first);
  if (parts.has(name)) return `The name ${name} is taken; choose another.`;
  const words = first.startsWith(".") ? [] : joined.toLowerCase().match(/[\w.]+/g) ?? [];
  const inner = words.find((word) => nodes.has(word) || /(^|\.)xmotor\./.test(word));
  return inner ? `${inner} is inside the motor or the deck: the driver connects ${PINS.join(", ")}.` : "";
}

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
