from .chatter import CutOptions, JudgedCut, doubts_of_cuts, judge_recordings, stated_runout, tone_table, verdict_table
from .chatter_file import KeptCut, read_cuts, write_cuts
from .chatter_spectra import keep_spectra
from .islands import draw_lobes_of, stable_above
from .lobes import CERTIFIED, LOBE_METHODS, compute_lobes, lobes_summary, mode_coupling_line, speed_axis

__all__ = [
    "CERTIFIED",
    "LOBE_METHODS",
    "CutOptions",
    "JudgedCut",
    "KeptCut",
    "compute_lobes",
    "doubts_of_cuts",
    "draw_lobes_of",
    "judge_recordings",
    "keep_spectra",
    "lobes_summary",
    "mode_coupling_line",
    "read_cuts",
    "speed_axis",
    "stable_above",
    "stated_runout",
    "tone_table",
    "verdict_table",
    "write_cuts",
]
