"""Runs the book's commands and checks what its pages name.

A block of commands is run where the word `run` follows its language, as in "```sh run". The blocks of a page run in their order in
one temporary folder that holds a copy of geometries/, docs/examples/ and api/python/, with the program first on the PATH. `needs=NAME`
after `run` is a Python module without which the block is not run, which is said. A block "```text" that follows the commands, with no
other block between them, holds lines that they must print, in that order; a line "…" stands for any lines. Numbers in them may differ
by a part of 0.001, or by `tolerance=PART` after `text`, and those with decimals by one in their last digit.

Checked on all pages, run or not: links lead to files and headings that exist, and out of the book to nothing; files of the project that
are named exist; commands and options are those of the program; every page stands in the table of contents. A table after the comment
`<!-- fields of FILE -->` names the fields of a result that the page's commands have written: each must be there.
"""

import argparse
import concurrent.futures
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
COPIED = ["geometries", "docs/examples", "api/python"]
DEFAULT_TOLERANCE = 1e-3
# A guard against programs that hang; pages run beside a compiler.
SLOWEST_BLOCK_S = 900
# Pages at a time: a search for a design and a fit are not busy on all cores all the time.
PAGES_AT_A_TIME = 2
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
PROJECT_FILE = re.compile(r"(?<![\w/.-])((?:geometries|docs|src|tests|examples|api|benches|\.ci)/[\w./*+-]*[\w*])")


class Block:
    """A fenced block: language, words after it, text, line of its fence, heading comments before it."""

    def __init__(self, info, line):
        words = info.split()
        self.language = words[0] if words else ""
        self.words = words[1:]
        self.line = line
        self.lines = []

    def option(self, name):
        return next((w.split("=", 1)[1] for w in self.words if w.startswith(name + "=")), None)


def read_page(path):
    """The blocks of a page, and its text with the blocks' lines emptied."""
    blocks, prose, block = [], [], None
    for number, line in enumerate(path.read_text().splitlines(), 1):
        stripped = line.strip()
        if block is None and stripped.startswith("```"):
            block = Block(stripped[3:].strip(), number)
            prose.append("")
        elif block is not None and stripped == "```":
            blocks.append(block)
            block = None
            prose.append("")
        elif block is not None:
            block.lines.append(line)
            prose.append("")
        else:
            prose.append(line)
    if block is not None:
        raise SystemExit(f"{path}:{block.line}: a block without an end")
    return blocks, prose


def is_line(expected, found, tolerance):
    """Whether a line is the expected one: equal words, numbers within the tolerance."""
    parts = lambda text: (re.sub(r"\s+", " ", NUMBER.sub("#", text)).strip(), NUMBER.findall(text))
    (words, numbers), (found_words, found_numbers) = parts(expected), parts(found)
    if words != found_words:
        return False
    for text, other in zip(numbers, found_numbers):
        a, b = (float(t.replace("−", "-")) for t in (text, other))
        mantissa, _, exponent = text.lower().partition("e")
        decimals = len(mantissa.partition(".")[2])
        last_digit = 10.0 ** (int(exponent or 0) - decimals) if decimals else 0.0
        if not abs(a - b) <= max(tolerance * abs(a), 1.01 * last_digit):
            return False
    return True


def missing_line(expected, output, tolerance):
    """The first expected line that does not come."""
    at = 0
    for line in re.sub(r" \\\n\s*", " ", "\n".join(expected)).split("\n"):
        if not line.strip() or line.strip() == "…":
            continue
        found = next((n for n in range(at, len(output)) if is_line(line, output[n], tolerance)), None)
        if found is None:
            return line
        at = found + 1
    return None


def has_field(value, path):
    """Whether a result has the field: names joined by points, `[]` for the members of a list."""
    for name in path.split("."):
        is_list = name.endswith("[]")
        name = name.removesuffix("[]")
        if not isinstance(value, dict) or name not in value:
            return False
        value = value[name]
        if is_list:
            if not isinstance(value, list) or not value:
                return False
            value = value[0]
    return True


def check_fields(path, prose, folder, errors):
    table, described = None, set()
    for number, line in enumerate([*prose, ""], 1):
        comment = re.match(r"<!-- fields of (\S+) -->", line)
        if comment:
            table = json.loads((folder / comment.group(1)).read_text())
            described = set()
        elif table is not None and line.startswith("| `"):
            for field in re.findall(r"`([^`]+)`", line.split("|")[1]):
                described.add(field.split(".")[0].removesuffix("[]"))
                if not has_field(table, field):
                    errors.append(f"{path}:{number}: the result has no field {field}")
        elif table is not None and described and not line.startswith("|"):
            for field in sorted(set(table) - described):
                errors.append(f"{path}:{number}: the table does not say what `{field}` is")
            table = None


def run_page(path, blocks, prose, program, errors):
    """Runs the marked blocks of a page."""
    with tempfile.TemporaryDirectory() as scratch:
        folder, commands = Path(scratch) / "page", Path(scratch) / "bin"
        commands.mkdir()
        (commands / "lambdak").symlink_to(program)
        # A link to the Python of a virtual environment would lose the environment's modules.
        (commands / "python3").write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
        (commands / "python3").chmod(0o755)
        for name in COPIED:
            shutil.copytree(ROOT / name, folder / name)
        environment = {**os.environ, "PATH": f"{commands}:{os.environ['PATH']}", "PYTHONDONTWRITEBYTECODE": "1"}
        for n, block in enumerate(blocks):
            if block.language != "sh" or "run" not in block.words:
                continue
            needs = block.option("needs")
            if needs and importlib.util.find_spec(needs) is None:
                print(f"{path.name}:{block.line}: NOT RUN, there is no Python module {needs}")
                continue
            start = time.monotonic()
            try:
                done = subprocess.run(
                    ["bash", "-euo", "pipefail", "-c", "\n".join(block.lines)], cwd=folder, env=environment,
                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=SLOWEST_BLOCK_S,
                )
            except subprocess.TimeoutExpired:
                errors.append(f"{path}:{block.line}: not done after {SLOWEST_BLOCK_S} s")
                return
            print(f"{path.name}:{block.line}: {time.monotonic() - start:.1f} s", flush=True)
            if done.returncode:
                errors.append(f"{path}:{block.line}: exit code {done.returncode}\n{done.stdout}")
                return
            after = blocks[n + 1] if n + 1 < len(blocks) else None
            if after is not None and after.language == "text":
                tolerance = float(after.option("tolerance") or DEFAULT_TOLERANCE)
                line = missing_line(after.lines, done.stdout.splitlines(), tolerance)
                if line is not None:
                    errors.append(f"{path}:{after.line}: this line did not come: {line}\nwhat came:\n{done.stdout}")
        check_fields(path, prose, folder, errors)


def slug(heading):
    """The anchor of a heading, as mdBook and GitHub make it."""
    text = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading.strip().lower())
    return re.sub(r"[^\w\- ]", "", text).replace(" ", "-")


def anchors(path):
    _, prose = read_page(path)
    return {slug(line.lstrip("#")) for line in prose if re.match(r"#+ ", line)}


def check_links(path, prose, errors):
    text = "\n".join(re.sub(r"`[^`]*`", lambda m: " " * len(m.group()), line) for line in prose)
    for match in re.finditer(r"\]\(([^)\s]*)\)", text):
        target = match.group(1)
        line = text.count("\n", 0, match.start()) + 1
        if re.match(r"[a-z]+:", target) or (not target and path.name == "SUMMARY.md"):
            continue
        name, _, anchor = target.partition("#")
        file = (path.parent / name).resolve() if name else path
        if not file.exists():
            errors.append(f"{path}:{line}: the link {target} leads to nothing")
        elif path.is_relative_to(DOCS) and not file.is_relative_to(DOCS):
            errors.append(f"{path}:{line}: the link {target} leads out of the book")
        elif anchor and file.suffix == ".md" and anchor not in anchors(file):
            errors.append(f"{path}:{line}: the link {target} leads to no heading")


def check_named_files(path, blocks, prose, errors):
    shell = [(b.line + n + 1, line) for b in blocks if b.language == "sh" for n, line in enumerate(b.lines)]
    quoted = [(n, code) for n, line in enumerate(prose, 1) for code in re.findall(r"`([^`]+)`", line)]
    for number, text in shell + quoted:
        for name in PROJECT_FILE.findall(text):
            made_by_build = name.startswith(("docs/book/",))
            if not made_by_build and not list(ROOT.glob(name)) and not list(ROOT.glob(name + ".*")):
                errors.append(f"{path}:{number}: there is no file {name}")


class Program:
    """What the program's help says of its commands."""

    def __init__(self, path):
        self.path = path
        self.helps = {}

    def help(self, *words):
        if words not in self.helps:
            done = subprocess.run([self.path, *words, "--help"], capture_output=True, text=True)
            self.helps[words] = done.stdout if done.returncode == 0 else None
        return self.helps[words]


# Second words of commands that have two.
SECOND_WORDS = ("material", "model", "recording", "merge")


def check_commands(path, blocks, program, errors):
    for block in blocks:
        if block.language != "sh":
            continue
        text = "\n".join(block.lines).replace("\\\n", " ")
        for n, line in enumerate(text.splitlines()):
            for call in re.findall(r"(?:^\s*|[;|(&]\s*)lambdak ((?!-)[^;|#)>]*)", line):
                words = call.split()
                command = words[:1]
                if command and command[0] in ("export", "sweep") and len(words) > 1 and words[1] in SECOND_WORDS:
                    command = words[:2]
                found = program.help(*command)
                if found is None:
                    errors.append(f"{path}:{block.line + n + 1}: there is no command lambdak {' '.join(command)}")
                    continue
                for option in re.findall(r"(?<![\w-])--[a-z][a-z-]*", call):
                    if option not in found:
                        errors.append(f"{path}:{block.line + n + 1}: lambdak {' '.join(command)} has no option {option}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--program", type=Path, required=True)
    parser.add_argument("--no-run", action="store_true", help="check links, files and options alone")
    parser.add_argument("pages", nargs="*", help="names of the pages that are run; all of them where none is named")
    options = parser.parse_args()
    program = options.program.resolve()
    errors, start = [], time.monotonic()
    pages = [ROOT / "README.md", ROOT / "ARCHITECTURE.md", *sorted(DOCS.glob("*.md"))]
    contents = (DOCS / "SUMMARY.md").read_text()
    helps = Program(program)
    to_run, num_run = [], 0
    for path in pages:
        blocks, prose = read_page(path)
        check_links(path, prose, errors)
        check_named_files(path, blocks, prose, errors)
        check_commands(path, blocks, helps, errors)
        if path.parent == DOCS and path.name != "SUMMARY.md" and f"({path.name})" not in contents:
            errors.append(f"{path}: it does not stand in SUMMARY.md")
        is_wanted = not options.pages or path.name in options.pages
        marked = sum(b.language == "sh" and "run" in b.words for b in blocks)
        if is_wanted and marked and not options.no_run:
            to_run.append((path, blocks, prose))
            num_run += marked
    with concurrent.futures.ThreadPoolExecutor(PAGES_AT_A_TIME) as pool:
        for done in [pool.submit(run_page, *page, program, errors) for page in to_run]:
            done.result()
    for error in errors:
        print(error, file=sys.stderr)
    print(f"book: {len(pages)} pages, {num_run} blocks run in {time.monotonic() - start:.0f} s, {len(errors)} errors")
    sys.exit(1 if errors else 0)


if __name__ == "__main__":
    main()
