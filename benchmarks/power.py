"""Plant known mistakes in right solvers, and print which check of ``flipproof certify`` names each of them first.

    python benchmarks/power.py                 # all of them, and right solvers, which no check may accuse
    python benchmarks/power.py recoil theta    # those whose name or words hold one of these

``ours`` are by those who wrote the checks. All others are by people who had read the contract and none of the checks:
they say what the first list cannot, how many mistakes pass that nobody here thought of. Exit status 1 if a mistake is
missed that is not known to be, or a right solver is accused.

What a list can witness. ``ours`` (32) share authors with the checks, and of ``first`` (99) no blind count was made. Of
the three lists after it two mistakes came later than the count; caught were 46 of 50, 68 of 70 and 87 of 94. The 33
after these were put to checks that had not been changed for them: caught were, the oldest first, 71 of 74, 60 of 60, 68
of 70, 56 of 60, 35 of 40, 47 of 50, 45 of 50, 47 of 50, 41 of 50, three times 46 of 50, 38 of 41, 48 of 54, 29 of 30,
40 of 40, 37 of 40, twice 35 of 36, 72 of 73, 38 of 40, 42 of 42, 35 of 40, three times 38 of 40, 39, 38, 40, 38, 32, 35
and 40 of 40. In ``thirtyfifth`` the solver of free flight declares no equation, as its author left it; with
``--equation free-flight`` 39 of 40 would have been caught. Since then ``equation`` fails where a solver that declares
none solves none. Left out are twelve mistakes of ``eighteenth`` and ``nineteenth`` that an earlier author had planted,
too, three that change no digit of forty random throws, and two solvers with their mistakes: one does not end on a throw
of the suite, and the other, ``pyport``, was accused without any. After each list checks or advice were changed, after
the last seventeen advice only, but for rules on late impacts, on what a solver of order 1 gets wrong, which is asked
again at finer steps, on impacts overlooked in long steps, of which low ones no longer count, on the order before
impacts, which is taken at more times and no longer from one lucky ratio, on rest speeds, of which slow impacts tell, on
speeds of impacts at one instant, on impacts of solvers that answer no r, on solvers too slow to be refined, on theta of
the mirror image, on fields whose errors rtol does not control, on lists that end early and on solvers that solve no
equation and declare none, and but for two throws: one lets slices go from the cap, the other has 700 impacts. The lines
of four to seventeen mistakes were changed after each of ``twentieth`` to ``thirtyseventh`` and not judged again. In
``twentyfourth`` all solvers are of free flight. All six right solvers of ``twentyfifth`` were accused: four answer
speeds of impacts with a sign, which had to be taken before its mistakes could be put to the checks, and two are the
paper's program, whose r_cm and J lag a step and whose slices at an end turn back in every step, as that program's may
now. The solvers of ``twentysixth`` answer no impacts: what their author had read did not say what a row of them holds.
``twentyninth`` is in C and comes through files; it needs a compiler. The author of ``seventeenth`` also wrote the six
solvers that he and the next author changed. A right solver whose impacts wait for its grid was accused, because three
levels of refinement agreed by chance, until the check confirmed at finer steps what it finds; one of ``thirtyseventh``,
because impacts of slices that omega hardly feels depend on the rest speed.
"""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from typing import Any, Final

from planted import InProcess, patches
from planted.asked import ASKED
from planted.compiled import DECLARED, Compiled, mistakes
from planted.ours import MISTAKES
from planted.right import RIGHT

from flipproof.foreign.certify import FAILED, certify
from flipproof.foreign.contract import Answer, Ask, ForeignError, LateError

BLIND: Final = (
    "first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth", "eleventh",
    "twelfth", "thirteenth", "fourteenth", "fifteenth", "sixteenth", "seventeenth", "eighteenth", "nineteenth",
    "twentieth", "twentyfirst", "twentysecond", "twentythird", "twentyfourth", "twentyfifth", "twentysixth",
    "twentyseventh", "twentyeighth", "thirtieth", "thirtyfirst", "thirtysecond", "thirtythird",
    "thirtyfourth", "thirtyfifth", "thirtysixth", "thirtyseventh",
)  # fmt: skip
"""Lists by people who had not seen the checks."""

LISTS: Final[dict[str, dict[str, Any]]] = {
    "ours": dict(MISTAKES),
    "asked": dict(ASKED),
    **{name: patches(name) for name in BLIND},
    "twentyninth": mistakes(),
    "right": dict(RIGHT) | ({f"{base}_in_c": Compiled("In C.", base) for base in DECLARED} if mistakes() else {}),
}
"""Mistakes by list and name, and solvers without one."""

MISSED: Final = (
    "hits_split_by_tolerance", "support_lost_unseen", "reduced_free_body_keeps_released_slices",
    "lost_support_by_constant_force", "six_decimals_for_six_digits", "guard_against_endless_bounces",
    "angle_in_single_precision", "dop853_between_events_release_or_impact", "eq8_rtol_stale_trial",
    "dormand_prince_first_same_as_last_across_impacts",
    "fixed_inside_releases_the_base_only", "mirrored_hit_put_on_the_end", "adams_ratio_upside_down",
    "single_angle_too", "adaptive_first_slope_kept", "single_heun3_drag_does_not_turn", "lists_peek_keeps_rests",
    "single_midpoint_parabola_without_two", "angle_rk4_lifted_at_old_angle",
    "kick_drift_hit_at_mid_step_speed", "frozen_grid_never_lies",
    "single_midpoint_compensation_added", "kick_drift_stopped_momentum_lost", "series_weak_pushes_hold_nothing",
    "adams_pece_history_across_release", "abm_impact_at_step_end", "hamilton_reports_past_impact",
    "hamilton_first_in_the_list", "newmark_reports_last_tick", "strang_omega_one_step_old",
    "limiter_rest_of_step_lost", "limiter_one_bounce_a_step", "angle_rk4_rule_of_three",
    "expint_phi_cancellation", "sdirk_interpolant_starts_too_hard",
    "sdirk_misprinted_coefficient", "events_start_not_snapped",
    "events_base_before_cap", "free_in_c_11", "eq8_in_c_29",
    "cashkarp_first_stage_kept_across_impacts", "blanesmoan_impacts_at_step_end",
    "hermite_rk4_output_over_impact", "lobatto_release_at_grid", "lobatto_one_of_a_tie",
    "bdf_rebound_at_step_end", "tsit_no_recoil",
    "exphermite_phi3", "exphermite_endslope", "strangfree_merge",
)  # fmt: skip
"""Mistakes known to be missed."""


class Limited(InProcess):
    """A solver in this process that may take a minute of processor time for an answer (POSIX)."""

    def __call__(self, ask: Ask) -> Answer:
        """Return the checked answer."""

        def late(*_: object) -> None:
            raise LateError("no answer within 60 s of processor time")

        if hasattr(signal, "setitimer"):
            signal.signal(signal.SIGPROF, late)
            signal.setitimer(signal.ITIMER_PROF, 60.0)
        try:
            return super().__call__(ask)
        except ForeignError:
            raise
        except SystemError as error:  # what compiled code makes of ``late``
            if not isinstance(error.__cause__, LateError):
                raise
            raise error.__cause__ from None
        except (RuntimeError, ArithmeticError, LookupError, ValueError) as error:  # as it would in a process of its own
            raise ForeignError(f"{type(error).__name__}: {error}") from None
        finally:
            if hasattr(signal, "setitimer"):
                signal.setitimer(signal.ITIMER_PROF, 0.0)


def words_of(planted: Any) -> str:
    """Return what is wrong, or what a right solver is."""
    return str(getattr(planted, "words", None) or (planted.__doc__ or "").partition("\n")[0])


def judged(place: tuple[str, str]) -> tuple[str, str, float]:
    """Return the first check that fails because of one mistake, its line, and the processor time that this took [s]."""
    group, name = place
    planted, began = LISTS[group][name], time.process_time()
    if isinstance(planted, Compiled):
        with closing(planted.runner()) as runner:
            found = certify(runner, equation=DECLARED[planted.base]["equation"], until_failed=True)
    else:
        solver = planted.solver() if hasattr(planted, "solver") else planted()
        found = certify(Limited(solver, name), until_failed=True)
    first = next((result for result in found.results if result.verdict == FAILED), None)
    check, line = (first.check, first.text) if first else ("", "")
    return check, line, time.process_time() - began


def main() -> int:
    """Print a line a mistake and the rate of each list."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("words", nargs="*")
    parser.add_argument("--lists", nargs="+", choices=LISTS, default=list(LISTS), help="these alone, in this order")
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    options = parser.parse_args()
    places = [
        (group, name)
        for group in options.lists
        for name, one in LISTS[group].items()
        if not options.words or any(word in f"{name} {words_of(one)}" for word in options.words)
    ]
    seen: dict[str, list[bool]] = {group: [] for group in options.lists}
    wrong = 0
    with ProcessPoolExecutor(options.jobs) as pool:
        for (group, name), (check, line, seconds) in zip(places, pool.map(judged, places), strict=True):
            seen[group].append(bool(check))
            wrong += bool(check) if group == "right" else not check and name not in MISSED
            said = line or ("no check, as is known" if name in MISSED else "no check")
            print(f"{group:6} {name}: {words_of(LISTS[group][name])}\n       {seconds:.1f} s  {check or '-'}: {said}")
            sys.stdout.flush()
    for group, each in seen.items():
        verdict = "solvers accused" if group == "right" else "mistakes caught"
        print(f"{group:6} {verdict}: {sum(each)} of {len(each)}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
