# SPDX-License-Identifier: GPL-3.0-or-later
"""Texts, numbers and values that are known to break programs, or that some program takes for a command."""

from __future__ import annotations

MARKER = "marker"  # a file that no attempt may create
_COMMAND = f"shell touch {MARKER}"

# Texts that an attacker gives where a name or a value is expected, to run, read or write something.
ATTEMPTS: dict[str, str] = {
    "a line of its own": f"x\n{_COMMAND}",
    "a control section": f"x\n.control\n{_COMMAND}\n.endc\n*",
    "carriage returns": f"x\r\n.control\r\n{_COMMAND}\r\n.endc",
    "other line ends": f"x\x0b.control\x85{_COMMAND}\u2028.endc\u2029",
    "a continued line": f"x\n+ {_COMMAND}",
    "an include": "x\n.include /etc/passwd\n",
    "a library": 'x\n.lib "/etc/passwd" all\n',
    "ngspice's back quotes": f"`{_COMMAND}`",
    "a shell's dollar": f"$(touch {MARKER})",
    "a shell's semicolon": f"; touch {MARKER} #",
    "a shell's pipe": f"|touch {MARKER}",
    "a folder above": f"../../{MARKER}",
    "a device": "/dev/stdin",
    "double quotes": f'"\n{_COMMAND}\n"',
    "single quotes": f"' {_COMMAND} '",
    "braces": "{1+1} {{7*7}} ${HOME} {0.__class__}",
    "comment signs": f"* ; $ // # ! {_COMMAND}",
    "a script element": "</script><script>alert(1)</script>",
    "a handler": '"><img src=x onerror=alert(1)>',
    "rich markup": "[/red][link=file:///etc/passwd]x[/]:bomb:",
    "mathematical text": r"$\frac{1}{$ $\input{/etc/passwd}$",
    "printf": "%s%n%x%999999d",
    "a zero byte": f"x\0{_COMMAND}",
    "a terminal's escapes": "\x1b]0;x\x07\x1b[2J\x9b31m",
    "text that runs backwards": "x\u202egnp.exe\u2066",
    "Greek for Latin": "\u03b1ndersen2002",
    "Cyrillic for Latin": "\u0430nd\u0435rs\u0435n2002",
    "full width": "\uff0e\uff0e\uff0f\uff0econtrol",
    "a Turkish i": "fr\u0130ct\u0131on",
    "half a pair": "\udcff\ud800",
    "a megabyte": "a" * 2**20,
    "very many lines": "a\n" * 2**15,
    "very many brackets": "[" * 2**16,
    "not a number": "nan",
    "nothing": "",
    "a blank": " ",
}

NUMBERS = (
    "nan", "-nan", "inf", "-inf", "Infinity", "1e400", "-1e400", "1e-400", "-0", "-0.0", "0", "1e308", "-1e308",
    "5e-324", "0x1F", "0b1", "1_000", "1,5", "1.2.3", "1e", "e5", "--1", "+-1", "5%", "true", "None", "1e3000000",
    ".", "-", "1j", "2147483648", "9223372036854775808", "18446744073709551616", "1e9", "-1", "0.5", "1", "2",
    "9" * 400, "9" * 5000, "0x" + "f" * 5000, "1" + "0" * 999_999, " 5 ", "5 V",
    "\u0665", "\uff15", "\u00b2", "\u2155", "\u22121", "1\u00a0000",  # look like digits
)  # fmt: skip

EDGES = ("0", "-1", "0.5", "1e9", "nan", "inf")  # the values that programs forget most often

VALUES: tuple[object, ...] = (
    *(float("nan"), float("inf"), float("-inf"), -0.0, 0.0, 1e308, -1e308, 5e-324, 1e18, -1.0),
    *(0, 1, -1, 2, 3, 10**6, 2**63, 10**400, 10**5000, True, False, None),
    *("", "nan", "1", "free", "brush", b"1", [], [1.0], [float("nan")], {}, {"a": 1}, (1.0, 2.0), 1j),
    *ATTEMPTS.values(),
)
