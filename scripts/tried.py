#!/usr/bin/python3
"""The table of docs/long-runs.md: what was tried to break a run, how often, and what came of it.

    tried.record("mutants of forge cases, 1 rank", "5000", "none")        # or: scripts/tried.py WHAT OFTEN FOUND

A row replaces the row of the same name; the others stay.
"""
import datetime
import fcntl
import pathlib
import sys

PAGE = pathlib.Path(__file__).resolve().parent.parent / "docs" / "long-runs.md"
BEGIN, END = "<!-- tried -->\n", "<!-- end of tried -->"
HEAD = "| tried | how often | what came of it | date |\n|---|---|---|---|\n"


def rewrite(text, row):
    """The page's text with the row in its table."""
    before, rest = text.split(BEGIN)
    table, after = rest.split(END)
    rows = [line for line in table.splitlines()[2:] if line.split("|")[1].strip() != row[0]]
    rows.append("| " + " | ".join(row) + " |")
    return before + BEGIN + HEAD + "".join(line + "\n" for line in sorted(rows)) + END + after


def record(what, often, found, page=PAGE):
    row = [str(cell).replace("|", "/").replace("\n", " ") for cell in (what, often, found, datetime.date.today().isoformat())]
    with open(page, "r+") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        text = rewrite(file.read(), row)
        file.seek(0)
        file.write(text)
        file.truncate()


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    record(*sys.argv[1:])
