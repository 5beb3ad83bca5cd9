"""LIGGGHTS: hooke/stiffness. Its dashpot is per reduced mass unless absolute_damping is on, which makes it ours."""

from lammps_input import LammpsLike


class Liggghts(LammpsLike):
    name = "LIGGGHTS"
    program = "liggghts"
    head = ("atom_style granular", "newton off", "communicate single vel yes")
    move = "nve/sphere"
    dump_format = "format"

    def law_lines(self, contact):
        def of_pairs(name, ball, wall):
            values = [ball] + 8 * [wall]
            return f"fix {name} all property/global {name} peratomtypepair 3 " + " ".join(map(repr, values))
        return [of_pairs("kn", contact["k_ball"], contact["k_wall"]), of_pairs("kt", 0.0, 0.0),
                of_pairs("gamman_abs", contact["c_ball"], contact["c_wall"]), of_pairs("gammat_abs", 0.0, 0.0),
                of_pairs("coefficientFriction", 0.0, 0.0),
                "pair_style gran model hooke/stiffness tangential off absolute_damping on tangential_damping off "
                "limitForce on", "pair_coeff * *"]
