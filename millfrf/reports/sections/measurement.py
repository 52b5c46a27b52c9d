"""Sections on the measurement: files, set-up, channels, taps, reciprocity."""

import tomllib
from collections.abc import Mapping
from typing import Any

from acquisition import opened
from estimation import reciprocity_pairs
from millfrf.core.terminal import Table
from millfrf.figures import reciprocity_figure, time_figure
from millfrf.gate import check_signals, double_hit_warnings, level_table, shown_pairs

from ..collection import Collected, SourceFile
from ..section import Picture, Section, picture_of
from ..tables import pair_table, vector_table


def file_section(collected: Collected) -> Section:
    """List every file with its size and the beginning of its SHA-256."""
    rows = tuple(
        (file.path.name, file.kind, _size(file.path.stat().st_size), file.sha256[:12]) for file in collected.files
    )
    return Section("Files", tables=(Table("", ("file", "kind", "size", "SHA-256 (first 12)"), rows),))


def _size(n_bytes: int) -> str:
    for unit in ("B", "kB", "MB"):
        if n_bytes < 1000:
            return f"{n_bytes:.3g} {unit}"
        n_bytes = n_bytes // 1000 if n_bytes >= 1e6 else round(n_bytes / 1000)
    return f"{n_bytes:.3g} GB"


def setup_section(collected: Collected) -> Section:
    """List tool, cut and pose as the recordings state them: what all state alike once, the rest by recording."""
    stated: list[tuple[str, dict[str, str]]] = []
    for file in collected.recordings:
        with opened(file.path) as recording:
            entries = {"recorded at": recording.recorded_at or "not known", "title": recording.title or "untitled"}
            stated.append((file.path.stem, entries | _flat(recording.setup)))
    if not stated:
        return Section("Set-up")
    names = tuple(name for name, _ in stated)
    keys = list(dict.fromkeys(key for _, entries in stated for key in entries))
    rows = [(key, *(entries.get(key, "") for _, entries in stated)) for key in keys]
    alike = tuple(row[:2] for row in rows if len(set(row[1:])) == 1)
    differing = tuple(row for row in rows if len(set(row[1:])) > 1)
    tables = [Table("", ("", "all recordings" if len(names) > 1 else names[0]), alike)] if alike else []
    tables += [Table("Set-up that differs", ("", *names), differing)] if differing else []
    return Section("Set-up", tables=tuple(tables))


def _flat(text: str) -> dict[str, str]:
    """Flatten the keys of TOML tables to ``table: key``; return other text unchanged."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {"set-up": text}
    entries: dict[str, str] = {}
    for name, content in tables.items():
        if isinstance(content, dict):
            entries |= {f"{name}: {key.replace('_', ' ')}": _value(value) for key, value in content.items()}
        else:
            entries[name] = _value(content)
    return entries


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def channel_section(collected: Collected) -> tuple[Section, list[str]]:
    """Make tables of channel levels and an overview of the first recording, and return warnings about the signals."""
    tables, pictures, texts = [], [], []
    for number, file in enumerate(collected.recordings):
        with opened(file.path) as recording:
            if recording.complete is not True:
                texts.append(f"{file.path.name}: the recording was not closed in order: its end may be missing")
            for stream in recording.streams.values():
                if not stream.n_samples:
                    continue
                signals = check_signals(stream)
                table = level_table(stream, signals.levels)
                tables.append(Table(f"{file.path.name}, {table.title}", table.columns, table.rows))
                faults = [*signals.warnings(stream.sample_rate), *double_hit_warnings(stream, signals.levels)]
                texts += [f"{file.path.name}: {text}" for text in faults]
                if number == 0:
                    pictures.append(_overview(file, stream))
    return Section("Channels and levels", tables=tuple(tables), pictures=tuple(pictures)), texts


def _overview(file: SourceFile, stream: Any) -> Picture:
    caption = (
        f"{file.path.name}: every channel over the whole recording (left, largest and smallest sample in each of 600 "
        "intervals) and a quarter of a second from its middle (right)."
    )
    return picture_of(time_figure(stream), caption, "Forces and motion over time")


def settings_section(collected: Collected) -> Section:
    """List the settings of each FRF's estimation."""
    rows = []
    for file, frf in collected.frfs:
        rows.append((file.path.name, *_settings(file.provenance), f"{int(frf.valid.sum())} of {len(frf.frequencies)}"))
    columns = ("FRF", "tests", "segment", "window", "segments (effective)", "resolution", "stacking", "valid lines")
    return Section("Measurement settings", tables=(Table("", columns, tuple(rows)),) if rows else ())


def _settings(made: Mapping[str, Any]) -> tuple[str, ...]:
    """Return tests, segment, window, segments, resolution and stacking of an FRF; empty if not stored."""
    settings = made.get("settings", {})
    if made.get("step") == "estimate":
        rate = made["sample_rate_hz"]
        if made["options"].get("estimator") == "local-polynomial":
            return (f"{made['n_tests']}", "whole records", "none (local polynomials)", "", "", "together")
        return (
            f"{made['n_tests']}",
            f"{settings['segment_length'] / rate:.4g} s",
            f"{settings['window']}, {100 * settings['overlap']:.0f} % overlap",
            f"{made['n_segments']} ({made['effective_averages']:.1f})",
            f"{rate / settings['segment_length']:.4g} Hz",
            made["options"]["stack"],
        )
    if made.get("step") == "tap":
        tau, after = settings["time_constant"], settings["force_samples"]
        force = "force whole" if after is None else f"force to {1e3 * after / settings['sample_rate']:.3g} ms"
        used = sum(not tap["left_out"] for tap in made["taps"])
        return (
            f"{len({tap['file'] for tap in made['taps']})}",
            f"{settings['segment_s']:.4g} s",
            f"{force}, {'not windowed' if tau is None else f'exponential, {tau:.4g} s'}",
            f"{used} taps",
            f"{1 / settings['segment_s']:.4g} Hz",
            "by point hit",
        )
    if made.get("step") == "convert":
        names = [source["file"] for source in made["sources"]]
        return (f"imported from {names[0]}" + (f" and {len(names) - 1} more" if len(names) > 1 else ""), *[""] * 5)
    return ("",) * 6


MAX_REJECTED = 60  # rejected taps that are listed


def hammer_section(collected: Collected) -> Section:
    """List used and rejected taps, with reasons, of each FRF of ``millfrf tap``."""
    tables = []
    for file, _ in collected.frfs:
        if file.provenance.get("step") == "tap":
            taps = file.provenance["taps"]
            tables.append(_counts(file.path.name, taps))
            if any(tap["left_out"] for tap in taps):
                tables.append(_left_out(file.path.name, taps))
    return Section("Hammer tests", tables=tuple(tables))


def _counts(name: str, taps: list[dict[str, Any]]) -> Table:
    rows = []
    for recording, point in dict.fromkeys((tap["file"], tap["hit"]) for tap in taps):
        of_it = [tap for tap in taps if (tap["file"], tap["hit"]) == (recording, point)]
        used = [tap for tap in of_it if not tap["left_out"]]
        peaks = [abs(tap["peak_n"]) for tap in used]
        span = f"{min(peaks):.4g} to {max(peaks):.4g}" if peaks else ""
        rows.append((recording, point, str(len(of_it)), str(len(used)), span))
    return Table(f"{name}: taps", ("recording", "hit at", "found", "used", "peaks used (N)"), tuple(rows))


def _left_out(name: str, taps: list[dict[str, Any]]) -> Table:
    rows = [
        (tap["file"], f"{tap['time_s']:.3f}", f"{abs(tap['peak_n']):.4g}", tap["left_out"])
        for tap in taps
        if tap["left_out"]
    ]
    note = f" (the first {MAX_REJECTED} of {len(rows)})" if len(rows) > MAX_REJECTED else ""
    return Table(
        f"{name}: taps left out{note}", ("recording", "time (s)", "peak (N)", "why"), tuple(rows[:MAX_REJECTED])
    )


def reciprocity_section(collected: Collected) -> Section:
    """Compare ``H_pq`` with ``H_qp`` of each FRF, and left with right vectors of each model."""
    tables, pictures = [], []
    for file, frf in collected.frfs:
        fitted = collected.model_of(file, frf)
        stored = None if fitted is None else fitted[0].provenance.get("band_hz")
        band = (float(stored[0]), float(stored[1])) if stored else None
        table = pair_table(frf, file.path.name, band)
        if table is None:
            continue
        tables.append(table)
        pairs = shown_pairs(reciprocity_pairs(frf, band), 6)
        caption = (
            f"{file.path.name}: FRFs that were measured both ways, response at p with force at q and the reverse, and "
            "their difference over their root mean square. A structure at rest is reciprocal; a moving robot may not "
            "be."
        )
        pictures.append(picture_of(reciprocity_figure(pairs, frf.unit), caption, "Reciprocity of FRFs"))
    vectors = [vector_table(model, file.path.name) for file, model in collected.models]
    tables += [table for table in vectors if table is not None]
    return Section("Reciprocity", tables=tuple(tables), pictures=tuple(pictures))
