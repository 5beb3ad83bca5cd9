"""LAMMPS: pair style granular with a linear spring, a dashpot of given strength, and no pull."""

from lammps_input import LammpsLike


class Lammps(LammpsLike):
    name = "LAMMPS"
    program = "lmp"
    # Pairs across ranks are computed once; a tenth faster on one core too.
    head = ("atom_style sphere", "newton on", "comm_modify vel yes")
    move = "nve"  # nothing turns without friction
    dump_format = "format line"

    def law_lines(self, contact):
        def law(k, c):
            return f"hooke {k!r} {c!r} damping velocity limit_damping tangential linear_nohistory 0 0"
        ball, wall = law(contact["k_ball"], contact["c_ball"]), law(contact["k_wall"], contact["c_wall"])
        return ["pair_style granular", f"pair_coeff 1 1 {ball}", f"pair_coeff 1 2*3 {wall}", f"pair_coeff 2*3 2*3 {wall}"]
