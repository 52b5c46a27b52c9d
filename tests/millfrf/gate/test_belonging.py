"""Files of one report: tied to each other by their sources, step by step, or said to belong to something else."""

from millfrf.gate import ReportFile, check_belonging


def given(name: str, kind: str, *sources: str) -> ReportFile:
    made_of = [{"file": source, "sha256": f"hash of {source}"} for source in sources]
    return ReportFile(name, kind, f"hash of {name}", {"sources": made_of})


SWEEP = given("sweep.h5", "recording")
TAPS = given("taps.h5", "frf", "hammer.h5")
HOUSING = given("housing.json", "modal model", "sweep.h5")
TIP = given("tip.json", "modal model", "housing.json", "taps.h5")


def test_taps_that_carried_the_model_to_the_tip_belong() -> None:
    assert check_belonging([SWEEP, TAPS, HOUSING, TIP]) == []


def test_taps_of_another_machine_do_not() -> None:
    [said] = check_belonging([SWEEP, given("others.h5", "frf", "hammer2.h5"), HOUSING])
    assert said.startswith("others.h5 was not made from sweep.h5 but from hammer2.h5")


def test_a_model_of_other_recordings_is_not_saved_by_its_own_frf() -> None:
    frf = given("frf.h5", "frf", "old.h5")
    said = check_belonging([SWEEP, frf, given("model.json", "modal model", "frf.h5")])
    assert any(each.startswith("frf.h5 was not made from sweep.h5") for each in said)


def test_one_cutting_file_does_not_tie_lobes_of_another_model() -> None:
    cut = given("cut.toml", "cutting data")
    lobes = given("lobes.csv", "lobes", "other.json", "cut.toml")
    [said] = check_belonging([SWEEP, HOUSING, cut, lobes])
    assert said.startswith("lobes.csv was not made from housing.json but from other.json")


def test_verdicts_belong_to_their_cutting_file_and_to_any_recordings() -> None:
    verdicts = given("chatter.json", "chatter verdicts", "cut1.h5", "cut.toml")
    assert check_belonging([SWEEP, HOUSING, given("cut.toml", "cutting data"), verdicts]) == []
    [said] = check_belonging([SWEEP, given("other.toml", "cutting data"), verdicts])
    assert said.startswith("chatter.json was not made from other.toml but from cut1.h5, cut.toml")


def test_lobes_of_another_test_are_doubted_once() -> None:
    """Neither model nor cutting data are theirs: one cause, one sentence."""
    [said] = check_belonging(
        [HOUSING, given("cut.toml", "cutting data"), given("lobes.csv", "lobes", "a.json", "b.toml")]
    )
    assert said.startswith("lobes.csv was not made from housing.json, cut.toml but from a.json, b.toml")
