"""Do all codes mean the same law? The forces on every ball at the start, before any step."""

from dataclasses import dataclass

import numpy as np

from study_charts import Frame, contact_forces

EPSILON = 2.0**-52


@dataclass(frozen=True)
class Agreement:
    """Largest difference of two codes' forces over the balls, and over what rounding allows (1: at the bound)."""
    case: str
    one: str
    other: str
    balls: int
    contacts: int
    largest: float       # N
    of_bound: float      # largest |dF| / bound over the balls that touch something
    free: float          # N, largest force on balls that touch nothing
    def holds(self):
        return self.of_bound <= 1.0 and self.free == 0.0


def witness(case):
    """Forces on the content by the law written in numpy, and each ball's bound 8 eps sum of k (r_i + r_j) over its contacts.

    The bound: an overlap is a difference of lengths of about r_i + r_j with a few roundings of eps each, and k carries it
    into the force; damping and summing add less.
    """
    rows = case.present()
    frame = Frame(case.position[rows], case.velocity[rows], case.radius[rows], case.kind[rows])
    i, j, force = contact_forces(frame, case.contact)
    line = frame.position[i] - frame.position[j]
    push = force[:, None] * line / np.linalg.norm(line, axis=1)[:, None]
    k = np.where((frame.kind[i] > 0) | (frame.kind[j] > 0), case.contact["k_wall"], case.contact["k_ball"])
    allowed = 8.0 * EPSILON * k * (frame.radius[i] + frame.radius[j])
    total, bound = np.zeros_like(frame.position), np.zeros(len(frame.radius))
    np.add.at(total, i, push)
    np.add.at(total, j, -push)
    np.add.at(bound, i, allowed)
    np.add.at(bound, j, allowed)
    content = frame.kind == 0
    return (case.ids[rows][content], total[content]), bound[content], len(i)


def compared(case, one, other, bound, contacts):
    """`one`, `other`: (name, (ids, forces)), in any order of balls; `bound` is in the order of the case's content."""
    wanted = case.ids[case.content()]
    apart = np.linalg.norm(in_order(one, wanted) - in_order(other, wanted), axis=1)
    touching = bound > 0.0
    free = max(float(np.abs(in_order(side, wanted)[~touching]).max(initial=0.0)) for side in (one, other))
    return Agreement(case.name, one[0], other[0], len(wanted), contacts, float(apart.max()),
                     float((apart[touching] / bound[touching]).max(initial=0.0)), free)


def in_order(side, wanted):
    """Forces for the wanted ids. Raises ValueError where a code lost a ball."""
    name, (ids, force) = side
    order = np.argsort(ids)
    place = np.clip(np.searchsorted(ids, wanted, sorter=order), 0, len(ids) - 1)
    if not np.array_equal(ids[order][place], wanted):
        raise ValueError(f"{name}: forces of {len(ids)} balls, but not of all {len(wanted)} that were asked for")
    return force[order][place]


def agreements(case, program, peers, folder_of):
    """grainclock against every peer and against the law written in numpy."""
    numpy_forces, bound, contacts = witness(case)
    ours = ("grainclock", program.forces(case, folder_of("grainclock")))
    others = [("numpy", numpy_forces)] + [(peer.name, peer.forces(case, folder_of(peer.name))) for peer in peers]
    return [compared(case, ours, other, bound, contacts) for other in others]
