"""Runs another program and keeps what it says; and what a run of a code is made of and gives."""

import os
import subprocess
from dataclasses import dataclass, field

import numpy as np

# One thread where a code is not told otherwise; Open MPI refuses to run as root, as in containers, without these two.
ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}


class CommandFailed(Exception):
    """A program ended with an error; the text has its last words."""


def run(arguments, folder, log):
    """Runs in `folder`, keeps output in `log` there, and returns it. Raises CommandFailed."""
    arguments = [str(one) for one in arguments]
    done = subprocess.run(arguments, cwd=folder, env={**os.environ, **ENVIRONMENT}, text=True,
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    (folder / log).write_text(done.stdout, encoding="utf-8")
    if done.returncode != 0:
        tail = "\n  ".join(done.stdout.splitlines()[-8:])
        raise CommandFailed(f"`{' '.join(arguments)}` in {folder} ended with {done.returncode}:\n  {tail}")
    return done.stdout


@dataclass(frozen=True)
class Settings:
    """How a peer runs."""
    step: float            # s
    steps: int
    skin: float            # m, of its neighbour lists
    threads: int = 1


@dataclass
class Result:
    """What a run gives: the clock of its stepping alone, and the content's end where it was asked for."""
    seconds: float
    ids: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    position: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))  # m
