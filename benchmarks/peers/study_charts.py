"""benchmarks/charts.py under a name of its own: costs at equal error, pairs and forces in numpy, looks."""

import importlib.util
import sys
from pathlib import Path

_specification = importlib.util.spec_from_file_location("benchmark_charts", Path(__file__).resolve().parents[1] / "charts.py")
_module = sys.modules["benchmark_charts"] = importlib.util.module_from_spec(_specification)
_specification.loader.exec_module(_module)

Frame, contact_forces, cost_at = _module.Frame, _module.contact_forces, _module.cost_at
GRID, INK, MUTED, amount, short = _module.GRID, _module.INK, _module.MUTED, _module.amount, _module.short
