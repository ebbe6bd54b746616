"""The agreement matrix on made-up curves: who is named, and when nobody is."""

import numpy as np
import pytest
from made_up import trajectory_of

from flipproof.chapters.agreement.chapter import claims, study_agreement
from flipproof.frame.solvers import Missing
from slicemodel import Scenario

SCENARIO = Scenario(n_slices=1)
T = np.linspace(0.0, 0.5, 101)


def curve(shift, t=T, scenario=SCENARIO):
    return trajectory_of(scenario, t, omega=20.0 + shift, keeps_slices=True)


def matrix(*shifts, band=1e-3, **options):
    names = "abcd"[: len(shifts)]
    runs = {name: curve(shift) for name, shift in zip(names, shifts, strict=True)}
    return study_agreement(runs, dict.fromkeys(names, band), **options)


def test_those_within_their_bands_agree():
    found = matrix(0.0, 0.02, 0.039)
    assert found.words == "all agree within their bands"
    assert found.pair("c", "a").largest == pytest.approx(0.039 / 20)
    assert found.pair("a", "c").bands == pytest.approx(2e-3)


def test_a_few_times_outside_are_said():
    found = matrix(0.0, np.where(np.arange(len(T)) < len(T) // 25, 1.0, 0.0))
    assert found.words == "both agree within their bands at 96 % of the times or more"


@pytest.mark.parametrize(("shifts", "odd"), [((1.0, 0.0, 0.0), "a"), ((0.0, 1.0, 0.0), "b"), ((0.0, 0.0, -1.0), "c")])
def test_the_one_that_stands_alone_is_named(shifts, odd):
    found = matrix(*shifts)
    assert found.words == f"all but {odd} agree within their bands"


@pytest.mark.parametrize("shifts", [(0.0, 1.0), (0.0, 1.0, 2.0), (0.0, 0.03, 0.06), (0.0, 0.0, 1.0, 2.0)])
def test_nobody_is_named_where_no_one_explains_it(shifts):
    found = matrix(*shifts)
    assert found.words.endswith("no single one of them explains it")


def test_a_band_that_is_not_a_number_agrees_with_nobody():
    runs = {name: curve(0.0) for name in "abc"}
    found = study_agreement(runs, {"a": 1e-3, "b": 1e-3, "c": np.nan})
    assert found.words == "all but c agree within their bands"
    assert found.pair("a", "c").share == 0.0


def test_a_band_may_vary_in_time_and_one_time_in_twenty_may_lie_outside():
    late = np.where(T > 0.4, 1.0, 0.0)
    runs = {"a": curve(0.0), "b": curve(late)}
    assert not study_agreement(runs, {"a": 1e-3, "b": 0.0}).pair("a", "b").agree
    assert study_agreement(runs, {"a": 1e-3, "b": late / 20}).pair("a", "b").agree
    assert study_agreement(runs, {"a": 1e-3, "b": 0.0}, until=0.4).pair("a", "b").agree
    few = study_agreement(runs, {"a": 1e-3, "b": 0.0}, until=0.42)
    assert few.pair("a", "b").agree
    assert few.pair("a", "b").share < 1.0
    assert few.until == pytest.approx(0.42)
    assert not few.whole
    (finding,) = claims({"free-flight": few})
    assert finding.title.endswith(", up to 420 ms")
    assert study_agreement(runs, {"a": 1e-3, "b": 0.0}).whole


def test_runs_of_different_throws_or_times_are_refused():
    with pytest.raises(Missing, match="at least two"):
        study_agreement({"a": curve(0.0)}, {"a": 0.0})
    for other in (curve(0.0, t=T[:50]), curve(0.0, scenario=Scenario(n_slices=1, omega0=10.0))):
        with pytest.raises(Missing, match="b and a are not runs of one throw"):
            study_agreement({"a": curve(0.0), "b": other}, {"a": 0.0, "b": 0.0})
