# SPDX-License-Identifier: GPL-3.0-or-later
"""Hooks of MkDocs: the pages that follow from the code, and the files beside docs/ that pages link to.

Commands come from the command line itself, the Python names from the package, the netlists from the headers of
``behavioral/``, the gallery from the scripts in ``figures/``; the start page is the README.
"""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from typing import Any

import latex2mathml.converter
import typer
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

import pyspice_runner as pr
from pyspice_runner.cli import app
from pyspice_runner.result import Result
from pyspice_runner.spice.library import Library, library_names, read_library
from pyspice_runner.view.live import live_page

ROOT = Path(__file__).resolve().parents[1]
_OUTSIDE = re.compile(r"\]\(\.\./([^)#]+)(#[^)]*)?\)")
PLAYGROUND = "playground.html"  # the live page, of which other pages show parts
_LIVE = re.compile(r"^<!-- live: (.+) -->$", re.M)
_SHOWN = {"behavioral/CONVENTIONS.md": "CONVENTIONS.md", "behavioral/": "netlists.md", "README.md": "index.md"}


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, the pictures, and the sources that pages link to."""
    pages = {
        "index.md": _readme(),
        "commands.md": commands_page(),
        "api.md": api_page(),
        "netlists.md": netlists_page(),
        "gallery.md": gallery_page(),
        "CONVENTIONS.md": (ROOT / "behavioral" / "CONVENTIONS.md").read_text(encoding="utf-8"),
    }
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    files.append(File.generated(config, PLAYGROUND, content=live_page(pr.load_motor("bimodal40"))))
    for picture in sorted((ROOT / "figures").glob("*.png")):
        files.append(File.generated(config, f"figures/{picture.name}", abs_src_path=str(picture)))
    texts = [file.content_string for file in files if file.is_documentation_page()]
    linked = {match[1] for text in texts for match in _OUTSIDE.finditer(text)}
    for path in sorted(linked):
        if _place(path).startswith("source/") and (ROOT / path).is_file():
            files.append(File.generated(config, _place(path), abs_src_path=str(ROOT / path)))
    return files


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Let links out of docs/ lead to where the site has what they mean; read GitHub's fences of formulas."""
    markdown = _LIVE.sub(lambda match: _live_figure(match[1]), markdown)
    markdown = re.sub(r"^```math\n(.+?)\n```$", r"$$\n\1\n$$", markdown, flags=re.S | re.M)
    return _OUTSIDE.sub(lambda match: f"]({_place(match[1])}{match[2] or ''})", markdown)


def on_page_content(html: str, **_: Any) -> str:
    """Write formulas as MathML, which browsers display without a script, and mark the blocks of commands."""
    html = re.sub(r"<pre>(<span></span><code>(?:piezomotor|ngspice|make) )", r'<pre class="commands">\1', html)
    return re.sub(
        r'<(span|div) class="arithmatex">\\([(\[])(.+?)\\[)\]]</\1>',
        lambda match: _formula(match[3], block=match[2] == "["),
        html,
        flags=re.S,
    )


def _live_figure(words: str) -> str:
    """Return a part of the live page as a figure; ``words`` are those after the # of its address."""
    address = f"{PLAYGROUND}#{words.replace(' ', '+').replace('&', '&amp;')}"
    return (
        f'<iframe class="live" loading="lazy" title="Live model of the motor" src="{address}"></iframe>\n'
        f'<a href="{address.partition("&amp;show=")[0]}">Open it with all settings and views</a>'
    )


def _formula(tex: str, *, block: bool) -> str:
    """Return a formula as MathML; one of its own line can be scrolled."""
    plain = tex.replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">")
    math = latex2mathml.converter.convert(plain, display="block" if block else "inline")
    return f'<div class="formula">{math}</div>' if block else math


def _place(path: str) -> str:
    """Return where the site has a file of the repository."""
    if path in _SHOWN:
        return _SHOWN[path]
    if path.startswith("docs/"):
        return path.removeprefix("docs/")
    if path.startswith("behavioral/") and path.endswith(".lib"):
        return f"netlists.md#{Path(path).stem}"
    return path if path.endswith(".png") else f"source/{path}.txt"


def _readme() -> str:
    """Return the README as the start page, its links as those of a page in docs/."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    return re.sub(r"\]\((?!https?:|#)([^)]+)\)", r"](../\1)", text)


# --- commands ---


def commands_page() -> str:
    """Return the page of all commands, from the command line itself."""
    group: Any = typer.main.get_command(app())
    parts = ["# Commands\n\nMade from the command line itself; `piezomotor COMMAND --help` says the same.\n"]
    context = group.make_context("piezomotor", [], resilient_parsing=True)
    parts += [_command(name, group.get_command(context, name)) for name in group.list_commands(context)]
    return "\n".join(parts)


def _command(name: str, command: Any) -> str:
    text = inspect.cleandoc(command.help or "")
    text = re.sub(r"Example: (piezomotor [^\0]+)$", lambda match: f"    {' '.join(match[1].split())}", text)
    arguments = [item for item in command.params if item.param_type_name == "argument"]
    options = [item for item in command.params if item.param_type_name == "option" and not item.hidden]
    words = " ".join(item.metavar or item.name.upper() for item in arguments)
    rows = [f"| `{item.metavar or item.name.upper()}` | {_cell(item.help)} | |" for item in arguments]
    for item in options:
        spelt = ", ".join([*item.opts, *item.secondary_opts])
        default = getattr(item.default, "value", item.default)
        shown = "" if default in (None, False, (), []) or callable(default) else f"`{default}`"
        rows.append(f"| `{spelt}` | {_cell(item.help)} | {shown} |")
    table = "\n".join(["| option | meaning | default |", "|---|---|---|", *rows])
    return f"## piezomotor {name} {words}\n\n{text}\n\n{table}\n"


def _cell(text: str | None) -> str:
    return (text or "").replace("|", "\\|").replace("<", "&lt;")


# --- Python ---


def api_page() -> str:
    """Return the page of all public names and results, for mkdocstrings to fill in."""
    names = [f"{getattr(pr, name).__module__}.{name}" for name in pr.__all__]
    parts = (
        (
            "# Python\n\nEvery public name of `pyspice_runner`, `import pyspice_runner as pr`; made from the code.",
            names,
        ),
        ("## Results\n\nWhat the functions return. All have the methods of `Result`.", result_names()),
    )
    return "\n\n".join(block for head, names in parts for block in (head, *(f"::: {name}" for name in names))) + "\n"


def result_names() -> list[str]:
    """Return the base of the results, and every kind of result, each with its module."""
    import pyspice_runner.view.plots  # noqa: F401  # imports all results, which registers them as subclasses

    found, open_ends = [Result], [Result]
    while open_ends:
        kinds = open_ends.pop().__subclasses__()
        found += kinds
        open_ends += kinds
    return sorted(f"{kind.__module__}.{kind.__name__}" for kind in found)


# --- netlists ---


def netlists_page() -> str:
    """Return the page of all subcircuits, from their headers."""
    head = (
        "# Netlists\n\nThe subcircuits of `behavioral/`, made from their headers. What nodes and units mean is in "
        "[the conventions](CONVENTIONS.md); the motor that is put together from them is `piezomotor export`.\n"
    )
    return "\n".join([head, *(_library(read_library(name)) for name in library_names())])


def _library(library: Library) -> str:
    pins = [f"| `{pin.name}` | {pin.direction} | {pin.unit} | {_cell(pin.meaning)} |" for pin in library.pins]
    parameters = [
        f"| `{item.name}` | {_cell(item.unit)} | {item.default:g} | {item.least:g} to {item.greatest:g} | "
        f"{_cell(item.meaning)} |"
        for item in library.parameters
    ]
    parts = [
        f"## {library.name}\n\n{_cell(library.title)}\n",
        "| pin | direction | unit | meaning |\n|---|---|---|---|\n" + "\n".join(pins) + "\n",
    ]
    if parameters:
        table = "| parameter | unit | default | range | meaning |\n|---|---|---|---|---|\n"
        parts.append(table + "\n".join(parameters) + "\n")
    for title, text in (("Source", library.source), ("Omits", library.omits), ("Tested with", library.tested_with)):
        if text:
            parts.append(f"**{title}.** {_cell(text)}\n")
    parts.append(f"```spice\n{library.usage.strip()}\n```\n")
    return "\n".join(parts)


# --- gallery ---


def gallery_page() -> str:
    """Return the figures, each with what its script says of it and the script itself."""
    parts = ["# Gallery\n\nEach figure with the script that draws it; `make figures` draws them all anew.\n"]
    for picture in sorted((ROOT / "figures").glob("*.png")):
        script = picture.with_suffix(".py").read_text(encoding="utf-8")
        title, _, more = (ast.get_docstring(ast.parse(script)) or picture.stem).partition("\n")
        parts.append(f"## {title.rstrip('.')}\n\n{more.strip()}\n\n![{title}](figures/{picture.name})\n")
        shown = "\n".join(f"    {line}".rstrip() for line in f"```python\n{script.rstrip()}\n```".splitlines())
        parts.append(f'??? note "figures/{picture.stem}.py"\n\n{shown}\n')
    return "\n".join(parts)
