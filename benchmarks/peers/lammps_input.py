"""What LAMMPS and its descendant LIGGGHTS share: the input script, the run, the log and the dump."""

import re

import numpy as np

from case import GRAVITY
from command import CommandFailed, Result, Settings, run

ROOM = 3.0  # m, above and below: balls that pass the outlet just fall, nobody removes them
AT_ONCE = Settings(step=8e-5, steps=0, skin=0.02)  # for the forces at the start, which depend on none of it


class LammpsLike:
    """A code that reads LAMMPS's scripts. Subclasses give the words in which they differ."""
    name = program = ""
    share = 1.0           # of the steps in a timed run
    head = ()             # lines before the atoms are read
    move = ""             # the fix that integrates
    dump_format = ""      # the keyword of dump_modify; the row's format follows

    def law_lines(self, contact):
        """The contact law of types 1 content, 2 wall, 3 plug."""
        raise NotImplementedError

    def script(self, case, settings, then):
        """The input script; `then` stands behind the set-up. Wall and plug are fixed and do not see each other."""
        lines = ["units si", *self.head, "atom_modify map array", "boundary f f f",
                 "processors * * 1",  # no cut across the height: the silo is fuller below
                 "read_data state.data"]
        if case.outlet_open:
            lines += ["group plug type 3", "delete_atoms group plug compress no"]
        lines += [f"change_box all z delta -{ROOM} {ROOM} units box", f"neighbor {settings.skin!r} bin",
                  "neigh_modify delay 0 every 1 check yes",
                  *(f"neigh_modify exclude type {pair}" for pair in ("2 2", "2 3", "3 3")),
                  *self.law_lines(case.contact), "group balls type 1", f"timestep {settings.step!r}", "thermo 1000000000"]
        return "\n".join([*lines, *then]) + "\n"

    def run(self, case, settings, folder, with_end=False):
        """Steps from the state's data file, state.data in `folder`."""
        then = [f"fix move balls {self.move}", f"fix weight balls gravity {GRAVITY!r} vector 0 0 -1",
                f"run {settings.steps}"]
        log = self.call(self.script(case, settings, then + with_end * self.dump_lines("x y z")), settings.threads, folder)
        return Result(loop_time(log), *(read_dump(folder / "end.dump") if with_end else ()))

    def forces(self, case, folder):
        """Ids of the content and the contact forces on it at the start [N]."""
        self.call(self.script(case, AT_ONCE, self.dump_lines("fx fy fz")), 1, folder)
        return read_dump(folder / "end.dump")

    def dump_lines(self, columns):
        """A dump of the content as it stands, with all digits."""
        return [f"dump end balls custom 1 end.dump id {columns}",
                f'dump_modify end sort id {self.dump_format} "%d %.17g %.17g %.17g"', "run 0"]

    def call(self, script, threads, folder):
        """Runs the script and gives its log."""
        (folder / "in.peer").write_text(script, encoding="utf-8")
        (folder / "end.dump").unlink(missing_ok=True)
        ranks = ["mpirun", "-np", threads] if threads > 1 else []
        run([*ranks, self.program, "-in", "in.peer", "-log", "log.peer", "-screen", "none"], folder, "output.txt")
        return (folder / "log.peer").read_text(encoding="utf-8")


def loop_time(log):
    """Seconds of the first run in a log. Raises CommandFailed where it did not get that far."""
    found = re.search(r"^Loop time of (\S+) on \d+ procs for [1-9]\d* steps", log, re.MULTILINE)
    if not found:
        raise CommandFailed("no `Loop time` in the log; its last lines:\n  " + "\n  ".join(log.splitlines()[-5:]))
    return float(found[1])


def read_dump(path):
    """Ids as grainclock counts them, from 0, and three columns, by id."""
    table = np.loadtxt(path, skiprows=9, ndmin=2)
    order = np.argsort(table[:, 0])
    return table[order, 0].astype(np.int64) - 1, table[order, 1:4]
