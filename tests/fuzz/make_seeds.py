#!/usr/bin/python3
"""Makes the seeds of corpus/ from the repository's own scenes, studies and states: make_seeds.py PROGRAM

What fuzzing found and was mended stands there too, as mended-*; this script leaves it alone.
"""
import os
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
STATE = """id,kind,x,y,z,vx,vy,vz,radius
0,content,0,0,1,0,0,-0.5,0.22
1,content,0.1,0,1.5,0,0.25,0,0.21999999999999997
2,wall,0,0,0,0,0,0,0.22
3,plug,0.44,0,0,0,0,0,0.22
"""
SCENE = """[initial]
state = "state.csv"
[output]
every = 0.01
[[phase]]
duration = 0.02
outlet = "open"
"""


def put(target, name, data):
    folder = HERE / "corpus" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed-{name}").write_bytes(data if isinstance(data, bytes) else data.encode())


def make_texts():
    for scene in [*(ROOT / "silo/scenes").glob("*.toml"), *(ROOT / "benchmarks/scenes").glob("*.toml")]:
        text = re.sub(r'state = ".*?"', 'state = "state.csv"', scene.read_text())
        put("scene", scene.name, text)
    put("scene", "options", "#--set phase.0.duration=0.04\n#--set stepping.method=uniform\n" + SCENE)
    put("scene", "small-silo", "[silo]\nballs = 20\nradius = 1.3\nheight = 6.5\nhopper_height = 0.8\noutlet = 1.6\nsurface = \"inner\"\n"
        "[[phase]]\nduration = 0.1\nfirst_impact = true\ncontact = { restitution_ball = 0.5 }\n")
    put("scene", "until", SCENE.replace("duration = 0.02", 'until = "discharged:0.5"\nmax_duration = 0.02\ndashpot = "solve"\nevents = false\n'
                                        "fallback = true\ninterface = \"impulse\"\nlimiter = 1\nlevels = 3") + "[domain]\noutlet_z = 0.1\nlower = [-1, -1, -1]\n")
    for study in (ROOT / "benchmarks").glob("*.toml"):
        text = re.sub(r"start = (\[.*?\]|\".*?\")", 'start = "state.csv"', study.read_text(), flags=re.S)
        put("study", study.name, re.sub(r'scene = ".*?"', 'scene = "scene.toml"', re.sub(r'packing = ".*?"\n', "", text)))
    put("csv", "state", STATE)
    put("csv", "windows", b"\xef\xbb\xbf" + STATE.replace("\n", "\r\n").encode())
    put("csv", "pair", "".join((ROOT / "benchmarks/scenes/pair.csv").read_text().splitlines(True)[:8]))


def make_files(program):
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        (folder / "state.csv").write_text(STATE)
        (folder / "scene.toml").write_text(SCENE)

        def call(*words):
            subprocess.run([program, *words], cwd=folder, check=True, stdout=subprocess.DEVNULL)

        call("import", "state.csv", "--output", "state.h5")
        call("run", "scene.toml", "--out", "run")
        call("export", "state.h5", "--to", "lammps-data", "--output", "data")
        call("export", "run/run.h5", "--to", "lammps-dump", "--all", "--output", "dump")
        put("lammps", "data", (folder / "data").read_bytes())
        put("lammps", "dump", (folder / "dump").read_bytes())
        put("hdf5", "state", (folder / "state.h5").read_bytes())
        put("hdf5", "checkpoint", sorted((folder / "run/checkpoints").glob("*.h5"))[-1].read_bytes())
        put("hdf5", "segment", sorted((folder / "run/segments").glob("0*.h5"))[-1].read_bytes())
        run = (folder / "run/run.h5").read_bytes()
        host = " ".join(os.uname()[k] for k in (1, 0, 2, 4)).replace(f"{os.uname()[1]} ", f"{os.uname()[1]} (", 1) + ")"
        for private in (host, str(folder)):  # as long as before, so that the file stays sound
            run = run.replace(private.encode(), b"x" * len(private))
        put("hdf5", "run", run)
    for kind in range(4):  # of file; then changes: object, kind of change, choices
        put("hdf5_objects", f"{kind}", bytes([kind, 4, 0, 1, 1, 2, 5, 3, 7, 6, 1, 9]))


if __name__ == "__main__":
    make_texts()
    make_files(str(pathlib.Path(sys.argv[1]).resolve()))
