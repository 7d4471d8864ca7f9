#!/usr/bin/env python3
"""Checks that the reference names every option of the commands and every key of training files.

Options are the fields with `#[arg(long ...)]` of dempm, surrogate and validation: docs/commands.md has a
row for each in the table of its command, or in that of shared options, which names the command. Keys are the
fields of the structs that training files are read into: docs/training.md has a row for each. Keys of scenes
are checked by a test of `dempm`.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
COMMANDS = ROOT / "docs/commands.md"
TRAINING = ROOT / "docs/training.md"
# Structs of options that several commands take, and these commands.
SHARED = {
    "dempm terminal": ["all"],
    "surrogate prediction": ["`rollout`", "`eval`", "`calibrate-error`"],
}
# Structs of training files and their sections in the reference.
TABLES = {
    "TrainConfig": "# Training files",
    "Data": "## [data]",
    "Schedule": "## [schedule]",
    "Pushforward": "## [pushforward]",
    "Validation": "## [validation]",
    "ModelConfig": "## [model]",
}


def structs(crate):
    """Names and bodies of the structs of a crate."""
    for file in sorted((ROOT / crate / "src").rglob("*.rs")):
        text = file.read_text()
        for match in re.finditer(r"struct (\w+) \{\n(.*?)^\s*\}$", text, re.MULTILINE | re.DOTALL):
            yield match.group(1), match.group(2)


def options(crate):
    """The options of each command, by the name of its struct without `Args`; of the program itself by ""."""
    for name, body in structs(crate):
        fields = re.findall(r"#\[arg\((.*?)\)\]\s*(?:pub(?:\([^)]*\))? )?(\w+):", body, re.DOTALL)
        long = [field.replace("_", "-") for argument, field in fields if re.search(r"\blong\b", argument)]
        if long:
            words = re.sub(r"(?<=[a-z])(?=[A-Z])", "-", re.sub(r"Arg(ument)?s$", "", name))
            yield words.lower(), long


def fields(body):
    return re.findall(r"^    (?:pub(?:\([^)]*\))? )?(\w+): ", body, re.MULTILINE)


def section(text, heading):
    """The text below a heading of the first or second level."""
    after = text[text.index(heading + "\n") + len(heading) :]
    end = re.search(r"^##? ", after, re.MULTILINE)
    return after[: end.start()] if end else after


def main():
    problems = []
    commands = COMMANDS.read_text()
    counted = 0
    programs = ("dempm", "surrogate", "validation")
    found = [(f"{crate} {command}".strip(), long) for crate in programs for command, long in options(crate)]
    for name, long in found:
        table = re.search(rf"^\| `{name}` \| default.*?(?=\n\n|\Z)", commands, re.MULTILINE | re.DOTALL)
        for option in long:
            counted += 1
            own = table and f"`--{option}`" in table.group()
            for of in SHARED.get(name, [f"`{name.split()[-1]}`"]):
                shared = re.search(rf"^\| [^|]*`--{option}` \| [^|]*{of}", commands, re.MULTILINE)
                if not own and not shared:
                    problems.append(f"docs/commands.md: no row for --{option} of {of}")
    training = TRAINING.read_text()
    found = {name: fields(body) for name, body in structs("surrogate") if name in TABLES}
    for name, heading in TABLES.items():
        text = section(training, heading)
        for key in found.get(name, []):
            # Tables have sections of their own.
            if f"## [{key}]" in training:
                continue
            counted += 1
            if f"| `{key}` |" not in text:
                problems.append(f"docs/training.md: no row for `{key}` below {heading!r}")
        if name not in found:
            problems.append(f"{Path(__file__).name}: surrogate has no struct {name}")
    print("\n".join(problems) or f"the reference has all of {counted} options and keys")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
