"""What a DAQmx channel was set to, read back, and how it differs from what was asked."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from .ni_input import NiInput

T = TypeVar("T")

_CLOSE = 0.2
"""Share by which an excitation may differ from the nominal one: a module says 2.1 mA where 2 mA are asked."""

COUPLINGS = {"ac": "AC", "dc": "DC"}
TERMINALS = {"rse": "RSE", "nrse": "NRSE", "differential": "DIFF", "pseudodifferential": "PSEUDO_DIFF"}


@dataclass(frozen=True)
class ReadBack:
    """Settings of an input as the driver tells them; None: this module has no such setting.

    Parameters
    ----------
    range_volts : V
        Largest magnitude that the input converts.
    coupling
        ``ac`` or ``dc``.
    terminal_configuration
        ``rse``, ``nrse``, ``differential`` or ``pseudodifferential``.
    iepe_current : A
        Excitation current; 0: none.
    volts_per_unit
        Sensitivity by which the task scales, V per SI unit; None where it gives volts.
    """

    range_volts: float | None
    coupling: str | None
    terminal_configuration: str | None
    iepe_current: float | None
    volts_per_unit: float | None = None


def read_back(created: Any, sensitivity: Callable[[Any], float] | None) -> ReadBack:
    """Ask a created channel for its settings; ask after the timing is set.

    Parameters
    ----------
    created
        The channel as nidaqmx calls it.
    sensitivity
        Function that reads the sensitivity, V per SI unit, from it; None: the task gives volts.
    """
    high, low = _asked(lambda: float(created.ai_rng_high)), _asked(lambda: float(created.ai_rng_low))
    coupling = _asked(lambda: created.ai_coupling.name)
    terminals = _asked(lambda: created.ai_term_cfg.name)
    return ReadBack(
        None if high is None or low is None else min(abs(high), abs(low)),
        next((ours for ours, theirs in COUPLINGS.items() if theirs == coupling), None),
        next((ours for ours, theirs in TERMINALS.items() if theirs == terminals), None),
        _asked(lambda: float(created.ai_excit_val)),
        None if sensitivity is None else _asked(lambda: sensitivity(created)),
    )


def mismatches(wanted: "NiInput", found: ReadBack) -> list[str]:
    """Differences that falsify or endanger the samples, one sentence each."""
    name, said = wanted.channel.name, []
    if found.range_volts is not None and found.range_volts < 0.999 * wanted.range_volts:
        said.append(f"channel {name}: the input takes {found.range_volts:g} V, not {wanted.range_volts:g} V as asked")
    for what, asked, got in (
        ("coupling", wanted.coupling, found.coupling),
        ("terminal configuration", wanted.terminal_configuration, found.terminal_configuration),
    ):
        if asked and got != asked:
            said.append(f"channel {name}: {what} is {got or 'not settable'}, not {asked} as asked")
    current = found.iepe_current or 0.0
    if abs(current - wanted.iepe_current) > _CLOSE * wanted.iepe_current:
        said.append(
            f"channel {name}: excitation is {1e3 * current:g} mA, not {1e3 * wanted.iepe_current:g} mA as asked"
        )
    if wanted.teds and wanted.sensitivity is not None and found.volts_per_unit is not None:
        ratio = found.volts_per_unit / wanted.sensitivity
        if not 0.95 < ratio < 1.05:
            said.append(
                f"channel {name}: the sensor's TEDS says {100 * ratio:.4g} % of the sensitivity in the session; is "
                "another sensor plugged in?"
            )
    return said


def _asked(question: Callable[[], T]) -> T | None:
    """The answer, or None where the module has no such setting."""
    from nidaqmx.errors import DaqError, DaqFunctionNotSupportedError

    with suppress(DaqError, DaqFunctionNotSupportedError):
        return question()
    return None
