"""`EstimateOptions`: how recordings become an FRF; and `Estimate`, the FRF with what it was made from."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from estimation import CrossSpectra, Frf, InputIndependence
from millfrf.core import InputError, Result, Summary, counted, doubts_line

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STACKS = ("sum", "side-by-side")
INSTRUMENTAL, LOCAL = "instrumental-variable", "local-polynomial"
ESTIMATORS = ("h1", "h2", "hv", INSTRUMENTAL, LOCAL)
TITLES = {INSTRUMENTAL: "FRF by instrumental variables", LOCAL: "FRF by local polynomials"}


@dataclass(frozen=True)
class EstimateOptions:
    """Options with which recordings are turned into an FRF.

    Parameters
    ----------
    segment : s
        Duration of a segment.
    overlap, window
        Overlap and window of the segments, as in :class:`estimation.SpectralSettings`.
    stack
        Way of stacking tests: ``sum`` or ``side-by-side``.
    excitations, responses
        Names of the channels; empty: chosen by quantity.
    band : Hz
        Lowest and highest frequency of the lines to keep; None: all.
    stream
        Name of the sample clock; None: the only one.
    estimator
        Estimator, one of :data:`ESTIMATORS`; all but H1 take the tests together.
    exclude
        Whether to leave out segments with overload, clipping or dropped samples.
    instruments
        Channels that drive the forces and that no disturbance reaches, for ``instrumental-variable``.
    """

    segment: float = 8.0
    overlap: float = 0.5
    window: str = "hann"
    stack: str = "sum"
    excitations: tuple[str, ...] = ()
    responses: tuple[str, ...] = ()
    band: tuple[float, float] | None = None
    stream: str | None = None
    estimator: str = "h1"
    exclude: bool = False
    instruments: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Estimate(Result):
    """An estimated FRF, with the spectra it was made from.

    Parameters
    ----------
    frf
        FRF in the recordings' own quantity (accelerance from accelerations).
    tests
        Spectra, test by test.
    independence
        Independence of the stacked inputs, line by line.
    warnings
        Doubts about the FRF, one sentence each.
    options
        How the recordings were turned into the FRF.
    """

    frf: Frf
    tests: tuple[CrossSpectra, ...]
    independence: InputIndependence
    warnings: tuple[str, ...]
    options: EstimateOptions

    def plot(self, axes: "Axes | None" = None, **choices: Any) -> "Axes":
        """Draw entries of the FRF and return the axes; see :func:`millfrf.figures.frf.draw_frf` for the choices."""
        return self.frf.plot(axes, **choices)

    def _summary(self) -> Summary:
        frf, averages = self.frf, sum(test.effective_averages for test in self.tests)
        shape = f"{counted(len(frf.responses), 'response')} x {counted(len(frf.excitations), 'excitation')}"
        holds = "" if frf.band is None else f"; holds in {frf.band[0]:.4g} to {frf.band[1]:.4g} Hz"
        rows = tuple(
            (str(number + 1), str(test.n_segments), f"{test.effective_averages:.3g}", str(test.n_excluded))
            for number, test in enumerate(self.tests)
        )
        return Summary(
            f"Estimate by {self.options.estimator}: {counted(len(self.tests), 'test')} worth {averages:.3g} averages",
            (
                f"frf: {frf.quantity} in {frf.unit}, {shape}, {counted(len(frf.frequencies), 'line')}{holds}",
                *doubts_line(self.warnings),
            ),
            ("test", "segments", "effective averages", "left out"),
            rows,
        )


def check_options(options: EstimateOptions) -> None:
    """Refuse unknown names, and options that contradict each other.

    Raises
    ------
    InputError
        With the option and the remedy.
    """
    if options.stack not in STACKS:
        raise InputError(f"unknown stack {options.stack!r}; use one of {', '.join(STACKS)}")
    if options.estimator not in ESTIMATORS:
        raise InputError(f"unknown estimator {options.estimator!r}; use one of {', '.join(ESTIMATORS)}")
    if options.stack != "sum" and options.estimator != "h1":
        raise InputError(f"estimator {options.estimator} takes summed tests only; use --stack sum")
    if options.estimator == INSTRUMENTAL and not options.instruments:
        raise InputError(
            f"estimator {INSTRUMENTAL} needs instruments: name channels that drive the forces and that no disturbance "
            "reaches with --instrument"
        )
    if options.instruments and options.estimator != INSTRUMENTAL:
        raise InputError(f"--instrument is for --estimator {INSTRUMENTAL}, not for {options.estimator}; leave it out")
    if options.estimator == LOCAL and options.band is None:
        raise InputError(f"estimator {LOCAL} gives every line of the whole records: say which with --band LO HI")
    if options.estimator == LOCAL and options.exclude:
        raise InputError(f"estimator {LOCAL} has no segments to leave out: drop --exclude, or use another estimator")
