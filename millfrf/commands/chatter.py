"""`millfrf chatter`: was a recorded cut stable?"""

from pathlib import Path
from typing import Annotated

import typer

from millfrf.core.terminal import say, tell

from ..options import Stream, check_output, names


def chatter(
    recordings: Annotated[list[Path], typer.Argument(metavar="REC...", help="Cuts at one constant speed each.")],
    cutting: Annotated[Path, typer.Option("--cutting", metavar="CUT.toml", help="Cutter: teeth, feed and runout.")],
    speed: Annotated[
        float | None, typer.Option("--speed", metavar="RPM", help="Spindle speed; default: what the recording states.")
    ] = None,
    response: Annotated[
        list[str] | None, typer.Option("--response", help="Channel to judge by; default: all that respond.")
    ] = None,
    model: Annotated[
        Path | None, typer.Option("--model", metavar="MODEL.json", help="Structure: its modes tell the frequency.")
    ] = None,
    stream: Stream = None,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="CHATTER.json", help="Verdicts and spectra, for millfrf report.")
    ] = None,
) -> None:
    """Classify cuts as stable, Hopf chatter, period doubling or inconclusive from their vibration.

    The spindle is followed in the recording (its speed within 1 % comes from --speed, from events `spindle_speed_rpm`
    or from the set-up), its orders are taken away, and lines that stand out of the noise are named: chatter, or a
    foreign tone. Where the cutting file gives the feed, a vibration is also judged by what it does to the chip. Where
    it gives a runout, teeth are taken to cut unequal chips: with an even number of teeth, period doubling is then only
    told while it grows, or where the chip changes by more than runout explains. With --out, verdicts, warnings and
    spectra are kept for `millfrf report`.
    """
    from math import nan

    from millfrf.core.progress import bar
    from millfrf.core.provenance import of_chatter
    from millfrf.core.terminal import show
    from millfrf.gate import read_checked_cutting
    from millfrf.report.tables import tone_table, verdict_table
    from millfrf.stability import write_cuts
    from millfrf.steps.answers import cuts_answer
    from millfrf.steps.chatter import CutOptions, doubts_of_cuts, judge_recordings, keep_spectra, stated_runout
    from modal_fit import read_modal_model

    if out is not None:
        check_output(out, (".json",), [*recordings, cutting, *([] if model is None else [model])])
    process, doubts = read_checked_cutting(cutting)
    structure = None if model is None else read_modal_model(model)
    chip = process.thickest_chip or nan
    runout = stated_runout(cutting, process)
    options = CutOptions(process.teeth, speed, runout, chip, names(response), stream, structure, process)
    doubts += doubts_of_cuts(recordings, process, options, bar)
    cuts = judge_recordings(recordings, options, bar)
    for doubt in doubts:
        say(f"warning: {doubt}")
    tell(lambda: cuts_answer(cuts))
    show(verdict_table(cuts))
    if any(cut.verdict.foreign for cut in cuts):
        show(tone_table(cuts))
    for cut in cuts:
        say(f"{cut.name}: {cut.verdict.kind}: {cut.verdict.reason}")
        for doubt in cut.doubts:
            say(f"warning: {doubt}")
    if out is not None:
        told = [*doubts, *(doubt for cut in cuts for doubt in cut.doubts)]
        inputs = [*recordings, cutting, *([] if model is None else [model])]
        asked = {"speed_rpm": speed, "responses": list(options.responses), "stream": stream}
        write_cuts(out, keep_spectra(recordings, cuts, options, bar), of_chatter(inputs, asked, told))
        say(f"wrote {out}")
