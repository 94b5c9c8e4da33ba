# SPDX-License-Identifier: GPL-3.0-or-later
"""Faults of a netlist that ngspice ignores: the status is 0, the log has no complaint, and the result is wrong.

Measured with ngspice 39: an unknown name in ``.options``, an unknown parameter on the line of a subcircuit's instance,
and an AC analysis without an AC source, which gives zeros. The netlist is checked for them before ngspice runs.
"""

from __future__ import annotations

import difflib
import re

# Names that ngspice 36 to 44 know: those of its analyses, then those that its front end reads from ``.options``.
_OPTIONS = frozenset(
    re.findall(
        r"\w+",
        """
        absdv abstol accept acct autopartial badmos3 bypass chgtol convabsstep convlimit convstep copynodesets cptime
        cshunt defad defas defl defm defw epsmin gmin gminfactor gminsteps gshunt indverbosity itl1 itl2 itl3 itl4 itl5
        itl6 keepopinfo klu klu_memgrow_factor limpts limtim list lteabstol ltereltol ltetrtol lvlcod lvltim maxevtiter
        maxopalter maxord method minbreak newtrunc node nodedamping nomod noopac noopalter noopiter nopage numdgt
        oldlimit opts pivrel pivtol ramptime reldv reltol rshunt sparse srcsteps temp tnom trtol trytocompact vntol xmu

        adms autostop brief enable_noisy_r interp maxwarns no_auto_gnd noacct noinit noprint noref norefvalue
        num_threads rndseed rseries savecurrents savecurrents_bd savecurrents_bg savecurrents_bs savecurrents_bv
        savecurrents_mos1 scale scalm seed seedinfo sim_method strict_errorhandling units warn wnflag
        """,
    )
)

# what is taken out of a netlist in lower case, in this order, and what stands for it
_READING = (
    (re.compile(r"^[^\S\n]*[*$].*\n?", re.M), ""),  # comments
    (re.compile(r"(?:;|\s\$\s|//).*"), ""),
    (re.compile(r"^[^\S\n]*\.control.*?(?:^[^\S\n]*\.endc.*?$|\Z)", re.M | re.S), ""),
    (re.compile(r"\n\s*\+"), " "),  # the start of a continued line
    (re.compile(r"'[^'\n]*'|\"[^\"\n]*\""), "0"),
)
_INNERMOST = re.compile(r"\{[^{}\n]*(?:\}|$)", re.M)
_EQUALS = re.compile(r"[^\S\n]*=[^\S\n]*")


def silent_fault(deck: str) -> str | None:
    """Return the first fault in a netlist that ngspice would ignore, as one sentence, or ``None``."""
    lines = _statements(deck)
    return _unknown_option(lines) or _unknown_parameter(lines) or _missing_ac_source(lines)


def _statements(deck: str) -> list[str]:
    """Return the commands, instances and sources that ngspice reads, with continuations joined.

    They are in lower case; expressions in braces or quotes are replaced by 0.
    """
    text = deck.lower().partition("\n")[2]
    for pattern, instead in _READING:
        text = pattern.sub(instead, text)
    lines = map(str.strip, text.split("\n"))
    text = "\n".join(line for line in lines if line.startswith((".", "x", "v", "i")))
    while (inner := _INNERMOST.sub("0", text)) != text:
        text = inner
    return _EQUALS.sub("=", text).split("\n") if text else []


def _names(words: list[str]) -> list[str]:
    """Return the names of ``name=value`` among words."""
    return [word.partition("=")[0] for word in words if "=" in word]


def _unknown_option(lines: list[str]) -> str | None:
    for line in lines:
        if not line.startswith(".opt"):
            continue
        keyword, *words = re.split(r"[\s,]+", line)
        if keyword not in (".option", ".options", ".opt"):
            continue
        for word in filter(None, words):
            name = word.partition("=")[0]
            if name not in _OPTIONS:
                close = difflib.get_close_matches(name, _OPTIONS, n=1)
                hint = f"; did you mean {close[0]}?" if close else "."
                return f"ngspice has no option {name} and would ignore it without a message{hint}"
    return None


def _unknown_parameter(lines: list[str]) -> str | None:
    known: dict[str, set[str]] = {}
    for line in lines:
        if line.startswith(".subckt"):
            words = line.split()
            known.setdefault(words[1] if len(words) > 1 else "", {"m"}).update(_names(words))  # m multiplies any one
    for line in lines:
        if not line.startswith("x"):
            continue
        words = line.split()
        subcircuit = next((word for word in reversed(words) if "=" not in word and word != "params:"), "")
        for name in _names(words) if subcircuit in known else ():
            if name not in known[subcircuit]:
                has = ", ".join(sorted(known[subcircuit] - {"m"})) or "none"
                return (
                    f"Subcircuit {subcircuit} has no parameter {name}, and ngspice would ignore it without a message "
                    f"on the line of {words[0]}; it has {has}."
                )
    return None


def _missing_ac_source(lines: list[str]) -> str | None:
    if not any(line.split()[0] == ".ac" for line in lines):
        return None
    if any(line.startswith((".inc", ".lib")) for line in lines):
        return None  # a source may be in there
    if any(line[0] in "vi" and "ac" in re.split(r"[\s=(]+", line) for line in lines):
        return None
    return "The netlist asks for an AC analysis, but no source has an AC value, so that all results would be zero."
