"""The tables: CSV files for programs, text for people."""

import csv

from accuracy import ERRORS
from study_charts import amount, short

OURS, GENERIC = "default", "generic"  # kernels of grainclock
MULTIRATE = "multirate"


def write_csv(path, rows):
    """`rows`: dictionaries with the same keys; unknown numbers stay empty."""
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows({key: "" if cell is None else cell for key, cell in row.items()} for row in rows)


def text_table(title, head, rows):
    """Columns as wide as they need; the first is left-aligned."""
    cells = [head] + [[str(cell) for cell in row] for row in rows]
    widths = [max(len(line[k]) for line in cells) for k in range(len(head))]
    def line(row):
        return "  ".join(cell.ljust(w) if k == 0 else cell.rjust(w) for k, (cell, w) in enumerate(zip(row, widths))).rstrip()
    return "\n".join(["", title, line(cells[0]), "  ".join("-" * w for w in widths), *map(line, cells[1:])])


def agreement_rows(agreements):
    return [{"case": a.case, "one": a.one, "other": a.other, "balls": a.balls, "contacts": a.contacts,
             "largest_difference_N": a.largest, "largest_over_bound": a.of_bound, "largest_free_force_N": a.free,
             "holds": a.holds()} for a in agreements]


def agreement_text(agreements):
    return text_table("Forces at step 0: largest |dF| over the balls, bound 8 eps k (r_i + r_j) summed over a ball's contacts",
                      ["case", "grainclock and", "contacts", "|dF| [N]", "|dF| / bound", "agrees"],
                      [[a.case, a.other, a.contacts, f"{a.largest:.1e}", f"{a.of_bound:.3f}", "yes" if a.holds() else "NO"]
                       for a in agreements])


def ours_over(speeds, one, kernels):
    """grainclock's rate over that of one peer, in the same case on as many cores."""
    mine = [s for s in speeds if (s.case, s.threads, s.kernels) == (one.case, one.threads, kernels)]
    return mine[0].rate() / one.rate() if mine else None


def peers_rows(speeds, costs):
    """The summary: speeds and times to accuracy with grainclock's advantage."""
    rows = [{"measure": "ball-steps per second", "case": s.case, "cores": s.threads, "code": name_of(s), "error": None,
             "value": s.rate(), "lowest": min(s.rates), "highest": max(s.rates), "skin_m": s.skin, "extrapolated": None,
             "grainclock_is_faster": ours_over(speeds, s, OURS), "grainclock_generic_is_faster": ours_over(speeds, s, GENERIC)}
            for s in speeds]
    return rows + [{"measure": "time to accuracy [s]", "case": "flow", "cores": 1, "code": c.label, "error": c.error,
                    "value": c.seconds, "lowest": None, "highest": None, "skin_m": None, "extrapolated": c.extrapolated,
                    "grainclock_is_faster": cost_ratio(costs, c, OURS), "grainclock_generic_is_faster": cost_ratio(costs, c, GENERIC)}
                   for c in costs]


def name_of(speed):
    return f"{speed.code} {speed.kernels}".rstrip()


def cost_ratio(costs, one, kernels):
    """A code's time over that of selective steps, at one error."""
    ours = next(c for c in costs if c.error == one.error and c.label == f"grainclock {MULTIRATE} {kernels}")
    return one.seconds / ours.seconds if one.seconds and ours.seconds and not ours.extrapolated else None


def speed_text(speeds):
    return text_table("Million ball-steps per second (median of runs in turns), and how many times faster grainclock is",
                      ["code", "case", "cores", "skin [mm]", "rate", "default", "generic"],
                      [[name_of(s), s.case, s.threads, "" if s.skin is None else f"{1e3 * s.skin:g}", f"{1e-6 * s.rate():.2f}",
                        times(ours_over(speeds, s, OURS)), times(ours_over(speeds, s, GENERIC))] for s in speeds])


def times(ratio):
    return "" if ratio is None else f"{amount(ratio)}x"


def accuracy_rows(points):
    return [{"code": p.code, "kernels": p.kernels, "method": p.method, "knob": p.knob, "value": p.value, "skin_m": p.skin,
             "error_rms": p.errors.rms, "error_median": p.errors.median, "error_p99": p.errors.p99, "from_lammps": p.from_lammps,
             "seconds": p.time(), "seconds_lowest": min(p.seconds), "seconds_highest": max(p.seconds), "runs": len(p.seconds)}
            for p in points]


def accuracy_text(points, horizon):
    return text_table(f"Error of the positions after {horizon:g} s against the reference, and seconds of stepping on one core",
                      ["code", "setting", "rms", "median", "99 %", "from LAMMPS", "seconds", "runs"],
                      [[p.label(), f"{p.knob} {short(p.value)}", f"{p.errors.rms:.2e}", f"{p.errors.median:.1e}", f"{p.errors.p99:.1e}",
                        "" if p.from_lammps is None else f"{p.from_lammps:.1e}", f"{p.time():.3g}", len(p.seconds)] for p in points])


def cost_text(costs):
    """Seconds that each code needs for an error; * marks what was extrapolated at first order."""
    text = ""
    for error in ERRORS:
        text += text_table(f"Time to a relative error of {short(error)} on one core (* extrapolated at first order), and how many "
                           "times more that is than grainclock multirate's", ["code", "seconds", "default", "generic"],
                           [[c.label, f"{c.seconds:.3g}{'*' * c.extrapolated}", times(cost_ratio(costs, c, OURS)),
                             times(cost_ratio(costs, c, GENERIC))] for c in costs if c.error == error and c.seconds]) + "\n"
    return text.rstrip("\n")
