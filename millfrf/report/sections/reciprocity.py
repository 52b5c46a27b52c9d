"""The section on reciprocity: FRFs measured both ways, and left against right vectors."""

from estimation import reciprocity_pairs
from millfrf.figures import reciprocity_figure

from ...gate import shown_pairs
from ...reciprocity_tables import pair_table, vector_table
from ..collection import Collected
from ..section import Section, picture_of

MOST_DRAWN = 6
"""Pairs that are drawn."""


def reciprocity_section(collected: Collected) -> Section:
    """``H_pq`` against ``H_qp`` of each FRF, and left against right vectors of each model; both need shared points."""
    tables, pictures = [], []
    for file, frf in collected.frfs:
        found = collected.model_of(file, frf)
        stored = None if found is None else found[0].provenance.get("band_hz")
        band = (float(stored[0]), float(stored[1])) if stored else None
        table = pair_table(frf, file.path.name, band)
        if table is None:
            continue
        tables.append(table)
        pairs = shown_pairs(reciprocity_pairs(frf, band), MOST_DRAWN)
        caption = (
            f"{file.path.name}: FRFs that were measured both ways, response at p with force at q and the reverse, and "
            "their difference over their root mean square. A structure at rest is reciprocal; a robot that moves need "
            "not be."
        )
        pictures.append(picture_of(reciprocity_figure(pairs, frf.unit), caption, "Reciprocity of FRFs"))
    vectors = [vector_table(model, file.path.name) for file, model in collected.models]
    tables += [table for table in vectors if table is not None]
    return Section("Reciprocity", tables=tuple(tables), pictures=tuple(pictures))
