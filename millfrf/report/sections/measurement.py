"""The sections on the measurement: files, set-up, channels, settings."""

import tomllib
from collections.abc import Mapping
from typing import Any

from acquisition import Recording
from millfrf.figures import time_figure

from ...chain import LOCAL
from ...gate import level_table, look
from ...progress import Progress
from ...tables import Table
from ...taps import tap_concerns
from ..collection import Collected, SourceFile
from ..section import Picture, Section, picture_of

MOST_OVERVIEWS = 4


def file_section(collected: Collected) -> Section:
    """Every file with its size and the beginning of its SHA-256."""
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
    """Tool, cut and pose as the recordings state them: one column a recording."""
    stated: list[tuple[str, dict[str, str]]] = []
    for file in collected.recordings:
        with Recording(file.path) as recording:
            entries = {"recorded at": recording.recorded_at or "not known", "title": recording.title or "untitled"}
            stated.append((file.path.stem, entries | _flat(recording.setup)))
    if not stated:
        return Section("Set-up")
    keys = list(dict.fromkeys(key for _, entries in stated for key in entries))
    rows = tuple((key, *(entries.get(key, "") for _, entries in stated)) for key in keys)
    return Section("Set-up", tables=(Table("", ("", *(name for name, _ in stated)), rows),))


def _flat(text: str) -> dict[str, str]:
    """TOML tables as ``table.key``; text that is no TOML is shown as it is."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return {"set-up": text}
    found: dict[str, str] = {}
    for name, content in tables.items():
        if isinstance(content, dict):
            found |= {f"{name}: {key.replace('_', ' ')}": _value(value) for key, value in content.items()}
        else:
            found[name] = _value(content)
    return found


def _value(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def channel_section(collected: Collected, progress: Progress) -> tuple[Section, list[str]]:
    """Levels of every channel, an overview in time, and what looks wrong."""
    tables, pictures, concerns = [], [], []
    for number, file in enumerate(collected.recordings):
        with Recording(file.path) as recording:
            if recording.complete is not True:
                concerns.append(f"{file.path.name}: the recording was not closed in order: its end may be missing")
            for stream in recording.streams.values():
                if not stream.n_samples:
                    continue
                seen = look(stream, progress=progress)
                table = level_table(stream, seen.levels)
                tables.append(Table(f"{file.path.name}, {table.title}", table.columns, table.rows))
                looks = [*seen.concerns(stream.sample_rate), *tap_concerns(stream, seen.levels)]
                concerns += [f"{file.path.name}: {text}" for text in looks]
                if number < MOST_OVERVIEWS:
                    pictures.append(_overview(file, stream))
    return Section("Channels and levels", tables=tuple(tables), pictures=tuple(pictures)), concerns


def _overview(file: SourceFile, stream: Any) -> Picture:
    caption = (
        f"{file.path.name}: every channel over the whole recording (left, largest and smallest sample in each of 600 "
        "intervals) and a quarter of a second from its middle (right)."
    )
    return picture_of(time_figure(stream), caption, "Forces and motion over time", kind="png")


def settings_section(collected: Collected) -> Section:
    """How each FRF was estimated."""
    rows = []
    for file, frf in collected.frfs:
        rows.append((file.path.name, *_settings(file.provenance), f"{int(frf.valid.sum())} of {len(frf.frequencies)}"))
    columns = ("FRF", "tests", "segment", "window", "segments (effective)", "resolution", "stacking", "valid lines")
    return Section("Measurement settings", tables=(Table("", columns, tuple(rows)),) if rows else ())


def _settings(made: Mapping[str, Any]) -> tuple[str, ...]:
    """Tests, segment, window, segments, resolution and stacking of an FRF; empty where its file does not say."""
    settings = made.get("settings", {})
    if made.get("step") == "estimate":
        rate = made["sample_rate_hz"]
        if made["options"].get("estimator") == LOCAL:
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
