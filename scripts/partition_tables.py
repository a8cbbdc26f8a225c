"""The tables of docs/partitioner.md, from the rows that scripts/bench-partition stores."""
import json
import re


def row_file(store, row):
    words = [row["mesh"], row["section"], row["scenario"], str(row["parts"]), row["who"]]
    return store / "rows" / (re.sub(r"[^a-z0-9]+", "-", "_".join(words).lower()) + ".json")


def read_rows(store):
    return [json.loads(path.read_text()) for path in sorted((store / "rows").glob("*.json"))]


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(map(str, row)) + " |" for row in rows])


def find(rows, **wanted):
    """The row with these values, None where it was not measured."""
    return next((row for row in rows if all(row[key] == value for key, value in wanted.items())), None)


def cells(rows, key, who, form, **wanted):
    found = [find(rows, who=name, **wanted) for name in who]
    return [form.format(row[key]) if row else "" for row in found]


def scenes(rows, section):
    """(mesh, scenario, parts) of a section, in order."""
    found = {(row["mesh"], row["scenario"], row["parts"]) for row in rows if row["section"] == section}
    return sorted(found, key=lambda scene: (ORDER.get(scene[0], 9), scene[0], scene[1], scene[2]))


ORDER = {"rod": 0, "cube": 1, "crank-arm": 2, "housing": 3}
FIRST = ("METIS", "Scotch", "PT-Scotch", "Zoltan PHG", "Zoltan RIB", "ours")


def first_table(rows):
    head = ["mesh, parts", *(f"F: {who}" for who in FIRST), *(f"cut: {who}" for who in FIRST),
            "neighbours: METIS, ours", "s: METIS, Scotch, PT-Scotch, Zoltan RIB, ours", "elements alone: F of METIS"]
    body = []
    for mesh, scenario, parts in scenes(rows, "first"):
        at = {"mesh": mesh, "section": "first", "scenario": scenario, "parts": parts}
        body.append([f"{mesh}, {parts}", *cells(rows, "cost", FIRST, "{:.4f}", **at), *cells(rows, "cut", FIRST, "{:d}", **at),
                     ", ".join(cells(rows, "max_neighbours", ("METIS", "ours"), "{:d}", **at)),
                     ", ".join(cells(rows, "seconds", ("METIS", "Scotch", "PT-Scotch", "Zoltan RIB", "ours"), "{:.2f}", **at)),
                     *cells(rows, "cost", ("METIS, elements",), "{:.3f}", **at)])
    return table(head, body)


def compared_table(rows, section, who, columns):
    """Rows of a section: for each of the columns the figures of each of those who are compared."""
    head = ["mesh, parts", "scenario", *(f"{title}: {name}" for _, title, _ in columns for name in who)]
    body = []
    for mesh, scenario, parts in scenes(rows, section):
        at = {"mesh": mesh, "section": section, "scenario": scenario, "parts": parts}
        body.append([f"{mesh}, {parts}", scenario, *(cell for key, _, form in columns for cell in cells(rows, key, who, form, **at))])
    return table(head, body)


def release_table(rows):
    body = []
    for mesh, scenario, parts in scenes(rows, "release"):
        row = find(rows, mesh=mesh, section="release", scenario=scenario, parts=parts)
        body.append([f"{mesh}, {parts}", scenario, f"{100 * row['free']:.1f}", f"{100 * row['moved']:.1f}", f"{100 * row['imbalance']:.1f}"])
    return table(["mesh, parts", "aim", "inside %", "moved %", "uneven %"], body)


TABLES = {
    "first": first_table,
    "unequal": lambda rows: compared_table(rows, "unequal", ("METIS", "Scotch", "PT-Scotch", "ours"), [("cost", "F", "{:.4f}")]),
    "repair": lambda rows: compared_table(rows, "repair", ("METIS", "Scotch", "Zoltan PHG", "ours"),
                                          [("cost", "F", "{:.4f}"), ("cut", "cut", "{:d}"), ("moved", "moved", "{:.3f}")]),
    "release": release_table,
}


def all_tables(rows):
    return "\n\n".join(f"{name}\n\n{make(rows)}" for name, make in TABLES.items() if scenes(rows, name))


def replace(text, name, content):
    """The page with other content between the two marks of that name."""
    begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
    before, rest = text.split(begin, 1)
    return f"{before}{begin}\n{content}\n{end}{rest.split(end, 1)[1]}"


def migration_table(store):
    rows = json.loads((store / "migration.json").read_text())
    return table(["moved", "ranks", "tetrahedra", "s", "s per million held by a rank", "processor s per million held", "bytes per element moved"],
                 [(row["moved"], row["ranks"], f"{row['elements']:,}", f"{row['seconds']:.2f}", f"{row['seconds_per_million_held']:.2f}",
                   f"{row['processor_seconds_per_million_held']:.2f}",
                   f"{row['bytes_per_element']:.0f}") for row in rows])


def write_page(page, rows, store):
    """Puts those tables for which something was measured between their marks in a page."""
    text = page.read_text()
    if (store / "migration.json").exists():
        text = replace(text, "migration", migration_table(store))
    for name, make in TABLES.items():
        if scenes(rows, name):
            text = replace(text, name, make(rows))
    page.write_text(text)
