"""Which mutants need no test (mutants.txt), and the table of all rooms: scripts/mutate.py."""

import re
from pathlib import Path

REASONS = Path(__file__).resolve().parent / "mutants.txt"


def reasons():
    """Patterns, and above them a line with # and their reason: `path: before -> after`, where ... is anything."""
    lines = REASONS.read_text().splitlines() if REASONS.exists() else []
    patterns = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    return [re.compile(".*".join(map(re.escape, p.split("...")))) for p in patterns]


def has_reason(mutant, known):
    text = f"{mutant['path']}: {mutant['before']} -> {mutant['after']}"
    return any(p.fullmatch(text) for p in known)


def table(groups, known):
    """Prints the counts of each room and what is left; the number of those without a test or a reason."""
    kinds, counts, left = ("killed", "not reached", "survived", "reason", "open"), {}, []
    for group in groups:
        for m in group.of["mutants"]:
            result = group.of["results"].get(str(m["number"]), "open").split(":")[0]
            if result in ("survived", "not reached"):
                if has_reason(m, known):
                    result = "reason"
                else:
                    left.append(f"{m['path']}:{m['line']}: {m['number']}, {result}: {m['before']} -> {m['after']}")
            for name in (m["room"], "all"):
                counts.setdefault(name, dict.fromkeys(kinds, 0))[result] += 1
    print("| room | mutants | killed | not reached | survived | with a reason | killed of the rest |")
    print("|---|---|---|---|---|---|---|")
    for name in [n for n in counts if n != "all"] + ["all"]:
        of = counts.get(name, dict.fromkeys(kinds, 0))
        judged = of["killed"] + of["not reached"] + of["survived"]
        share = f"{100 * of['killed'] / judged:.1f} %" if judged else ""
        figures = [sum(of.values()), of["killed"], of["not reached"], of["survived"], of["reason"], share]
        print(f"| {name} | " + " | ".join(map(str, figures)) + " |")
    print("\n".join(["", *left]), flush=True)
    return len(left)
