"""A start state with its contact law, as all codes get it."""

import tomllib
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np

CONTENT, WALL, PLUG = 0, 1, 2
EXPORT_DENSITY = 1250.0  # kg/m3, what `grainclock export` writes for a state
GRAVITY = 9.81           # m/s2, downwards


@dataclass(frozen=True)
class Case:
    """A state file and the law of its scene. Rows are those of the state; SI units."""
    name: str
    state: Path
    scene: Path
    outlet_open: bool      # the plug is left out
    contact: dict          # k_ball, k_wall [N/m], c_ball, c_wall [N s/m]
    outlet_z: float        # m, balls below it have left
    ids: np.ndarray
    kind: np.ndarray
    position: np.ndarray   # m, n x 3
    velocity: np.ndarray   # m/s, n x 3
    radius: np.ndarray     # m

    def present(self):
        """Rows that take part: all but the plug where the outlet is open."""
        return self.kind != PLUG if self.outlet_open else np.ones(len(self.kind), bool)

    def content(self):
        return self.kind == CONTENT

    def balls(self):
        """How many balls are stepped; wall and plug never move."""
        return int(self.content().sum())

    def mass(self):
        """Of every row [kg]."""
        return EXPORT_DENSITY * 4.0 / 3.0 * np.pi * self.radius**3

    def start_positions(self):
        """Ids and positions [m] of the content."""
        rows = self.content()
        return self.ids[rows], self.position[rows]


def read_case(name, state, scene, outlet_open):
    """Reads a state and the law of its scene. Raises ValueError where a peer could not follow the law."""
    table = tomllib.loads(Path(scene).read_text(encoding="utf-8"))
    contact = table["contact"]
    if contact.get("tension") or contact.get("cohesion"):
        raise ValueError(f"{scene}: tension or cohesion has no counterpart in the peers; take a scene without")
    density = table.get("material", {}).get("density", EXPORT_DENSITY)
    if density != EXPORT_DENSITY:
        raise ValueError(f"{scene}: density {density} kg/m3, but states are exported with {EXPORT_DENSITY}; take that")
    if table.get("gravity", [0.0, 0.0, -GRAVITY]) != [0.0, 0.0, -GRAVITY]:
        raise ValueError(f"{scene}: gravity {table['gravity']}; the peers are given {GRAVITY} m/s2 downwards")
    with h5py.File(state) as file:
        fields = {key: file["state"][key][()] for key in ("id", "kind", "position", "velocity", "radius")}
    return Case(name, Path(state).resolve(), Path(scene).resolve(), outlet_open,
                {key: float(contact[key]) for key in ("k_ball", "k_wall", "c_ball", "c_wall")},
                float(table["domain"]["outlet_z"]), fields["id"], fields["kind"], fields["position"], fields["velocity"],
                fields["radius"])
