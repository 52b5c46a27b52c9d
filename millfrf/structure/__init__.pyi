from .diagnosing import DiagnosisFiles, diagnose_files, diagnose_recordings, nominal_from_simulation

__all__ = [
    "DiagnosisFiles",
    "diagnose_files",
    "diagnose_recordings",
    "nominal_from_simulation",
]
