"""Modal models, their fitting and the calibration to the tool tip: knows nothing of cutting."""

from modal_fit.modal_model import ModalModel, Residuals

__all__ = ["ModalModel", "Residuals"]
