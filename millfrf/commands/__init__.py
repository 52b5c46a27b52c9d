"""The commands, one a file. Their modules import nothing heavy, so that `--help` is quick."""

from .acquire import acquire
from .calibrate import calibrate
from .campaign import campaign
from .chatter import chatter
from .convert import convert
from .demo import demo
from .diagnose import diagnose
from .estimate import estimate
from .fit import fit
from .inspect import inspect
from .lobes import lobes
from .plan import plan
from .predict import predict
from .recover import recover
from .report import report
from .tap import tap

COMMANDS = (
    demo,
    plan,
    acquire,
    recover,
    inspect,
    convert,
    estimate,
    tap,
    fit,
    calibrate,
    lobes,
    chatter,
    predict,
    diagnose,
    campaign,
    report,
)
"""In the order in which `--help` lists them."""

__all__ = ["COMMANDS"]
