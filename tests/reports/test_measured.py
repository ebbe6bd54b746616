"""A measurement beside the solvers: the film of a lesson names the equation that made it."""

import numpy as np
import pytest

import ode_reference
from flipproof.build import ask_of, build, gather_report
from flipproof.film.clip import read_table
from flipproof.film.measured import HELD, hold, part_measured
from flipproof.frame.pool import SerialExecutor
from flipproof.frame.provenance import provenance
from flipproof.output.tables import trajectory_csv
from slicemodel import Scenario

THROW = Scenario(water_mass=0.33, n_slices=4, drag=0.825, restitution=0.5, omega0=20.0, theta0=1.5, duration=0.3)


def filmed(path, model, quantity="theta", noise=6e-3):
    """Write a flight of an equation as somebody would measure it; return its path."""
    run = ode_reference.solve(THROW, model=model, times=np.linspace(0.0, THROW.duration, 73))
    values = getattr(run, quantity) + noise * np.random.default_rng(3).standard_normal(len(run.t))
    rows = [f"{t:.6f},{value:.6f}" for t, value in zip(run.t, values, strict=True)]
    path.write_text("\n".join([f"t,{quantity}", *rows]) + "\n", encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def held(tmp_path_factory):
    """Films of two equations beside the solvers, by equation."""
    folder = tmp_path_factory.mktemp("films")
    return {m: hold(read_table(filmed(folder / f"{m}.csv", m)), THROW) for m in ("free-flight", "eq8")}


@pytest.mark.parametrize(("model", "named"), [("free-flight", "free-flight"), ("eq8", "midpoint")])
def test_the_equation_that_made_a_film_is_named(held, model, named):
    measured = held[model]
    best, *others = measured.fits
    assert best.estimate.solver == named
    assert best.explained
    assert not any(one.explained for one in others)
    assert best.noise == pytest.approx(6e-3, rel=0.4, abs=0.0)
    low, high = best.estimate.interval("gamma", 0.999)
    assert low < THROW.damping_rate < high
    ids = [finding.id for finding in measured.findings()]
    assert len(set(ids)) == len(ids) == len(HELD)
    assert measured.exhibit().table.splitlines()[0].count(",") == 1 + len(HELD)


def test_a_report_that_is_given_a_measurement_has_a_section_of_it(held, monkeypatch):
    measurement = held["free-flight"].film

    def known(asked, throw):
        assert asked is measurement
        assert throw == THROW
        return held["free-flight"]

    monkeypatch.setattr("flipproof.film.measured.hold", known)
    ask, contents = ask_of(THROW, "quick"), (part_measured(measurement),)
    report = build(gather_report(ask, pool=SerialExecutor(), contents=contents), provenance("flipproof report"))
    assert '<section id="measured" class="fold">' in report.pages["evidence.html"]
    assert '<figure id="figure-measured">' in report.pages["evidence.html"]
    assert "Your measurement is nearest to free flight" in report.pages["index.html"]
    assert [figure["section"] for figure in report.summary["figures"]] == ["measured"]
    assert {finding.id for finding in report.findings} == {f"measured-fit-{name}" for name in HELD}


def test_a_measured_omega_is_held_too(tmp_path):
    measurement = read_table(filmed(tmp_path / "flight.csv", "free-flight", "omega", 0.05))
    assert (measurement.quantity, len(measurement.t)) == ("omega", 73)


def test_a_simulation_is_a_measurement(tmp_path):
    path = tmp_path / "simulated.csv"
    path.write_text(trajectory_csv(ode_reference.solve(THROW, model="eq8")), encoding="utf-8")
    assert read_table(path).quantity == "theta"
