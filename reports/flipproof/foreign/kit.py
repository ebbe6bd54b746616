"""The suite as files, for solvers in any language: what is asked lies in folders, answers are CSV, verdicts come back.

    DIR/kit.json             what the solver says of itself, and the list of asks
    DIR/asks/0001/           scenario.toml, scenario.json, times.csv, start.csv, effort.txt
    DIR/asks/0001/answer.csv is written by the solver: columns t, theta, omega and, if known, r_0 ..., v_0 ..., r_cm

Some asks depend on earlier answers: ``grade`` adds them, and says how many wait.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Final

import numpy as np

from flipproof.foreign.certify import CHECKS, Certificate, certify
from flipproof.foreign.contract import Answer, Ask, Traits
from flipproof.foreign.files import answer_in, write_ask
from flipproof.foreign.specs import Runner, WaitingError

INDEX: Final = "kit.json"


class Kit(Runner):
    """A folder of asks and answers as a runner; a folder that is no kit raises a ValueError.

    Parameters
    ----------
    folder : Path - holds an ``INDEX``; asks that are not there yet are added
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            index = json.loads((folder / INDEX).read_text(encoding="utf-8"))
            self.traits = Traits(**index["solver"])
            self.asks: list[str] = [str(key) for key in index["asks"]]
            if index["kit"] != 1:
                raise ValueError(f"format {index['kit']!r}, must be 1")
        except OSError as error:
            raise ValueError(f"{folder}: is no kit ({INDEX}: {error.strerror or error})") from None
        except (ValueError, TypeError, KeyError) as error:
            raise ValueError(f"{folder / INDEX}: is not readable ({error})") from None
        self.waiting = 0

    @classmethod
    def made(cls, folder: Path, traits: Traits) -> Kit:
        """Return a new kit in an empty or new folder, with every ask that needs no earlier answer.

        Raises ValueError if the folder holds something.
        """
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise ValueError(f"{folder} is not empty; name a new folder")
        (folder / "asks").mkdir(parents=True)
        _write_index(folder, traits, [])
        kit = cls(folder)
        kit.grade()
        return kit

    def grade(self) -> tuple[Certificate, int]:
        """Return the certificate by the answers that are there, and how many asks wait for one."""
        self.waiting = 0
        return certify(self, CHECKS), self.waiting

    def __call__(self, ask: Ask) -> Answer:
        """Return the answer that lies in the folder of an ask; add the folder if there is none."""
        path = self._place(ask) / "answer.csv"
        if not path.is_file():
            self.waiting += 1
            raise WaitingError(f"{path.relative_to(self.folder)} is not there yet")
        return answer_in(path, ask, str(path.relative_to(self.folder)))

    def _place(self, ask: Ask) -> Path:
        """Return the folder of an ask, which equal asks share."""
        text = json.dumps([ask.scenario.to_mapping(), ask.effort, dict(ask.options)], sort_keys=True)
        key = hashlib.sha256(text.encode() + np.ascontiguousarray(ask.times).tobytes()).hexdigest()[:16]
        if key in self.asks:
            return self.folder / "asks" / f"{self.asks.index(key) + 1:04d}"
        self.asks.append(key)
        place = self.folder / "asks" / f"{len(self.asks):04d}"
        place.mkdir()
        write_ask(ask, place)
        (place / "scenario.json").write_text(json.dumps(ask.scenario.to_mapping(), indent=1) + "\n", encoding="utf-8")
        (place / "effort.txt").write_text("" if ask.effort is None else f"{ask.effort!r}\n", encoding="utf-8")
        _write_index(self.folder, self.traits, self.asks)
        return place


def _write_index(folder: Path, traits: Traits, asks: list[str]) -> None:
    index = {"kit": 1, "solver": asdict(traits), "asks": asks}
    (folder / INDEX).write_text(json.dumps(index, indent=1) + "\n", encoding="utf-8")
