"""Writes the generated pages of the book: formats.md from api/openapi.json, commands.md from the program's help.

    python3 docs/generate_reference.py --program target/debug/lambdak           # writes both
    python3 docs/generate_reference.py --program target/debug/lambdak --check   # fails where a page is not what they say

Python's standard library is all it needs.
"""

import argparse
import difflib
import json
import re
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent

# Files that people write: title, schema in api/openapi.json, a shipped example that is shown, a sentence or two.
FILES = [
    ("specimen/1", "SpecimenSchema", "geometries/two-hole-shear.json",
     "A specimen: the block or dumb-bell as drawn, its holes, how it is held and moved, and how far."),
    ("ogden/1", "OgdenSchema", "geometries/materials/ecoflex-0020-two-term.json",
     "A material, Ψ = Σ μᵢ/αᵢ (λ̄₁^αᵢ + λ̄₂^αᵢ + λ̄₃^αᵢ − 3) + κ/2 (ln J)² ([theory](theory.md#the-material)). Every fit leaves one as "
     "`material.json`."),
    (
        "neo_hookean/1",
        "NeoHookeanSchema",
        None,
        "A material with the neo-Hookean law in the place of Ogden's terms ([theory](theory.md#the-material)).",
    ),
    ("mooney_rivlin/1", "MooneyRivlinSchema", None, "A material with Mooney and Rivlin's law."),
    ("yeoh/1", "YeohSchema", None, "A material with Yeoh's law."),
    ("gent/1", "GentSchema", None, "A material with Gent's law."),
    ("arruda_boyce/1", "ArrudaBoyceSchema", None, "A material with Arruda and Boyce's law."),
    ("study/1", "StudySchema", None,
     "A design study. In a file, `base` and each `material` may be the path of a file, from the study's own folder, in place of the "
     "object itself. `geometries/studies/` holds examples; [what a design search maximises](design-search.md) explains the objectives."),
    ("sweep-study/1", "SweepStudySchema", None,
     "A sweep over designs. `base` and each `material` may be paths as in a study. `geometries/sweeps/` holds examples; "
     "[sweeps](sweeps.md) explains what a variable may set."),
]

# Where the files themselves are described.
ANCHORS = {schema: re.sub(r"\W", "", title) for title, schema, _, _ in FILES}

COMMANDS = [
    ["solve"], ["evaluate"], ["scan"], ["import"], ["calibrate"], ["diagnose"], ["next"], ["design"], ["sweep"], ["sweep", "merge"], ["compare"],
    ["uniaxial"], ["curves"], ["export", "material"], ["export", "model"], ["export", "recording"], ["paper-tables"], ["prove-diagnosis"], ["run"], ["serve"],
    ["worker"],
]


def number(value):
    return f"{value:g}" if isinstance(value, float) else str(value)


class Formats:
    """The tables of the schemas."""

    def __init__(self, schemas):
        self.schemas = schemas
        self.is_done = set()
        self.waiting = []

    def resolve(self, schema):
        """A schema without its reference, with the name of what it referred to."""
        if "$ref" in schema:
            name = schema["$ref"].rsplit("/", 1)[1]
            return {**self.schemas[name], **{k: v for k, v in schema.items() if k != "$ref"}}, name
        return schema, None

    def range(self, schema):
        low = schema.get("minimum"), schema.get("exclusiveMinimum")
        high = schema.get("maximum"), schema.get("exclusiveMaximum")
        parts = []
        if low[0] is not None and high[0] is not None:
            return f" from {number(low[0])} to {number(high[0])}"
        parts += [f"at least {number(low[0])}"] if low[0] is not None else []
        parts += [f"above {number(low[1])}"] if low[1] is not None else []
        parts += [f"at most {number(high[0])}"] if high[0] is not None else []
        parts += [f"below {number(high[1])}"] if high[1] is not None else []
        return " " + " and ".join(parts) if parts else ""

    def value(self, schema):
        """What a field may be, in words; structures get a heading of their own."""
        schema, name = self.resolve(schema)
        if "enum" in schema:
            return ", ".join(f"`{v}`" for v in schema["enum"])
        for kind in ("oneOf", "anyOf"):
            if kind in schema:
                forms = [form for form in schema[kind] if form.get("type") != "null"]
                if all("properties" in form for form in forms) and len(forms) > 1:
                    return self.link(name)
                return " or ".join(dict.fromkeys(self.value(form) for form in forms))
        kinds = schema.get("type")
        kinds = [k for k in (kinds if isinstance(kinds, list) else [kinds]) if k != "null"]
        kind = kinds[0] if kinds else None
        if kind == "array":
            low, high = schema.get("minItems"), schema.get("maxItems")
            items = self.value(schema["items"])
            if low is not None and low == high:
                return f"{low} of: {items}"
            words = [f"at least {low}" if low else "", f"at most {high}" if high is not None else ""]
            words = " and ".join(w for w in words if w)
            return f"list{f' ({words})' if words else ''} of: {items}"
        if kind == "object" and "properties" in schema:
            if name is None:
                fields = (f"`{field}`: {self.value(inner)}" for field, inner in schema["properties"].items())
                return f"object with {', '.join(fields)}"
            return self.link(name)
        if kind == "object":
            return "object with a number for each name"
        word = {"number": "number", "integer": "whole number", "string": "text", "boolean": "`true` or `false`"}.get(kind, "anything")
        if kind == "string" and "maxLength" in schema:
            word += f" of at most {schema['maxLength']} characters"
        return word + self.range(schema)

    def link(self, name):
        if name not in self.is_done:
            self.is_done.add(name)
            self.waiting.append(name)
        return f"[{title_of(name)}](#{ANCHORS.get(name) or title_of(name).lower().replace(' ', '-')})"

    def meaning(self, schema):
        """The description, with what each word of a choice means where the schema says it."""
        full, name = self.resolve(schema)
        text = sentence(full.get("description", ""))
        own = sentence(self.schemas[name].get("description", "")) if name else ""
        # A choice may say more of itself than the field that uses it.
        words = set(text.lower().rstrip(".").split())
        says_the_same = len(words & set(re.split(r"[\s.:,;]+", own.lower()))) >= 0.6 * len(words)
        return own if self.is_choice(full) and says_the_same and len(own) > len(text) else text

    def is_choice(self, schema):
        return "enum" in schema or any("enum" in form for form in schema.get("oneOf", []))

    def table(self, schema):
        lines = ["| field | value | default | meaning |", "|---|---|---|---|"]
        required = schema.get("required", [])
        properties = schema["properties"]
        for name in sorted(properties, key=lambda n: (n != "schema", n != "name", n not in required)):
            field = properties[name]
            default = "required" if name in required else ""
            if "default" in field and name not in required:
                default = f"`{json.dumps(field['default'], ensure_ascii=False)}`"
            lines.append(f"| `{name}` | {self.value(field)} | {default} | {self.meaning(field)} |")
        return lines

    def section(self, schema):
        if "properties" in schema:
            return self.table(schema)
        lines = []
        for form in schema.get("oneOf", []):
            kind = form.get("properties", {}).get("kind", {}).get("enum", [None])[0]
            lines += [f"With `\"kind\": \"{kind}\"`: {sentence(form.get('description', ''))}", "", *self.table(form), ""]
        return lines[:-1]

    def page(self):
        out = [
            "# Files that you write",
            "",
            "Lengths are in mm, forces in N, moduli in kPa; the ending of a field's name says its unit. The frame has its origin at the centre",
            "of the undeformed block: x along its length (the direction of the pull), y along its thickness, z along its width. In a",
            "`double_lap_shear` test the faces y = ±thickness/2 are bonded to plates; the one at −y is fixed, the one at +y moves by the drive",
            "along x, or at `drive_angle_deg` from x towards z. In a `uniaxial` test the faces x = ±length/2 are held; the one at −x is fixed, the one at +x moves by the drive along x.",
            "Before that it goes by `precompression_mm` towards −y, and keeps this displacement.",
            "The faces of a wedge (`wedge_mm` of its block) lie at y = ±(thickness + wedge · x/length)/2.",
            "A negative drive goes the other way: it shears towards −x, or pushes the bar together.",
            "",
            "Unknown fields are errors. A missing field that is not required has its default. All that is wrong is said at once, each with",
            "its place in the file.",
            "",
            "This page is written by `docs/generate_reference.py` from `api/openapi.json`, which is the program's own description of what it",
            "takes. Recordings have [a page of their own](recordings.md), requests for `lambdak run` and the service have [theirs](requests.md).",
        ]
        for title, name, example, text in FILES:
            out += ["", f"## {title}", "", *wrapped(text)]
            if example:
                out += ["", f"`{example}`:", "", "```json", *(ROOT / example).read_text().rstrip("\n").split("\n"), "```"]
            self.is_done.add(name)
            out += ["", *self.section(self.schemas[name])]
            while self.waiting:
                name = self.waiting.pop(0)
                schema = self.schemas[name]
                out += ["", f"### {title_of(name)}", "", *wrapped(sentence(schema.get("description", ""))), "", *self.section(schema)]
        return "\n".join(out) + "\n"


def title_of(name):
    """`ManufacturingLimits` as `Manufacturing limits`."""
    words = re.sub(r"(?<!^)(?=[A-Z])", " ", name.removesuffix("Schema"))
    return words[:1] + words[1:].lower()


def sentence(text):
    """A description for a page: without examples of code and links of the sources."""
    text = re.sub(r"```.*?```", "", text, flags=re.S)
    text = re.sub(r"\[(`[^`]*`)\](\([^)]*\))?", r"\1", text)
    text = re.sub(r"[;,] (see|counted as) `\w+::\w+`( does)?", "", text)
    return " ".join(text.split()).replace("|", "\\|")


def wrapped(text, width=138):
    lines = [""]
    for word in text.split():
        if len(lines[-1]) + len(word) + 1 > width:
            lines.append("")
        lines[-1] = f"{lines[-1]} {word}".strip()
    return lines


# Where a command is explained.
EXPLAINED = {
    "solve": "tutorial-specimen.md#forces-and-fields", "evaluate": "tutorial-specimen.md#what-a-scan-would-tell", "scan": "tutorial-scan.md",
    "import": "tutorial-import.md", "calibrate": "calibration.md", "diagnose": "diagnosis.md", "next": "next-scan.md", "design": "tutorial-design.md",
    "sweep": "sweeps.md", "sweep merge": "sweeps.md#shards-without-a-clusters-scheduler", "compare": "sweeps.md#comparison",
    "uniaxial": "tutorial-curves.md#one-curve", "curves": "tutorial-curves.md#several-tests-together-one-kept-back",
    "export material": "export.md", "export model": "export.md#models", "export recording": "export.md#results", "paper-tables": "paper-comparison.md#tables-1-to-3-and-figure-8",
    "prove-diagnosis": "diagnosis-proof.md", "run": "requests.md", "serve": "service.md", "worker": "service.md#workers",
}


def help_lines(line, width=140):
    """A line of help, broken where it is too long; what follows stands below the description."""
    if len(line) <= width:
        return [line]
    start = re.match(r"\s*\S.*?\s{2,}(?=\S)|\s*", line).end()
    first, *rest = wrapped(line[start:], width - start)
    return [line[:start] + first, *(" " * start + text for text in rest)]


def commands_page(program):
    def help_of(*words):
        done = subprocess.run([program, *words, "--help"], capture_output=True, text=True, check=True, env={"COLUMNS": "140"})
        return [part for line in done.stdout.rstrip("\n").split("\n") for part in help_lines(line.rstrip())]

    overview = help_of()
    exit_codes = next(line for line in overview if line.startswith("Exit codes:"))
    out = [
        "# Commands",
        "",
        "`lambdak COMMAND --help` prints what stands here; `docs/generate_reference.py` writes this page from it.",
        "",
        "What holds for all commands:",
        "",
        "* Results go to standard output, progress to standard error, files to `results/NAME/COMMAND` or the folder after `--out`. A command",
        "  ends by saying where its files are. A folder that holds another command's results is not written to.",
        "* `--json` prints the result for machines ([their fields](results.md)); files are then written only where `--out` says so.",
        "* `--material FILE` takes another material than Ecoflex 00-20, `--mesh search|standard|fine|FACTOR` another element size.",
        "* Options are checked before any work starts, and all that is wrong is said at once.",
        "* Ctrl-C stops a command; `design`, `sweep` and `prove-diagnosis` keep what they have, and the same command goes on.",
        f"* {exit_codes}",
        "",
        "| Command | What it does | More |",
        "|---|---|---|",
    ]
    texts = {" ".join(words): help_of(*words) for words in COMMANDS}
    for name, text in texts.items():
        anchor = "lambdak-" + name.replace(" ", "-")
        out.append(f"| [`lambdak {name}`](#{anchor}) | {text[0].rstrip('.')} | [explained]({EXPLAINED[name]}) |")
    for words in COMMANDS:
        text = texts[" ".join(words)]
        out += ["", f"## lambdak {' '.join(words)}", "", "```text", *text, "```"]
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--program", type=Path, required=True, help="the program whose help is read")
    parser.add_argument("--check", action="store_true", help="compare and write nothing")
    options = parser.parse_args()
    schemas = json.loads((ROOT / "api/openapi.json").read_text())["components"]["schemas"]
    pages = {"formats.md": Formats(schemas).page(), "commands.md": commands_page(options.program.resolve())}
    is_same = True
    for name, text in pages.items():
        path = DOCS / name
        kept = path.read_text() if path.exists() else ""
        if kept == text:
            continue
        if options.check:
            is_same = False
            sys.stderr.writelines(list(difflib.unified_diff(kept.splitlines(True), text.splitlines(True), f"docs/{name}", "as it should be"))[:40])
        else:
            path.write_text(text)
            print(f"docs/{name} written")
    if not is_same:
        sys.exit("docs/generate_reference.py --program PROGRAM writes these pages anew")


if __name__ == "__main__":
    main()
