"""The clocks and the trigger of a DAQmx task: what is shared between devices, and what starts the samples."""

from dataclasses import dataclass
from typing import Any, Literal

from foundation import InputError


@dataclass(frozen=True)
class NiClocks:
    """Where a task takes its clocks and its start from; empty: DAQmx chooses, which is right within one chassis.

    Parameters
    ----------
    sample_clock
        Terminal of an external sample clock, such as ``/cDAQ1/PFI0``.
    reference_clock
        Terminal of a reference clock that several chassis share, such as ``/PXI1Slot2/PXI_Clk10``.
    reference_rate : Hz
        Rate of that reference clock; None: DAQmx knows it.
    sync_pulse
        Terminal of the pulse that aligns the converters of several devices (delta-sigma modules).
    start_trigger
        Terminal whose edge starts the samples; empty: they start at once.
    start_edge
        Edge that counts.
    trigger_timeout : s
        Time to wait for that edge.
    """

    sample_clock: str = ""
    reference_clock: str = ""
    reference_rate: float | None = None
    sync_pulse: str = ""
    start_trigger: str = ""
    start_edge: Literal["rising", "falling"] = "rising"
    trigger_timeout: float = 600.0

    def apply(self, task: Any, rate: float) -> None:
        """Set up timing and trigger of a task that has its channels; ``rate`` in Hz is the wanted one."""
        from nidaqmx import constants

        task.timing.cfg_samp_clk_timing(
            rate, source=self.sample_clock, sample_mode=constants.AcquisitionType.CONTINUOUS
        )
        if self.reference_clock:
            task.timing.ref_clk_src = self.reference_clock
            if self.reference_rate is not None:
                task.timing.ref_clk_rate = self.reference_rate
        if self.sync_pulse:
            task.timing.sync_pulse_src = self.sync_pulse
        if self.start_trigger:
            edge = constants.Edge.RISING if self.start_edge == "rising" else constants.Edge.FALLING
            task.triggers.start_trigger.cfg_dig_edge_start_trig(self.start_trigger, trigger_edge=edge)

    def check(self, task: Any, devices: str) -> None:
        """Read back where the clocks come from.

        Raises
        ------
        InputError
            DAQmx took another terminal than the one asked for.
        """
        for what, wanted, attribute in (
            ("sample clock", self.sample_clock, "samp_clk_src"),
            ("reference clock", self.reference_clock, "ref_clk_src"),
            ("sync pulse", self.sync_pulse, "sync_pulse_src"),
        ):
            found = str(getattr(task.timing, attribute)) if wanted else ""
            if found.strip("/").lower() != wanted.strip("/").lower():
                raise InputError(f"{devices}: {what} is {found!r}, not {wanted!r} as asked; correct it in the session")
